"""A blade drawn through sand, against forces measured in a laboratory; prints one JSON line per depth.

Measured: Obermayr et al. 2011, Prediction of draft forces in cohesionless soil with the discrete element method, Journal of
Terramechanics 48: a vertical blade 0.2 m wide in washed sand of 1440 kg/m^3, friction angle 35 degrees, tan(delta) = 0.29
at the blade; mean draft over 0.5 to 1.5 m of its way.

The grains here are ten times as large as those of the sand. Nothing is fitted to the forces: with their friction and rolling
resistance they come to rest at 35 degrees (``sand_sim repose``), and their density gives that of the bed.

Run from the root of the source tree: ``python -m benchmarks.blade``.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.provenance import provenance
from sand_sim import ToolPose, World, read_scene

MEASURED = {0.1: 280.0, 0.2: 820.0}  # mean draft [N] at a depth [m]
DIAMETER = {0.1: 0.02, 0.2: 0.024}  # of the grains [m] at a depth [m]
FRICTION, ROLLING, AT_BLADE = 0.5, 0.4, 0.29
DENSITY = 3000.0  # [kg/m^3] of the grains, of which a bed has about half
WIDTH, ASIDE, THICK = 0.2, 0.25, 0.02  # of the blade, of the sand beside it, of the blade's plate [m]
BEGIN, AVERAGED, WAY, SPEED = 0.25, 0.5, 1.5, 0.25  # start, where averages begin and end behind it [m]; [m/s]


def bed(diameter: float, size: list[float], blade: dict, threads: int | None) -> dict:
    """A scene with a box of sand.

    Args:
        diameter: of the grains, on the mean [m].
        size: of the bed [m].
        blade: the tool.
        threads: cores to use; all if None.
    """
    length, width, height = size
    sand = {"between": ["sand", "sand"], "restitution": 0.4, "friction": FRICTION, "rolling_friction": ROLLING}
    fill = {"material": "sand", "radius": {"uniform": [0.45 * diameter, 0.55 * diameter]}, "height": height}
    box = {"name": "box", "type": "box", "material": "sand", "open": ["top"]}
    return {
        "materials": {
            "sand": {"density": DENSITY, "young": 1e8, "poisson": 0.25},
            "steel": {"density": 7800.0, "young": 1e10, "poisson": 0.3},
        },
        "pairs": [sand, sand | {"between": ["sand", "steel"], "friction": AT_BLADE, "rolling_friction": 0.0}],
        "contact": {"rolling": "spring"},
        "fills": [fill | {"region": {"low": [0.0, 0.0, 0.0], "high": [length, width, 2.3 * height]}}],
        "boundaries": [box | {"low": [0.0, 0.0, 0.0], "high": [length, width, 4.0 * height]}],
        "tools": {"blade": blade},
        "settle": {"time": 3.0, "speed": 0.01},
        "frame_rate": 20,
        "solver": {"threads": threads} if threads else {},
    }


def draw_blade(depth: float, threads: int | None) -> dict:
    """Draw the blade through a bed it stood in from the start, and report the force of the sand on it."""
    diameter = DIAMETER[depth]
    size = [BEGIN + WAY + 4.0 * depth, WIDTH + 2.0 * ASIDE, depth + 6.0 * diameter]
    start = np.array([BEGIN, 0.5 * size[1], size[2] - depth])
    with tempfile.TemporaryDirectory() as folder:
        plate = trimesh.creation.box((THICK, WIDTH, 3.0 * depth))
        plate.apply_translation([0.0, 0.0, 1.5 * depth])
        plate.export(Path(folder) / "blade.stl")
        blade = {"mesh": "blade.stl", "material": "steel", "contact": "smooth", "particle_radius": 0.006}
        blade["pose"] = {"position": start.tolist()}
        world = World(read_scene(bed(diameter, size, blade, threads), Path(folder)), progress=_tell)
    grains = world.observe().grains
    low = grains.position[:, 2] < 0.5 * size[2]
    goal = start + np.array([WAY, 0.0, 0.0])
    world.apply(ToolPose("blade", goal, np.array([0.0, 0.0, 0.0, 1.0]), time=world.time + WAY / SPEED))
    begin, way, force = time.perf_counter(), [], []
    while not world.resting("blade"):
        world.step(world.frame_steps)
        seen = world.observe().tool("blade")
        way.append(seen.position[0] - BEGIN)
        force.append(seen.world_force)
        _tell(f"blade at {way[-1]:.2f} m, draft {-force[-1][0]:.0f} N", way[-1] / WAY)
    draft, _, lift = np.mean(np.array(force)[np.array(way) > AVERAGED], axis=0) * [-1.0, 1.0, 1.0]
    return {
        "case": f"blade, {depth:g} m deep",
        "draft_N": round(float(draft), 1),
        "measured_N": MEASURED[depth],
        "lift_N": round(float(lift), 1),
        "bed_density": round(float(grains.mass[low].sum() / (size[0] * size[1] * 0.5 * size[2])), 0),
        "grains": len(grains),
        "wall_s": round(time.perf_counter() - begin, 1),
        "doubts": list(world.observe().health.doubts),
    }


def _tell(stage: str, share: float) -> None:
    print(f"\r{stage} {100.0 * share:3.0f} %    ", end="", file=sys.stderr)


def main(arguments: list[str] | None = None) -> None:
    """Run the benchmark and print its JSON lines."""
    parser = argparse.ArgumentParser(prog="blade", description=__doc__.split("\n", 1)[0])
    parser.add_argument("--depth", type=float, nargs="+", choices=MEASURED, default=list(MEASURED), help="of the blade [m]")
    parser.add_argument("--threads", type=int, help="cores to use; all if left out")
    options = parser.parse_args(arguments)
    for depth in options.depth:
        report = draw_blade(depth, options.threads)
        print(file=sys.stderr)
        print(json.dumps(report | provenance(options.threads)), flush=True)


if __name__ == "__main__":
    main()
