"""Extremes of one or two grains: stiffness, speed, size, mass, restitution, gravity, place."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from sand_sim.study.bench import GRAIN, WALL, Bench, plane, run_for
from sand_sim.study.closed_forms import impact_overlap, impact_time, plane_modulus, sphere_mass, static_overlap
from sand_sim.study.verdict import Case, Check

RESTITUTION_TOLERANCE = 0.02  # allowed difference at the automatic step
_PEAK = 0.02  # share of the closed form


def impact_cases() -> Iterator[Case]:
    """All of them."""
    for young in (1e5, 1e6, 1e7, 1e8, 1e9, 7e10):
        yield Case("stiffness", f"E = {young:.0e} Pa, impact at 0.1 m/s", partial(hit_plane, young=young, speed=0.1))
    for young in (1e5, 7e10):
        yield Case("stiffness", f"E = {young:.0e} Pa, impact at 1 m/s", partial(hit_plane, young=young, speed=1.0))
        yield Case("stiffness", f"E = {young:.0e} Pa, at rest", partial(rest_on_plane, young=young))
    for young in (1e7, 1e9, 7e10):
        yield Case("speed", f"impact at 100 m/s, E = {young:.0e} Pa", partial(hit_plane, young=young, speed=100.0))
    yield Case("speed", "two grains meet at 100 m/s each, E = 7e+10 Pa", partial(hit_grain, young=7e10, speed=200.0))
    yield Case("speed", "falls 5 m on to a floor", fall_far)
    yield Case("speed", "light grain between two heavy ones", shoot_off)
    for restitution in (0.05, 1.0):
        hit = partial(hit_plane, young=1e8, speed=1.0, restitution=restitution)
        yield Case("restitution", f"e = {restitution}, impact on a plane", hit)
        hit = partial(hit_grain, young=1e8, speed=1.0, restitution=restitution)
        yield Case("restitution", f"e = {restitution}, impact on a grain", hit)
    for radius in (10e-6, 0.5):
        name = "10 um" if radius < 1e-3 else "0.5 m"
        yield Case("size", f"grain of {name}, impact at 0.1 m/s", partial(hit_plane, radius=radius, young=1e9, speed=0.1))
        yield Case("size", f"grain of {name}, at rest", partial(rest_on_plane, radius=radius, young=1e9))
        for precision in ("single", "double"):
            wide = partial(rest_on_plane, radius=radius, young=7e10, domain=max(0.5, 5.0 * radius), precision=precision)
            yield Case("size", f"grain of {name}, E = 7e+10 Pa, in a wide domain, {precision}", wide)
    for ratio in (2, 5, 10, 20):
        hit = partial(hit_grain, young=1e8, speed=1.0, restitution=0.7, size_ratio=ratio)
        yield Case("size ratio", f"{ratio}, impact", hit, quick=ratio in (2, 20))
    for ratio in (1e2, 1e4, 1e6):
        hit = partial(hit_grain, young=1e8, speed=1.0, restitution=0.7, mass_ratio=ratio)
        yield Case("mass ratio", f"{ratio:.0e}, impact", hit, quick=ratio == 1e6)
        yield Case("mass ratio", f"{ratio:.0e}, heavy rests on light", partial(stack, mass_ratio=ratio), quick=ratio == 1e6)
    for name, gravity in (("zero", 0.0), ("lunar", 1.62), ("100 g", 981.0)):
        yield Case("gravity", f"{name}, falls and bounces", partial(bounce, gravity=gravity))
    for precision in ("single", "double"):
        yield Case("place", f"10 km from the origin, {precision}", partial(far_away, precision=precision))


def hit_plane(
    bench: Bench,
    young: float,
    speed: float,
    radius: float = 0.005,
    restitution: float = 1.0,
    solver: dict | None = None,
) -> Iterator[Check]:
    """A grain hits a rigid plane head-on."""
    gap = 0.02 * radius
    world = bench.make(
        [0.0, 0.0, radius + gap],
        radius,
        [0.0, 0.0, -speed],
        grain={"young": young},
        restitution=restitution,
        boundaries=[plane()],
        solver=solver or {},
    )
    mass, modulus = sphere_mass(radius, GRAIN["density"]), plane_modulus(young, GRAIN["poisson"])
    peak = impact_overlap(mass, radius, modulus, speed)
    # Strong damping prolongs the contact several times.
    run_for(world, 1.5 * gap / speed + (1.5 + 4.0 * (restitution < 0.5)) * impact_time(peak, speed))
    after = world.observe()
    yield Check("grains left", len(after.grains), 1, 0.0, "nothing is lost")
    if not len(after.grains):
        return
    yield Check("restitution", after.grains.velocity[0, 2] / speed, restitution, RESTITUTION_TOLERANCE, "asked")
    if restitution == 1.0:
        yield Check("largest overlap / m", after.health.deepest * radius, peak, _PEAK * peak, "Hertz")
    yield Check("sideways speed / m/s", float(np.linalg.norm(after.grains.velocity[0, :2])), 0.0, 1e-6 * speed, "symmetry")


def hit_grain(
    bench: Bench,
    young: float,
    speed: float,
    restitution: float = 1.0,
    size_ratio: float = 1.0,
    mass_ratio: float | None = None,
) -> Iterator[Check]:
    """Two grains meet head-on; the second is larger, or of another density."""
    small, large = 0.005, 0.005 * size_ratio
    masses = sphere_mass([small, large], GRAIN["density"])
    further = {}
    if mass_ratio is not None:
        masses[1] *= mass_ratio
        start = [large + 1.05 * small, 0.0, 0.0]
        further = _second_material(bench, start, small, [-speed, 0.0, 0.0], mass_ratio, young, restitution)
        scene = bench.scene([0.0, 0.0, 0.0], large, **further)
    else:
        positions = [[large + 1.05 * small, 0.0, 0.0], [0.0, 0.0, 0.0]]
        velocities = [[-speed, 0.0, 0.0], [0.0, 0.0, 0.0]]
        scene = bench.scene(positions, [small, large], velocities, grain={"young": young}, restitution=restitution)
    world = bench.open(scene)
    reduced, effective = masses[0] * masses[1] / masses.sum(), small * large / (small + large)
    modulus = 0.5 * plane_modulus(young, GRAIN["poisson"])
    peak = impact_overlap(reduced, effective, modulus, speed)
    run_for(world, 0.075 * small / speed + (1.5 + 4.0 * (restitution < 0.5)) * impact_time(peak, speed))
    after = world.observe()
    velocity = after.grains.velocity[:, 0]
    light, heavy = np.argsort(after.grains.mass) if len(set(after.grains.mass)) > 1 else (0, 1)
    masses = after.grains.mass.astype(float)
    momentum = masses[[light, heavy]] @ velocity[[light, heavy]]
    yield Check("restitution", (velocity[light] - velocity[heavy]) / speed, restitution, RESTITUTION_TOLERANCE, "asked")
    yield Check("momentum / that before", momentum / (-masses[light] * speed), 1.0, 1e-6, "conservation")
    if restitution == 1.0:
        yield Check("largest overlap / m", after.health.deepest * small, peak, _PEAK * peak, "Hertz")


def shoot_off(bench: Bench) -> Iterator[Check]:
    """A heavy grain drives a light one against another heavy one; the light one rattles between them."""
    ratio, speed, radius, young = 1e4, 1.0, 0.005, 7e10
    further = _second_material(bench, [0.0, 0.0, 0.0], radius, [0.0, 0.0, 0.0], ratio, young, 1.0)
    world = bench.open(
        bench.scene([[-2.02 * radius, 0.0, 0.0], [2.5 * radius, 0.0, 0.0]], radius, [[speed, 0, 0], [0, 0, 0]], **further)
    )
    before = world.observe()
    run_for(world, 0.01)
    after = world.observe()
    momentum, energy = (
        [float(o.grains.mass.astype(float) @ f(o.grains.velocity[:, 0].astype(float))) for o in (before, after)]
        for f in (lambda v: v, np.square)
    )
    yield Check("momentum / that before", momentum[1] / momentum[0], 1.0, 1e-6, "conservation")
    total = 2.0 * (after.health.elastic + after.health.kinetic)
    yield Check("energy / that before", total / energy[0], 1.0, 0.01, "conservation")


def rest_on_plane(
    bench: Bench, young: float, radius: float = 0.005, domain: float | None = None, precision: str = "double"
) -> Iterator[Check]:
    """A grain lies on a rigid plane, put there with the overlap of its weight."""
    gravity, mass, modulus = 9.81, sphere_mass(radius, GRAIN["density"]), plane_modulus(young, GRAIN["poisson"])
    overlap = static_overlap(mass * gravity, radius, modulus)
    further = {"domain": {"low": [-domain] * 3, "high": [domain] * 3}} if domain else {}
    world = bench.make(
        [0.0, 0.0, radius - 0.9 * overlap],
        radius,
        gravity=[0.0, 0.0, -gravity],
        grain={"young": young},
        restitution=0.2,
        boundaries=[plane()],
        solver={"precision": precision},
        **further,
    )
    run_for(world, 30.0 * np.sqrt(overlap / gravity))
    forces, heights = [], []
    for _ in range(20):
        world.step(7)
        seen = world.observe()
        forces.append(-seen.walls[0].force[2])
        heights.append(radius - seen.grains.position[0, 2])
    yield Check("force on the floor / weight", float(np.max(forces)) / (mass * gravity), 1.0, 0.01, "equilibrium")
    yield Check("overlap / m", float(np.mean(heights)), overlap, 0.01 * overlap, "Hertz")


def stack(bench: Bench, mass_ratio: float) -> Iterator[Check]:
    """A heavy grain rests on a light one on a floor; put there with the overlaps of its weight."""
    radius, young, gravity, density = 0.005, 7e10, 9.81, GRAIN["density"]
    light = sphere_mass(radius, density)
    below = static_overlap((1.0 + mass_ratio) * light * gravity, radius, plane_modulus(young, 0.25))
    between = static_overlap(mass_ratio * light * gravity, 0.5 * radius, 0.5 * plane_modulus(young, 0.25))
    height = radius - below
    top = [0.0, 0.0, height + 2.0 * radius - between]
    further = _second_material(bench, top, radius, [0.0] * 3, 1.0, young, 0.05, mass_ratio)
    world = bench.open(bench.scene([0.0, 0.0, height], radius, gravity=[0.0, 0.0, -gravity], boundaries=[plane()], **further))
    forces = []
    for _ in range(100):
        world.step(200)
        forces.append(-world.observe().walls[0].force[2])
    weight = (1.0 + mass_ratio) * light * gravity
    yield Check("force on the floor / weight", float(np.mean(forces)) / weight, 1.0, 0.01, "equilibrium")
    yield Check("scatter of the force / weight", float(np.std(forces)) / weight, 0.0, 0.01, "equilibrium")


def fall_far(bench: Bench) -> Iterator[Check]:
    """A grain falls 5 m and bounces."""
    height, radius, gravity, restitution = 5.0, 0.005, 9.81, 0.8
    world = bench.make(
        [0.0, 0.0, radius + height],
        radius,
        gravity=[0, 0, -gravity],
        restitution=restitution,
        boundaries=[plane()],
        grain={"young": 1e9},
    )
    fall = np.sqrt(2.0 * height / gravity)
    run_for(world, 1.5 * fall)
    # Half the fall time after the impact.
    peak = restitution * gravity * fall
    expected = peak * 0.5 * fall - 0.5 * gravity * (0.5 * fall) ** 2
    after = world.observe()
    yield Check("grains left", len(after.grains), 1, 0.0, "nothing is lost")
    if len(after.grains):
        found = float(after.grains.position[0, 2]) - radius
        yield Check("height after the bounce / m", found, expected, 0.02 * height, "free fall")


def bounce(bench: Bench, gravity: float) -> Iterator[Check]:
    """A grain moves towards a floor under gravity, or without it evenly."""
    radius, height, speed, restitution = 0.005, 0.01, 0.2, 0.8
    world = bench.make(
        [0.0, 0.0, radius + height],
        radius,
        [0.0, 0.0, -speed if not gravity else 0.0],
        gravity=[0.0, 0.0, -gravity],
        restitution=restitution,
        boundaries=[plane()],
        grain={"young": 1e9},
    )
    arrival = height / speed if not gravity else np.sqrt(2.0 * height / gravity)
    rebound = restitution * (speed if not gravity else gravity * arrival)
    run_for(world, 1.5 * arrival)
    flight = world.time - arrival
    after = world.observe()
    expected = rebound * flight - 0.5 * gravity * flight**2
    yield Check("height after the bounce / m", float(after.grains.position[0, 2]) - radius, expected, 0.02 * height, "free fall")


def far_away(bench: Bench, precision: str) -> Iterator[Check]:
    """The same oblique impact on a grain and a floor at the origin and 10 km from it."""
    seen = []
    for offset in (0.0, 10e3):
        at = np.array([offset, -offset, offset])
        world = bench.make(
            at + np.array([[0.0, 0.0, 0.0049], [0.001, 0.0, 0.0155]]),
            0.005,
            [[0, 0, 0], [0, 0, -1.0]],
            gravity=[0, 0, -9.81],
            boundaries=[plane(offset)],
            solver={"precision": precision, "time_step": 1e-5},
            domain={"low": (at - 0.1).tolist(), "high": (at + 0.1).tolist()},
        )
        run_for(world, 0.02)
        grains = world.observe().grains
        seen.append((grains.position - at, grains.velocity))
    # A position 10 km from the origin is itself only known to 2e-12 m.
    yield Check("difference of positions / m", float(np.abs(seen[1][0] - seen[0][0]).max()), 0.0, 1e-8, "same scene")
    yield Check("difference of velocities / m/s", float(np.abs(seen[1][1] - seen[0][1]).max()), 0.0, 1e-5, "same scene")


def _second_material(bench, position, radius, velocity, ratio, young, restitution, own_ratio=None) -> dict:
    """Sections of a scene with two materials of one stiffness: ``grain``, ``ratio`` times as dense, and ``light`` at a place."""
    np.savez(bench.folder / "light.npz", position=[position], radius=[radius], velocity=[velocity])
    density = GRAIN["density"]
    return {
        "materials": {
            "grain": GRAIN | {"young": young, "density": ratio * density},
            "light": GRAIN | {"young": young, "density": (own_ratio or 1.0) * density},
            "wall": WALL,
        },
        "pairs": [
            {"between": [a, b], "restitution": restitution, "friction": 0.5}
            for a, b in (("grain", "grain"), ("grain", "light"), ("light", "light"), ("grain", "wall"), ("light", "wall"))
        ],
        "fills": [{"material": "grain", "file": "grains.npz"}, {"material": "light", "file": "light.npz"}],
    }
