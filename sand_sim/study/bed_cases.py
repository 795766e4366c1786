"""Extremes of many grains: dense beds, size and mass ratios, gravity, crushing."""

import tempfile
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np

from sand_sim.border import ToolPose
from sand_sim.study.bench import GRAIN, Bench, box, close_packing, lattice, run_for
from sand_sim.study.verdict import Case, Check

_RADIUS = 0.005  # [m]
_SHAKE = 1e-3  # [m/s] at 10 MPa, elsewhere the same over the speed of sound
_NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def bed_cases() -> Iterator[Case]:
    """All of them."""
    for restitution in (0.05, 0.2, 0.5, 1.0):
        for overlap in (0.005, 0.05):
            name = f"e = {restitution}, confined bed, overlap {100.0 * overlap:g} % of a radius"
            quick = overlap == 0.05 and restitution != 0.2
            yield Case("restitution", name, partial(confined, restitution=restitution, overlap=overlap), quick)
    for friction in (0.0, 2.0):
        yield Case("friction", f"mu = {friction:g}, confined bed", partial(confined, friction=friction))
        yield Case("friction", f"mu = {friction:g}, bed at rest", partial(bed, friction=friction), quick=False)
    for young in (1e5, 7e10):
        yield Case("stiffness", f"E = {young:.0e} Pa, confined bed", partial(confined, young=young))
        yield Case("stiffness", f"E = {young:.0e} Pa, bed at rest", partial(bed, young=young, layers=2), quick=young < 1e6)
    for name, gravity in (("lunar", 1.62), ("100 g", 981.0)):
        yield Case("gravity", f"{name}, bed at rest", partial(bed, gravity=gravity), quick=gravity > 100)
    yield Case("gravity", "zero, elastic gas", gas)
    for ratio in (5, 20):
        yield Case("size ratio", f"{ratio}, large grain on a bed", partial(large_on_small, ratio=ratio), quick=ratio == 5)
    for ratio in (1e3, 1e6):
        yield Case("mass ratio", f"{ratio:.0e}, heavy grains among light ones", partial(mixed, ratio=ratio), quick=ratio == 1e6)
    for strain in (0.01, 0.3):
        name = f"512 grains between plates, compressed by {100.0 * strain:g} %"
        yield Case("crushing", name, partial(crush, strain=strain), quick=strain > 0.1)
    yield Case("crushing", "512 grains between plates, e = 0.05", partial(crush, strain=0.1, restitution=0.05), quick=False)


def confined_scene(bench: Bench, young: float, restitution: float, friction: float, overlap: float) -> dict:
    """Close-packed grains under pressure in a box of the same material, at rest but for a slight shake.

    Args:
        bench: makes it.
        young: modulus [Pa].
        restitution: of all contacts [1].
        friction: of all contacts [1].
        overlap: about that of each pair over the radius [1].
    """
    points, sides = _relaxed(overlap)
    return bench.scene(
        points,
        _RADIUS,
        np.random.default_rng(1).normal(0.0, _SHAKE * np.sqrt(young / 1e7), points.shape),
        grain={"young": young},
        wall={"young": young},
        restitution=restitution,
        friction=friction,
        boundaries=[box(*sides)],
    )


@cache
def _relaxed(overlap: float) -> tuple[np.ndarray, tuple]:
    """Positions of such a packing in equilibrium, which does not depend on stiffness, and the corners of its box [m]."""
    points = close_packing(3, (2.0 - overlap) * _RADIUS)
    inset = (1.0 - 1.6 * overlap) * _RADIUS  # about what a flat wall needs to hold four neighbours
    sides = points.min(axis=0) - inset, points.max(axis=0) + inset
    with tempfile.TemporaryDirectory() as folder:
        world = Bench(Path(folder)).make(
            points, _RADIUS, wall={"young": GRAIN["young"]}, restitution=0.3, friction=0.0, boundaries=[box(*sides)]
        )
        world.step(20_000)
        return world.observe().grains.position, sides


def confined(
    bench: Bench, young: float = 1e7, restitution: float = 0.5, friction: float = 0.5, overlap: float = 0.05
) -> Iterator[Check]:
    """A confined bed in equilibrium, slightly shaken: it must come to rest, or without damping gain no energy."""
    world = bench.open(confined_scene(bench, young, restitution, friction, overlap))
    before = world.observe().health
    world.step(3000)
    after = world.observe().health
    if restitution < 1.0:
        yield Check("kinetic energy / that at the start", after.kinetic / before.kinetic, 0.0, 0.1, "damping")
    stored = before.elastic + before.kinetic
    yield Check("energy gained / that stored", after.gained / stored, 0.0, 0.005, "conservation")


def bed(bench: Bench, young: float = 1e7, friction: float = 0.5, gravity: float = 9.81, layers: int = 6) -> Iterator[Check]:
    """Grains fall a little and come to rest in a box: the floor carries their weight."""
    points = lattice((5, 5, layers), 2.02 * _RADIUS, (1.05 * _RADIUS,) * 3)
    points[:, :2] += np.random.default_rng(2).uniform(-0.01, 0.01, (len(points), 2)) * _RADIUS  # they do not overlap
    side = 5 * 2.02 * _RADIUS + 0.1 * _RADIUS
    world = bench.make(
        points,
        _RADIUS,
        gravity=[0.0, 0.0, -gravity],
        grain={"young": young},
        wall={"young": young},
        friction=friction,
        restitution=0.3,
        boundaries=[box([0, 0, 0], [side, side, 2.5 * layers * _RADIUS])],
    )
    run_for(world, (20.0 if friction else 60.0) * np.sqrt(_RADIUS / gravity))  # without friction they keep finding better places
    yield from _rests(world, gravity)


def large_on_small(bench: Bench, ratio: float) -> Iterator[Check]:
    """A large grain lies on a bed of small ones in a box."""
    large = _RADIUS
    small = large / ratio
    number = int(2.1 * large / (2.02 * small))
    points = lattice((number, number, 2), 2.02 * small, (1.02 * small,) * 3)
    side = number * 2.02 * small + 0.04 * small
    middle = [0.5 * side, 0.5 * side, points[:, 2].max() + 1.02 * small + large]
    world = bench.make(
        np.vstack([points, middle]),
        np.append(np.full(len(points), small), large),
        gravity=[0.0, 0.0, -9.81],
        restitution=0.3,
        boundaries=[box([0, 0, 0], [side, side, middle[2] + 2.0 * large])],
        solver={"threads": None},
    )
    run_for(world, 0.3)
    yield from _rests(world, 9.81, loose=0.03)


def mixed(bench: Bench, ratio: float) -> Iterator[Check]:
    """Heavy and light grains of one size in turn, elastic against each other in a box, keep their energy."""
    points = lattice((4, 4, 4), 2.6 * _RADIUS, (1.3 * _RADIUS,) * 3)
    heavy = np.indices((4, 4, 4)).sum(axis=0).ravel() % 2 == 0
    random = np.random.default_rng(3)
    # Equal kinetic energies: heavy grains are slow.
    speeds = np.where(heavy, 1.0 / np.sqrt(ratio), 1.0)[:, None] * random.normal(0.0, 0.3, points.shape)
    light = points[~heavy]
    np.savez(bench.folder / "light.npz", position=light, radius=np.full(len(light), _RADIUS), velocity=speeds[~heavy])
    density, side = GRAIN["density"], 4 * 2.6 * _RADIUS
    names = ("grain", "light", "wall")
    material = GRAIN | {"young": 1e9}
    world = bench.make(
        points[heavy],
        _RADIUS,
        speeds[heavy],
        materials={"grain": material | {"density": ratio * density}, "light": material, "wall": material},
        pairs=[{"between": [a, b], "restitution": 1.0, "friction": 0.0} for k, a in enumerate(names[:2]) for b in names[k:]],
        fills=[{"material": "grain", "file": "grains.npz"}, {"material": "light", "file": "light.npz"}],
        boundaries=[box([0, 0, 0], [side] * 3)],
    )
    before = world.observe().health
    run_for(world, 0.05)
    after = world.observe().health
    total = (after.kinetic + after.elastic) / (before.kinetic + before.elastic)
    yield Check("energy / that at the start", total, 1.0, 0.002, "conservation")


def gas(bench: Bench) -> Iterator[Check]:
    """Elastic grains without friction and gravity in a box keep their energy."""
    points = lattice((4, 4, 4), 2.4 * _RADIUS, (1.2 * _RADIUS,) * 3)
    velocity = np.random.default_rng(4).normal(0.0, 0.5, points.shape)
    side = 4 * 2.4 * _RADIUS
    world = bench.make(
        points, _RADIUS, velocity, grain={"young": 1e8}, restitution=1.0, friction=0.0, boundaries=[box([0, 0, 0], [side] * 3)]
    )
    before = world.observe().health
    run_for(world, 0.1)
    after = world.observe().health
    total = (after.kinetic + after.elastic) / before.kinetic
    yield Check("energy / that at the start", total, 1.0, 0.002, "conservation")


def crush(bench: Bench, strain: float, restitution: float = 0.5) -> Iterator[Check]:
    """Grains between the floor of a box and a plate that comes down; without friction both carry the same."""
    points = lattice((8, 8, 8), 2.0 * _RADIUS, (_RADIUS,) * 3)
    points[:, :2] += np.random.default_rng(5).uniform(-0.01, 0.01, (len(points), 2)) * _RADIUS
    side, particle, height = 16.0 * _RADIUS, 0.8 * _RADIUS, 16.0 * _RADIUS
    start = height + particle
    world = bench.make(
        points,
        _RADIUS,
        grain={"young": 1e8},
        wall={"young": 1e9},
        friction=0.0,
        restitution=restitution,
        boundaries=[box([0, 0, 0], [side, side, 3 * side], open=["top"])],
        tools=bench.plate(
            [-0.49 * side, -0.49 * side, 0.0], [0.49 * side, 0.49 * side, 0.02], particle, 0.5, [0.5 * side, 0.5 * side, start]
        ),
        solver={"threads": None},
    )
    way = strain * height
    world.apply(ToolPose("plate", np.array([0.5 * side, 0.5 * side, start - way]), _NO_TURN, way / 0.5))
    for _ in range(10):
        run_for(world, way / 5.0)
        bench.check()
    run_for(world, 0.05 if restitution > 0.1 else 0.5)  # strong dashpots let grains creep apart slowly, for 0.4 s
    world.observe()
    run_for(world, 0.001)
    seen = world.observe()
    upward, downward = seen.tool("plate").world_force[2], -seen.wall("box/bottom").force[2]
    yield Check("force on the floor / on the plate", downward / max(upward, 1e-9), 1.0, 0.02, "equilibrium")
    yield Check("energy gained / work of the plate", seen.health.gained / seen.health.tool_work, 0.0, 0.01, "conservation")


def _rests(world, gravity: float, loose: float = 0.01) -> Iterator[Check]:
    """The floor carries the weight, and next to nothing moves."""
    forces = []
    for _ in range(20):
        world.step(11)
        forces.append(-world.observe().wall("box/bottom").force[2])
    seen = world.observe()
    sides = sum(seen.wall(f"box/{side}").force[2] for side in ("left", "right", "front", "back"))
    weight = float(seen.grains.mass.sum()) * gravity
    smallest = float(seen.grains.radius.min())
    yield Check("force on floor and sides / weight", (float(np.mean(forces)) - sides) / weight, 1.0, loose, "equilibrium")
    speed = float(np.sqrt(np.mean(seen.grains.speed**2)))
    yield Check("speed / sqrt(g r)", speed / np.sqrt(gravity * smallest), 0.0, 2.0 * loose, "rest")
    yield Check("energy gained / kinetic of a fall by r", seen.health.gained / (weight * smallest), 0.0, 0.01, "conservation")
