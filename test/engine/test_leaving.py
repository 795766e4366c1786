"""Grains and bodies that leave the domain take along the energy that they have then, no more and no less."""

import math

import pytest

from sand_sim.integrator import INTEGRATORS

GRAVITY, DEEP, RADIUS, MASS = 9.81, 0.1, 0.02, 2.0
DOMAIN = {"low": [-DEEP] * 3, "high": [DEEP] * 3}
STEP = 1e-3  # long, so that what is lost in a step shows
FLYING = {"velocity": [0.3, 0.2, 0.0], "spin": [0.0, 4.0, 1.0]}
CLUMP = {"spheres": [[-0.005, 0.0, 0.0, RADIUS], [0.005, 0.0, 0.0, RADIUS]], "mass": MASS, "inertia": [4e-4] * 3}


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("kind", ["grain", "clump", "pushed"])
def test_nothing_is_lost_or_gained_where_something_leaves(make_world, make_bodies, kind, integrator):
    """All is exact, falling or pushed as hard about the middle, but that Euler loses ``m g^2 dt^2 / 2`` a step in falling."""
    solver = {"time_step": STEP, "force_time_step": True, "integrator": integrator}
    if kind == "grain":
        world = make_world([[0.0] * 3], RADIUS, **FLYING, **solver, gravity=[0.0, 0.0, -GRAVITY], domain=DOMAIN)
    else:
        gravity = [0.0, 0.0, -GRAVITY if kind == "clump" else 0.0]
        world = make_bodies({"ball": CLUMP | FLYING}, solver=solver, gravity=gravity, domain=DOMAIN)
        if kind == "pushed":
            world.push_body("ball", [0.0, 0.0, -MASS * GRAVITY], [0.0, 1e-3, 0.0])
    world.step(100)
    before = world.observe().health
    assert before.retired == 0
    world.step(100)
    after = world.observe().health
    assert after.retired == 1
    assert (after.kinetic, after.potential) == (0.0, 0.0)
    lost = 0.0
    if integrator == "symplectic_euler" and kind != "pushed":
        falling = math.ceil(math.sqrt(0.25 + 2.0 * DEEP / (GRAVITY * STEP**2)) - 0.5)  # steps: n (n + 1) g dt^2 / 2 > depth
        mass = MASS if kind == "clump" else 2500.0 * 4.0 / 3.0 * math.pi * RADIUS**3
        lost = (falling - 100) * 0.5 * mass * (GRAVITY * STEP) ** 2
    assert after.dissipated - before.dissipated == pytest.approx(lost, abs=1e-6 * (before.kinetic + abs(before.potential)))
