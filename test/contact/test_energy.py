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
