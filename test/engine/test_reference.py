"""The kernels against an independent NumPy DEM: every law of every slot, both integrators, both precisions."""

import numpy as np
import pytest
from reference_dem import ReferenceDem
from scenes import floor

from sand_sim.contact.cohesion import bridge_share
from sand_sim.contact.damping import damping_ratio

YOUNG, POISSON, DENSITY, RESTITUTION, DT = 1e6, 0.25, 2500.0, 0.6, 2e-5
GRAVITY = [0.0, 0.0, -9.81]
GIVEN = {
    "restitution": RESTITUTION,
    "friction": 0.4,
    "stiffness": 500.0,
    "shear_stiffness": 300.0,
    "shear_viscosity": 0.5,
    "viscous_time": 1e-4,
    "rolling_friction": 0.15,
    "adhesion": 0.5,
}
LIQUID = {"saturation": 0.2, "surface_tension": 0.8, "contact_angle": 0.3}
DEFAULT = {"normal": "hertz", "tangential": "mindlin", "rolling": "none", "twisting": "none", "cohesion": "none"}
CHOICES = [
    {},
    {"normal": "linear", "tangential": "linear"},
    {"normal": "viscoelastic", "tangential": "none"},
    {"tangential": "viscous"},
    {"tangential": "mindlin_rescaled"},
    {"rolling": "constant"},
    {"rolling": "spring"},
    {"twisting": "marshall"},
    {"cohesion": "capillary"},
    {"cohesion": "dmt"},
    {"cohesion": "jkr"},
    {"tangential": "mindlin_rescaled", "rolling": "spring", "twisting": "marshall", "cohesion": "capillary"},
]


def heap(number):
    """Grains of different sizes, falling and spinning into each other and onto the floor."""
    random = np.random.default_rng(3)
    lattice = np.stack(np.meshgrid(range(4), range(4), range(4), indexing="ij"), -1).reshape(-1, 3)[:number]
    radius = random.uniform(0.004, 0.006, number)
    position = lattice * 0.0112 + random.uniform(-3e-4, 3e-4, (number, 3)) + [0.0, 0.0, 0.0065]
    velocity = random.normal(0.0, 0.3, (number, 3)) - [0.0, 0.0, 0.5]
    return position, radius, velocity, random.normal(0.0, 20.0, (number, 3))


def make_both(make_world, number, choice, precision, integrator):
    position, radius, velocity, spin = heap(number)
    material = {"density": DENSITY, "young": YOUNG, "poisson": POISSON}
    world = make_world(
        position,
        radius,
        velocity=velocity,
        spin=spin,
        material=material,
        wall=material,
        numbers=GIVEN,
        contact=choice,
        liquid=LIQUID,
        gravity=GRAVITY,
        boundaries=floor(),
        precision=precision,
        time_step=DT,
        integrator=integrator,
    )
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    pair = GIVEN | {"young": YOUNG / (2.0 * (1.0 - POISSON**2)), "shear": shear / (2.0 * (2.0 - POISSON))}
    pair |= {"ratio": damping_ratio(RESTITUTION, 1.5), "linear_ratio": damping_ratio(RESTITUTION, 1.0)}
    pair |= {"bridge_share": bridge_share(0.2), "tension": 0.8, "angle": 0.3}
    planes = [(np.zeros(3), np.array([0.0, 0.0, 1.0]))]
    laws = DEFAULT | choice
    return world, ReferenceDem(position, velocity, spin, radius, DENSITY, laws, pair, planes, GRAVITY, DT, integrator)


def check(world, reference, steps, tolerance):
    start = reference.x.copy()
    for _ in range(steps):
        reference.step()
    world.step(steps)
    grains = world.observe().grains
    moved = np.abs(reference.x - start).max()
    assert np.abs(grains.position - reference.x).max() < tolerance * moved
    velocity, spin = reference.seen()
    assert np.abs(grains.velocity - velocity).max() < tolerance * np.abs(velocity).max()
    if np.any(grains.spin):
        assert np.abs(grains.spin - spin).max() < tolerance * np.abs(spin).max()


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-10), ("single", 1e-3)])
def test_fifty_grains_follow_the_reference(make_world, precision, tolerance):
    world, reference = make_both(make_world, 50, {}, precision, "velocity_verlet")
    check(world, reference, 400, tolerance)
    assert any(np.any(memory.get("spring", 0.0)) for memory in reference.memories.values()), "the case has no contacts"


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: " ".join(choice.values()) or "default")
def test_every_law_follows_the_reference(make_world, choice):
    world, reference = make_both(make_world, 12, choice, "double", "velocity_verlet")
    check(world, reference, 600, 1e-9)


def test_symplectic_euler_follows_the_reference(make_world):
    world, reference = make_both(make_world, 12, {}, "double", "symplectic_euler")
    check(world, reference, 600, 1e-10)


def test_laws_make_a_difference(make_world):
    """Each choice must act in the heap above, else its comparison shows nothing."""
    ends = []
    for choice in CHOICES:
        _, reference = make_both(make_world, 12, choice, "double", "velocity_verlet")
        for _ in range(300):
            reference.step()
        ends.append(np.concatenate([reference.x, reference.w * 1e-3]))
    differences = [np.abs(a - b).max() for k, a in enumerate(ends) for b in ends[:k]]
    assert min(differences) > 1e-7
