"""The order of the error in the time step, measured."""

import numpy as np
import pytest
from scenes import floor, record

RADIUS, DENSITY, YOUNG, POISSON, SPEED = 0.005, 2500.0, 1e7, 0.25, 1.0
MATERIAL = {"density": DENSITY, "young": YOUNG, "poisson": POISSON}
STEPS = np.array([25, 50, 100])  # per contact; the first is what the automatic time step takes
PHASES = (0.15, 0.4, 0.65, 0.9)  # of the touch within a step


def orders(errors):
    """Order of the error between each number of steps and twice as many."""
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_elastic_impact_is_second_order(make_world, integrator):
    """Peak overlap by a parabola through the three largest samples, against the exact (15 m* v^2 / (16 E* sqrt(R*)))^0.4."""
    mass = DENSITY * 4 / 3 * np.pi * RADIUS**3 / 2
    effective = YOUNG / (2.0 * (1.0 - POISSON**2))
    exact = (15.0 * mass * (2.0 * SPEED) ** 2 / (16.0 * effective * np.sqrt(RADIUS / 2.0))) ** 0.4
    contact = 2.868 * (mass**2 / (RADIUS / 2.0 * effective**2 * 2.0 * SPEED)) ** 0.2
    errors = []
    for steps in (20, 40, 80):
        world = make_world(
            [[0.0, 0.0, 0.0], [2.0 * RADIUS, 0.0, 0.0]],
            RADIUS,
            velocity=[[SPEED, 0.0, 0.0], [-SPEED, 0.0, 0.0]],
            material=MATERIAL,
            restitution=1.0,
            friction=0.0,
            time_step=contact / steps,
            integrator=integrator,
            threads=1,
        )
        x = record(world, steps)["position"][:, :, 0]
        overlap = 2.0 * RADIUS - (x[:, 1] - x[:, 0])
        k = int(overlap.argmax())
        before, top, after = overlap[k - 1 : k + 2]
        errors.append(abs(top - (after - before) ** 2 / (8.0 * (before - 2.0 * top + after)) - exact) / exact)
    assert np.all(orders(errors) > 1.7), (errors, orders(errors))


def leave(make_world, steps, phase, integrator, slope=0.0, **numbers):
    """Velocity along and away from the floor and spin after an impact at a slope [rad] from the normal."""
    normal_speed = SPEED * np.cos(slope)
    mass, effective = DENSITY * 4 / 3 * np.pi * RADIUS**3, YOUNG / (1.0 - POISSON**2)
    contact = 2.868 * (mass**2 / (RADIUS * effective**2 * normal_speed)) ** 0.2
    dt = contact / steps
    world = make_world(
        [[0.0, 0.0, RADIUS + (1.0 + phase) * normal_speed * dt]],
        RADIUS,
        velocity=[SPEED * np.sin(slope), 0.0, -normal_speed],
        material=MATERIAL,
        boundaries=floor(),
        time_step=dt,
        integrator=integrator,
        threads=1,
        **numbers,
    )
    world.step(3 * steps)
    grains = world.observe().grains
    return np.array([grains.velocity[0, 0], grains.velocity[0, 2], RADIUS * grains.spin[0, 1]])


def mean_errors(make_world, integrator, **case):
    """Mean error over phases at each number of steps, against 32 times as many steps as the fewest."""
    exact = leave(make_world, 32 * STEPS[0], 0.5, "velocity_verlet", **case)
    return [np.mean([np.abs(leave(make_world, n, p, integrator, **case) - exact).max() for p in PHASES]) for n in STEPS]


@pytest.mark.parametrize(("integrator", "order"), [("velocity_verlet", 2.0), ("symplectic_euler", 1.0)])
def test_damped_impact(make_world, integrator, order):
    """Second order where damping sees the velocity of now, first where it sees that of half a step ago."""
    errors = mean_errors(make_world, integrator, restitution=0.5, friction=0.0)
    assert np.all(np.abs(orders(errors) - order) < 0.3), (errors, orders(errors))


@pytest.mark.parametrize("law", ["mindlin", "mindlin_rescaled"])
@pytest.mark.parametrize("slope", [20.0, 45.0], ids=["sticks and slips", "slides"])
def test_impact_with_friction_is_second_order(make_world, slope, law):
    numbers = {"restitution": 0.5, "friction": 0.1, "contact": {"tangential": law}}
    errors = mean_errors(make_world, "velocity_verlet", slope=np.radians(slope), **numbers)
    assert np.all(orders(errors) > 1.5), (errors, orders(errors))
    assert errors[0] < 5e-3 * SPEED


def test_a_spring_that_shrinks_with_its_patch_is_second_order(make_world):
    """Without damping and with much friction it is stretched while the patch shrinks."""
    numbers = {"restitution": 1.0, "friction": 0.3, "contact": {"tangential": "mindlin_rescaled"}}
    errors = mean_errors(make_world, "velocity_verlet", slope=np.radians(27.0), **numbers)
    assert np.all(orders(errors) > 1.5), (errors, orders(errors))
