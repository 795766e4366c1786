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
