"""Energy stored in the springs of a contact, against stiffness and displacement."""

import numpy as np
import pytest
from scenes import floor

RADIUS, YOUNG, POISSON, DENT, FRICTION = 0.005, 1e7, 0.25, 5e-5, 0.9
MODULUS = YOUNG / (1.0 - POISSON**2)
SHEAR = YOUNG / (2.0 * (1.0 + POISSON)) / (2.0 - POISSON)
PATCH = np.sqrt(RADIUS * DENT)
GIVEN = {"stiffness": 2e3, "shear_stiffness": 1e3, "rolling_friction": 0.3}
ROLLING = 2.25 * 2.0 * MODULUS * PATCH * (0.3 * RADIUS) ** 2
CASES = {  # laws, where their memory begins, what it holds, stiffness
    "mindlin": ({}, 0, [3e-6, -2e-6, 0.0], 8.0 * SHEAR * PATCH),
    "mindlin_rescaled": ({"tangential": "mindlin_rescaled"}, 0, [3e-6, -2e-6, 0.0, PATCH], 8.0 * SHEAR * PATCH),
    "linear": ({"normal": "linear", "tangential": "linear"}, 0, [3e-6, -2e-6, 0.0], 1e3),
    "spring": ({"rolling": "spring"}, 3, [1e-3, -2e-3, 0.0], ROLLING),
    "marshall": ({"twisting": "marshall"}, 3, [2e-3], 4.0 * SHEAR * PATCH**3),
}


@pytest.mark.parametrize("name", CASES)
def test_springs_store_half_their_stiffness_times_displacement_squared(make_world, name):
    """A sphere at rest in its dent in a rigid floor; its spring is stretched by hand, far from where it would yield."""
    contact, begin, held, stiffness = CASES[name]
    world = make_world(
        [[0.0, 0.0, RADIUS - DENT]],
        RADIUS,
        material={"density": 2500.0, "young": YOUNG, "poisson": POISSON},
        friction=FRICTION,
        numbers=GIVEN,
        contact=contact,
        boundaries=floor(),
        threads=1,
    )
    solver = world.assembly.solver
    normal = solver.measure().elastic
    expected = 0.5 * 2e3 * DENT**2 if name == "linear" else 8.0 / 15.0 * MODULUS * PATCH * DENT**2
    assert normal == pytest.approx(expected, rel=1e-6)
    memory = solver.arrays.wall_list.memory.numpy().copy()
    memory[0, begin : begin + len(held)] = held
    solver.arrays.wall_list.memory.assign(memory)
    displacement = np.array(held[:3])
    assert solver.measure().elastic - normal == pytest.approx(0.5 * stiffness * displacement @ displacement, rel=1e-6)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_kinetic_and_elastic_energy_are_of_one_moment(make_world, integrator):
    """An elastic impact at 1/50 of its duration: with energies half a step apart their sum would be off by 6 % on the way."""
    radius, speed, density, young = 0.005, 0.2, 2500.0, 1e7
    mass, stiff = density * 4.0 / 3.0 * np.pi * radius**3, 0.5 * young / (1.0 - 0.25**2)
    duration = 2.868 * ((0.5 * mass) ** 2 / (0.5 * radius * stiff**2 * speed)) ** 0.2
    world = make_world(
        [[0.0, 0.0, 0.0], [2.0 * radius + 1e-6, 0.0, 0.0]],
        radius,
        velocity=[[0.5 * speed, 0.0, 0.0], [-0.5 * speed, 0.0, 0.0]],
        restitution=1.0,
        friction=0.0,
        contact={"tangential": "none"},
        time_step=duration / 50,
        integrator=integrator,
    )
    start, stored = mass * (0.5 * speed) ** 2, []
    for _ in range(60):
        world.step()
        health = world.observe().health
        stored.append(health.elastic)
        assert health.kinetic + health.elastic == pytest.approx(start, rel=5e-3)
    assert max(stored) > 0.95 * start
    assert stored[-1] == 0.0


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_energies_are_those_of_a_flying_spinning_ball(make_world, integrator):
    """``m v^2/2 + (2/5) m r^2 w^2/2``; ``-m g . x`` against the start; of each grain of many, in more than one block of 256."""
    number, radius, time = 300, 0.004, 0.02
    position = np.column_stack([0.01 * np.arange(number), np.zeros(number), np.zeros(number)])
    spin = np.column_stack([np.arange(number), -20.0 * np.ones(number), 0.5 * np.arange(number)])
    velocity = np.column_stack([0.1 * np.ones(number), np.zeros(number), 0.002 * np.arange(number)])
    gravity, domain = np.array([1.0, 0.0, -9.81]), {"low": [-1.0] * 3, "high": [5.0] * 3}
    further = {"velocity": velocity, "spin": spin, "gravity": gravity.tolist(), "domain": domain, "integrator": integrator}
    world = make_world(position, radius, **further)
    mass = 2500.0 * 4.0 / 3.0 * np.pi * radius**3
    turning = 0.5 * 0.4 * mass * radius**2 * np.sum(spin**2)
    health = world.observe().health
    assert health.kinetic == pytest.approx(0.5 * mass * np.sum(velocity**2) + turning, rel=1e-9)
    assert health.potential == 0.0
    assert turning > 0.2 * health.kinetic
    assert health.fastest == pytest.approx(np.linalg.norm(velocity, axis=1).max(), rel=1e-9)
    world.step(round(time / world.time_step))
    after = world.observe().health
    later = velocity + gravity * world.time
    assert after.kinetic == pytest.approx(0.5 * mass * np.sum(later**2) + turning, rel=1e-6)
    fallen = velocity * world.time + 0.5 * gravity * world.time**2
    assert after.potential == pytest.approx(-mass * np.sum(fallen @ gravity), rel=2e-3)
    assert after.fastest == pytest.approx(np.linalg.norm(later, axis=1).max(), rel=1e-6)
