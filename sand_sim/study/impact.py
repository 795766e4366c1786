"""One impact, of a grain on a plane or of two grains, against the closed form of Hertz."""

import math
import time
from collections.abc import Callable

import numpy as np

from sand_sim.scene.pairing import pair_numbers
from sand_sim.scene.types import Scene, SceneError
from sand_sim.study.closed_forms import impact_overlap
from sand_sim.study.sample import Sample
from sand_sim.world import World

_TIMED = 0.1  # [s]
_LONGEST = 10  # durations that bodies may take to part
_ASIDE = 1e-3  # of the speed of approach: less across it, or of a rim that turns, leaves friction nothing to do


class Impact:
    """Peak force and overlap, contact time and rebound of a normal impact without gravity.

    Nothing of it shows what friction does to bodies that meet aslant or spin; without any friction they would seem right.

    The closed form (Johnson 1985, Contact Mechanics, section 11.4, https://doi.org/10.1017/CBO9781139171731) is that of elastic
    impacts: ``d_max = (15 m* v^2 / (16 E* sqrt(R*)))^(2/5)``, ``F_max = 4/3 E* sqrt(R*) d_max^(3/2)``,
    ``t_c = 4/5 sqrt(pi) Gamma(2/5) / Gamma(9/10) d_max / v``. For others only the rebound is compared, which is the restitution.
    Scenes with other normal laws, or with cohesion, have none: adhesion changes the peak and takes from the rebound.
    """

    def measure(self, world: World, check: Callable[[], None]) -> Sample:
        """Run a world until the bodies part, and for the scene's duration at least: step by step, and again to time it.

        Raises:
            SceneError: if there are more bodies than an impact has, or no contact happens.
        """
        least = round(world.scene.duration / world.time_step)
        rows = [(*_approach(world), world.time)]
        while len(rows) <= least or (rows[-1][0] < 0.0 and len(rows) <= _LONGEST * least):
            check()
            world.step(1)
            rows.append((*_approach(world), world.time))
        doubts, steps = world.observe().health.doubts, len(rows) - 1
        world.reset()
        spent = _time_steps(world, steps)
        gap, speed, moments = np.array(rows).T
        mass = _bodies(world)[1]
        return Sample(np.zeros(1), _features(gap, speed, moments, mass), spent, steps, world.time_step, doubts)

    def exact(self, scene: Scene) -> Sample | None:
        """The closed form; None where the scene's laws are not Hertz's.

        Raises:
            SceneError: if it does not hold for what the scene does.
        """
        closed = scene.contact.normal == "hertz" and scene.contact.cohesion == "none"
        if closed and any(scene.gravity):
            raise SceneError(
                "gravity: the closed form of an impact is that without gravity; use [0, 0, 0], or another --quantity"
            )
        world = World(scene)
        radius, mass, young, restitution = _bodies(world)
        speed = _approach(world)[1]
        if closed and not speed > 0.0:
            raise SceneError("fills: the grain must move towards what it hits")
        if _aside(world) > _ASIDE * abs(speed):
            raise SceneError("fills: an impact must be head-on, of grains that do not spin; use another --quantity, as spread")
        if not closed:
            return None
        values = {"rebound": np.array(restitution)}
        if restitution == 1.0:
            overlap = impact_overlap(mass, radius, young, speed)
            values["peak overlap"] = np.array(overlap)
            values["peak force"] = np.array(4.0 / 3.0 * young * np.sqrt(radius) * overlap**1.5)
            values["contact time"] = np.array(0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9) * overlap / speed)
        return Sample(np.zeros(1), values)

    def errors(self, sample: Sample, reference: Sample) -> dict[str, float]:
        """Relative errors of all that the closed form gives."""
        return {name: abs(float(sample.values[name] / expected) - 1.0) for name, expected in reference.values.items()}


def _time_steps(world: World, steps: int) -> float:
    """Run time of a number of steps from time zero [s]: the median of as many runs as fit into a tenth of a second."""
    spent = []
    while len(spent) < 4 or sum(spent) < _TIMED:
        begin = time.perf_counter()
        world.step(steps)
        spent.append(time.perf_counter() - begin)
        world.reset()
    return float(np.median(spent[1:]))  # kernels are compiled and recorded in the first


def _bodies(world: World) -> tuple[float, float, float, float]:
    """Effective radius [m], mass [kg] and modulus [Pa] of the two bodies, and their restitution [1], NaN if laws ask for none."""
    scene, grains = world.scene, world.observe().grains
    planes = [wall for wall in world.assembly.walls if wall.kind == "plane"]
    if len(world.assembly.table.bodies):
        raise SceneError("the closed form of an impact is that of spheres, not of clumps or bodies; choose another --quantity")
    owners = [fill.material for fill, number in zip(scene.fills, world.assembly.fill_numbers, strict=True) for _ in range(number)]
    if len(grains) == 2:
        first, second = owners
        radius, mass = (values.prod() / values.sum() for values in (grains.radius, grains.mass))
    elif len(grains) == 1 and len(planes) == 1:
        first, second = owners[0], planes[0].material
        radius, mass = grains.radius[0], grains.mass[0]
    else:
        raise SceneError("an impact is one grain and one plane, or two grains; choose another --quantity")
    pair = pair_numbers(scene, first, second)
    return float(radius), float(mass), pair.young, pair.given.get("restitution", math.nan)


def _approach(world: World) -> tuple[float, float]:
    """Gap between the two surfaces [m] and the speed at which it closes [m/s]."""
    grains, radius = world.observe().grains, _radii(world)
    if len(grains) == 2:
        apart = grains.position[1] - grains.position[0]
        distance = np.linalg.norm(apart)
        gap, towards = distance - radius.sum(), (grains.velocity[0] - grains.velocity[1]) @ apart / distance
    else:
        plane = next(wall for wall in world.assembly.walls if wall.kind == "plane")
        gap = plane.distance(grains.position)[0] - radius[0]
        towards = -grains.velocity[0] @ plane.direction
    return float(gap), float(towards)


def _aside(world: World) -> float:
    """How fast bodies move past each other, or turn at their rims [m/s]."""
    grains, radius = world.observe().grains, _radii(world)
    if len(grains) == 2:
        line, velocity = grains.position[1] - grains.position[0], grains.velocity[0] - grains.velocity[1]
    else:
        line, velocity = next(wall for wall in world.assembly.walls if wall.kind == "plane").direction, grains.velocity[0]
    across = np.linalg.norm(np.cross(velocity, line / np.linalg.norm(line)))
    return float(max(across, (np.linalg.norm(grains.spin, axis=1) * radius).max()))


def _radii(world: World) -> np.ndarray:
    """Radii as the solver has them, shape (grains,) [m]; in single precision observed ones are too coarse beside an overlap."""
    grains = world.assembly.solver.arrays.grains
    number = grains.active.get()
    order = np.argsort(grains.identity.numpy()[:number])
    return grains.place.numpy()[:number][order, 3] * world.assembly.lattice.quantum


def _features(gap: np.ndarray, speed: np.ndarray, moments: np.ndarray, mass: float) -> dict[str, np.ndarray]:
    """Peak overlap [m], peak force [N], contact time [s] and rebound over impact speed from histories of shape (steps,)."""
    touching = np.flatnonzero(gap < 0.0)
    if not len(touching) or touching[0] == 0 or touching[-1] == len(gap) - 1:
        raise SceneError("duration: must span the whole impact, from before the first touch to after the last")
    # The gap changes almost evenly at both ends of the contact, where the force begins from zero.
    entry, leave = (_zero(gap[k : k + 2], moments[k : k + 2]) for k in (touching[0] - 1, touching[-1]))
    force = -mass * np.gradient(speed, moments)
    return {
        "rebound": np.array(-speed[-1] / speed[0]),
        "peak overlap": np.array(_peak(-gap)),
        "peak force": np.array(_peak(force)),
        "contact time": np.array(leave - entry),
    }


def _zero(gap: np.ndarray, moments: np.ndarray) -> float:
    return float(moments[0] - gap[0] * (moments[1] - moments[0]) / (gap[1] - gap[0]))


def _peak(values: np.ndarray) -> float:
    """Top of the parabola through the largest value and its neighbours."""
    k = int(np.clip(values.argmax(), 1, len(values) - 2))
    before, top, after = values[k - 1 : k + 2]
    bend = before - 2.0 * top + after
    return float(top - (after - before) ** 2 / (8.0 * bend)) if bend < 0.0 else float(top)
