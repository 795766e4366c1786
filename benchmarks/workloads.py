"""Speed of the step: settled beds of spheres (W1) and of four-sphere grains (W2), and a blade drawn through a bed (W3).

Grains of 2 mm, Hertz and Mindlin with history, friction 0.5, restitution 0.5, single precision, the automatic time step. The
coordination number printed beside the speed shows that the work is that of a settled bed.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.beds import WIDTHS, bed_scene, blade_tool, find_bed
from sand_sim import ToolPose, World, read_scene
from sand_sim.assembly.tool_model import Progress

BLADE_SPEED = 0.1  # [m/s]


@dataclass
class Workload:
    """A world that is timed.

    Attributes:
        name: of the case.
        world: ready to step.
        blade: whether its tool is drawn along x.
    """

    name: str
    world: World
    blade: bool = False

    def run(self, steps: int) -> float:
        """Wall time [s] of some steps."""
        self.steer(steps)
        begin = time.perf_counter()
        self.world.step(steps)
        return time.perf_counter() - begin

    def steer(self, steps: int) -> None:
        """Send the blade on its way for some steps."""
        if self.blade:
            end = self.world.time + steps * self.world.time_step
            self.world.apply(ToolPose("blade", np.array([BLADE_SPEED * end, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), end))

    def figures(self) -> dict:
        """What shows that the work is the same: grains, spheres, contacts; and what speaks against the run."""
        observation, spheres = self.world.observe(), len(self.world.assembly.table)
        health = observation.health
        return {
            "grains": len(observation.grains),
            "spheres": spheres,
            "coordination_number": round(2.0 * health.contacts / len(observation.grains), 3),
            "doubts": list(health.doubts),
        }


def make_workload(
    name: str, beds: Path | None, folder: Path, threads: int, progress: Progress = lambda stage, share: None
) -> Workload:
    """A case on a number of threads.

    Args:
        name: W1-8000, W1-32000, W1-32000-idle (with ten tools far from the bed), W2, or W3.
        beds: folder of settled beds, or None.
        folder: for beds settled here.
        threads: cores.
        progress: called with what is being done and the share of it, 0 to 1.
    """
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    fields = {"solver": {"threads": threads}}
    if name == "W2":
        bed, shape = "bed_clumps_8000", "tetrahedron"
    elif name == "W3":
        bed, shape = "bed_blade_grains", "sphere"
        fields["tools"] = {"blade": blade_tool(folder)}
    else:
        bed, shape = "bed_" + name.split("-")[1], "sphere"
    if name.endswith("idle"):
        far = {"position": [0.0, 0.0, 0.1]}
        fields["tools"] = {f"blade_{k}": blade_tool(folder) | {"pose": far} for k in range(10)}
    widths = (WIDTHS[bed], WIDTHS[bed])
    scene = bed_scene(widths, find_bed(bed, beds, folder, progress), shape=shape, **fields)
    return Workload(name, World(read_scene(scene, folder), progress), blade=name == "W3")
