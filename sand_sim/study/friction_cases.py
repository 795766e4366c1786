"""Extremes of friction: none, much, on a slope, at an angle, with a great spin."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from sand_sim.study.bench import GRAIN, Bench, plane, run_for
from sand_sim.study.closed_forms import plane_modulus, sphere_mass, static_overlap
from sand_sim.study.contact_cases import RESTITUTION_TOLERANCE
from sand_sim.study.verdict import Case, Check


def friction_cases() -> Iterator[Case]:
    """All of them."""
    for friction in (0.0, 2.0):
        yield Case("friction", f"mu = {friction:g}, oblique impact", partial(hit_obliquely, friction=friction))
        yield Case("friction", f"mu = {friction:g}, on a slope", partial(roll_down, friction=friction))
    yield Case("friction", "grain that spins at 10,000 rad/s lands on a floor", spin_down)


def hit_obliquely(bench: Bench, friction: float) -> Iterator[Check]:
    """A grain hits a rigid plane at 45 degrees: slides without friction; with much it must keep its angular momentum."""
    radius, speed = 0.005, 1.0
    world = bench.make(
        [0.0, 0.0, 1.02 * radius],
        radius,
        [speed, 0.0, -speed],
        friction=friction,
        restitution=0.8,
        boundaries=[plane()],
        grain={"young": 1e9},
    )
    run_for(world, 0.05 * radius / speed)
    grains, health = world.observe().grains, world.observe().health
    velocity, spin = grains.velocity[0], grains.spin[0]
    yield Check("restitution", velocity[2] / speed, 0.8, RESTITUTION_TOLERANCE, "asked")
    # About the contact point: force acts there, so only gravity could change it; the arm is shorter by half the overlap.
    around = velocity[0] + 0.4 * radius * spin[1]
    yield Check("angular momentum about the contact / that before", around / speed, 1.0, 0.01, "conservation")
    if friction == 0.0:
        yield Check("sliding speed / m/s", velocity[0], speed, 1e-9, "no friction")
    else:
        yield Check("kinetic energy gained / J", max(-health.dissipated, 0.0), 0.0, 0.01 * health.kinetic, "no source")
        bound = friction * 1.8
        yield Check("tangential impulse within Coulomb's bound", float(speed - velocity[0] <= bound * speed), 1.0, 0.0, "Coulomb")


def roll_down(bench: Bench, friction: float) -> Iterator[Check]:
    """A grain on a slope of 30 degrees slides without friction and rolls with much: ``a = g sin`` or ``5/7 g sin``."""
    radius, gravity, angle = 0.005, 9.81, np.radians(30.0)
    mass, modulus = sphere_mass(radius, GRAIN["density"]), plane_modulus(1e8, GRAIN["poisson"])
    overlap = static_overlap(mass * gravity * np.cos(angle), radius, modulus)
    down = [gravity * np.sin(angle), 0.0, -gravity * np.cos(angle)]
    world = bench.make(
        [0.0, 0.0, radius - overlap],
        radius,
        gravity=down,
        friction=friction,
        restitution=0.2,
        boundaries=[plane()],
        grain={"young": 1e8},
        domain={"low": [-0.1] * 3, "high": [0.5, 0.1, 0.1]},
    )
    run_for(world, 0.2)
    share = 1.0 if friction == 0.0 else 5.0 / 7.0
    expected = share * gravity * np.sin(angle) * world.time
    yield Check("speed down the slope / m/s", world.observe().grains.velocity[0, 0], expected, 0.01 * expected, "rigid rolling")


def spin_down(bench: Bench) -> Iterator[Check]:
    """A spinning grain lands on a floor: its angular momentum about the contact stays, its energy does not grow."""
    radius, spin, fall = 0.005, 1e4, 0.5
    world = bench.make(
        [0.0, 0.0, 1.01 * radius], radius, [0.0, 0.0, -fall], [0.0, spin, 0.0], grain={"young": 1e9}, boundaries=[plane()]
    )
    run_for(world, 0.05 * radius / fall)
    after = world.observe()
    around = after.grains.velocity[0, 0] + 0.4 * radius * after.grains.spin[0, 1]
    yield Check("angular momentum about the contact / that before", around / (0.4 * radius * spin), 1.0, 0.01, "conservation")
    # It slides throughout, so friction gives mu (1 + e) v.
    yield Check("sideways speed / m/s", float(after.grains.velocity[0, 0]), 0.5 * 1.5 * fall, 0.02 * fall, "Coulomb")
