"""The kernels against an independent NumPy DEM."""

import numpy as np
import pytest
from reference_dem import ReferenceDem
from scenes import floor

from sand_sim.contact.damping import damping_ratio

YOUNG, POISSON, DENSITY, RESTITUTION, FRICTION, DT = 1e6, 0.25, 2500.0, 0.6, 0.4, 2e-5


def fifty_grains():
    """A loose heap of grains of different sizes, falling and spinning into each other and onto the floor."""
    random = np.random.default_rng(3)
    lattice = np.stack(np.meshgrid(range(4), range(4), range(4), indexing="ij"), -1).reshape(-1, 3)[:50]
    radius = random.uniform(0.004, 0.006, 50)
    position = lattice * 0.0112 + random.uniform(-3e-4, 3e-4, (50, 3)) + [0.0, 0.0, 0.0065]
    velocity = random.normal(0.0, 0.3, (50, 3)) - [0.0, 0.0, 0.5]
    return position, radius, velocity, random.normal(0.0, 20.0, (50, 3))


def make_both(make_world, precision):
    position, radius, velocity, spin = fifty_grains()
    material = {"density": DENSITY, "young": YOUNG, "poisson": POISSON}
    world = make_world(
        position,
        radius,
        velocity=velocity,
        spin=spin,
        material=material,
        wall=material,
        restitution=RESTITUTION,
        friction=FRICTION,
        gravity=[0.0, 0.0, -9.81],
        boundaries=floor(),
        precision=precision,
        time_step=DT,
    )
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    effective = YOUNG / (2.0 * (1.0 - POISSON**2)), shear / (2.0 * (2.0 - POISSON))
    planes = [(np.zeros(3), np.array([0.0, 0.0, 1.0]), *effective)]
    ratio = damping_ratio(RESTITUTION, 1.5)
    reference = ReferenceDem(
        position, velocity, spin, radius, DENSITY, *effective, ratio, FRICTION, planes, [0.0, 0.0, -9.81], DT
    )
    return world, reference


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-10), ("single", 1e-3)])
def test_fifty_grains_follow_the_reference(make_world, precision, tolerance):
    world, reference = make_both(make_world, precision)
    start = reference.x.copy()
    for _ in range(10):
        for _ in range(40):
            reference.step()
        world.step(40)
    grains = world.observe().grains
    moved = np.abs(reference.x - start).max()
    assert np.abs(reference.spring).max() > 0.0, "the case has no sliding contacts"
    assert np.abs(grains.position - reference.x).max() < tolerance * moved
    assert np.abs(grains.velocity - reference.v).max() < tolerance * np.abs(reference.v).max()
    assert np.abs(grains.spin - reference.w).max() < tolerance * np.abs(reference.w).max()
