"""What is compared between two runs of a scene, and how far apart they are. Single grains are chaotic and never compared."""

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from sand_sim.border import Observation
from sand_sim.following import follow
from sand_sim.readout.trust import kind_of
from sand_sim.scene.types import Scene, SceneError
from sand_sim.study.impact import Impact
from sand_sim.study.sample import Sample
from sand_sim.tool_motion.playing import frame_times
from sand_sim.world import World

SMOOTHED = 0.1  # of the duration: standard width of the moving mean over histories
REACHED = 0.95  # share of the mass that lies within the reach


class Quantity(Protocol):
    """What a study compares."""

    def measure(self, world: World, check: Callable[[], None]) -> Sample:
        """Run a world from time zero to the end of its scene; ``check`` is called now and then and may raise."""

    def exact(self, scene: Scene) -> Sample | None:
        """The closed form, if there is one."""

    def errors(self, sample: Sample, reference: Sample) -> dict[str, float]:
        """Relative distances of a run from the reference [1]; the largest one counts."""


def play(world: World, look: Callable[[Observation], dict], check: Callable[[], None]) -> Sample:
    """Play a scene with its trajectories and keep what ``look`` sees in each frame; only the stepping is timed.

    Raises:
        SceneError: if the scene has no frame.
    """
    world.step(1)  # kernels are compiled and recorded before the clock starts
    world.reset()
    rows, times, spent, seen, doubts = [], [], 0.0, world.observe(), {}
    for moment in frame_times(world.scene):
        check()
        begin = time.perf_counter()
        follow(world, moment)
        spent += time.perf_counter() - begin
        seen = world.observe()
        times.append(seen.time)
        rows.append(look(seen))
        doubts |= {kind_of(doubt): doubt for doubt in seen.health.doubts}  # also those that pass
    if not rows:
        raise SceneError("duration: is less than half a frame, so there is nothing to compare; make it longer")
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Sample(np.array(times), values, spent, seen.steps, world.time_step, tuple(doubts.values()))


class Wrench:
    """Wrench histories of the driven tools: smoothed over a tenth of the duration, and their integrals."""

    def measure(self, world: World, check: Callable[[], None]) -> Sample:
        """Run a world; values are forces in the world frame [N], torques in the tool frame [N m] and work [J] of each tool."""
        names = [tool.name for tool in world.scene.tools if tool.trajectory]

        def look(seen: Observation) -> dict:
            reports = {name: seen.tool(name) for name in names}
            return {
                key: value
                for name, report in reports.items()
                for key, value in (
                    (f"{name} force", report.world_force),
                    (f"{name} torque", report.torque),
                    (f"{name} work", report.work),
                )
            }

        return play(world, look, check)

    def exact(self, scene: Scene) -> None:
        """There is no closed form."""

    def errors(self, sample: Sample, reference: Sample) -> dict[str, float]:
        """Root mean square distances of smoothed histories, and distances of impulses and of the work at the end."""
        errors = {}
        for name, expected in reference.values.items():
            value = sample.values[name]
            if name.endswith(" work"):
                errors[name] = relative(value[-1], expected[-1])
            else:
                smooth = [smoothed(one, reference.time) for one in (value, expected)]
                errors[name] = relative(*smooth)
            if name.endswith(" force"):
                errors[name.replace(" force", " impulse")] = relative(value.sum(axis=0), expected.sum(axis=0))
        return errors


class Spread:
    """How far a heap spreads from where its middle was, how high its centre of mass lies, and how much of it stays."""

    def measure(self, world: World, check: Callable[[], None]) -> Sample:
        """Run a world; values are the horizontal reach of 95 % of the mass and the height of its centre [m], and its share left.

        Raises:
            SceneError: if all grains leave the domain.
        """
        start = world.observe().grains
        middle = start.mass @ start.position[:, :2] / start.mass.sum()

        def look(seen: Observation) -> dict:
            grains = seen.grains
            if not len(grains):
                raise SceneError(f"domain: all grains have left it at t = {seen.time:.3g} s; enlarge it or shorten 'duration'")
            away = np.linalg.norm(grains.position[:, :2] - middle, axis=1)
            order = np.argsort(away)
            within = np.cumsum(grains.mass[order])
            reach = away[order[np.searchsorted(within, REACHED * within[-1])]]
            mass = grains.mass.sum()
            return {"reach": reach, "height": grains.mass @ grains.position[:, 2] / mass, "mass": mass / start.mass.sum()}

        return play(world, look, check)

    def exact(self, scene: Scene) -> None:
        """There is no closed form."""

    def errors(self, sample: Sample, reference: Sample) -> dict[str, float]:
        """Root mean square distances of the histories, and distance of the last reach.

        Reach and height are compared against the range of the reference's. Mass against all of it: where a single grain of many
        leaves, a second one is no large error.
        """
        errors = {}
        for name, expected in reference.values.items():
            distance = float(np.sqrt(np.mean((sample.values[name] - expected) ** 2)))
            errors[name] = distance / (1.0 if name == "mass" else float(np.ptp(expected)) or 1.0)
        errors["last reach"] = relative(sample.values["reach"][-1], reference.values["reach"][-1])
        return errors


def relative(value: np.ndarray, expected: np.ndarray) -> float:
    """Distance over the length of what is expected, both as vectors; infinite where nothing but something is there [1]."""
    length = float(np.linalg.norm(expected))
    distance = float(np.linalg.norm(np.asarray(value) - expected))
    return distance / length if length > 0.0 else (np.inf if distance > 0.0 else 0.0)


def smoothed(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Moving mean of a history, shape (n,) or (n, k), with Gaussian weights of a tenth of its duration.

    Args:
        values: history.
        time: of its rows, shape (n,) [s].
    """
    width = SMOOTHED * (time[-1] - time[0]) if len(time) > 1 else 1.0
    weights = np.exp(-0.5 * ((time[:, None] - time) / width) ** 2)
    return (weights / weights.sum(axis=1, keepdims=True)) @ values


QUANTITIES: dict[str, Quantity] = {"impact": Impact(), "spread": Spread(), "wrench": Wrench()}


def choose_quantity(scene: Scene, grains: int) -> str:
    """Name of the quantity that suits a scene: one or two grains collide, tools feel wrenches, anything else spreads."""
    if grains <= 2:
        return "impact"
    return "wrench" if any(tool.trajectory for tool in scene.tools) else "spread"
