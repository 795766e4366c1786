"""What a grain feels is the sum over its contacts, however many they are."""

from itertools import combinations, product

import numpy as np
import pytest

YOUNG, POISSON, DENSITY, RADIUS = 1e7, 0.3, 2650.0, 0.005
SIDES = [np.array(side) for side in product((-1, 0, 1), repeat=3) if np.abs(side).sum() == 2]  # of the densest packing


def force_between(a, b):
    """Hertz's force on a [N], of spheres at rest."""
    apart = a - b
    distance = np.linalg.norm(apart)
    overlap = max(2.0 * RADIUS - distance, 0.0)
    stiffness = YOUNG / (2.0 * (1.0 - POISSON**2))
    return 4.0 / 3.0 * stiffness * np.sqrt(0.5 * RADIUS) * overlap**1.5 * apart / distance


@pytest.mark.parametrize("rotation", [True, False])
def test_any_number_of_contacts(make_world, rotation):
    """From none to twelve, owned by the grain in the middle, by the others, or some of each."""
    random = np.random.default_rng(3)
    clusters = []
    for number in range(len(SIDES) + 1):
        for _ in range(6):
            chosen = random.permutation(len(SIDES))[:number]
            reach = 2.0 * RADIUS * random.uniform(0.97, 0.995, number) / np.sqrt(2.0)
            clusters.append(np.vstack([np.zeros(3), *(length * SIDES[side] for side, length in zip(chosen, reach, strict=True))]))
    position = np.vstack([cluster + [0.04 * (k % 9), 0.04 * (k // 9), 0.0] for k, cluster in enumerate(clusters)])
    world = make_world(
        position,
        RADIUS,
        material={"density": DENSITY, "young": YOUNG, "poisson": POISSON},
        friction=0.5 if rotation else 0.0,
        domain={"low": [-0.1, -0.1, -0.1], "high": [0.5, 0.5, 0.1]},
        integrator="symplectic_euler",
        precision="double",
    )
    world.step(1)
    mass = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
    expected, first = np.zeros_like(position), 0
    for cluster in clusters:
        for i, j in combinations(range(len(cluster)), 2):
            force = force_between(position[first + i], position[first + j])
            expected[first + i] += force
            expected[first + j] -= force
        first += len(cluster)
    felt = world.observe().grains.velocity * mass / world.time_step
    np.testing.assert_allclose(felt, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())
