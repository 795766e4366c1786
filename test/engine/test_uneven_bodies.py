"""Bodies whose mass lies unevenly, against invariants and the theorem of parallel axes."""

import numpy as np
import pytest
from body_worlds import MATERIALS
from scenes import floor

from sand_sim import rotation


@pytest.mark.parametrize(
    ("integrator", "precision", "tolerance"),
    [("velocity_verlet", "double", 1e-6), ("velocity_verlet", "single", 2e-5), ("symplectic_euler", "double", 2e-6)],
)
def test_a_ball_whose_mass_lies_unevenly_rolls_for_ever(make_bodies, integrator, precision, tolerance):
    """Chaplygin's ball: no slip, no loss, though it wobbles and its spin turns; its angular momentum about the contact stays.

    It gained 0.5 per mille a second when springs took the spin of the middle of a step about the axes of its end.
    """
    radius, gravity = 0.01, 9.81
    mass = MATERIALS["stone"]["density"] * 4 / 3 * np.pi * radius**3
    moments = mass * radius**2 * np.array([0.2, 0.36, 0.48])
    effective = MATERIALS["stone"]["young"] / (1.0 - MATERIALS["stone"]["poisson"] ** 2)
    arm = radius - (3.0 * mass * gravity / (4.0 * effective * np.sqrt(radius))) ** (2.0 / 3.0)
    spin = np.array([30.0, 20.0, 10.0])
    ball = {"spheres": [[0.0, 0.0, 0.0, radius]], "mass": mass, "inertia": moments.tolist(), "spin": spin.tolist()}
    ball |= {"pose": {"position": [0.0, 0.0, arm]}, "velocity": np.cross(spin, [0.0, 0.0, arm]).tolist()}
    world = make_bodies(
        {"ball": ball},
        restitution=1.0,
        friction=5.0,
        gravity=[0.0, 0.0, -gravity],
        boundaries=floor(),
        precision=precision,
        solver={"threads": 1, "integrator": integrator},
    )

    def momentum():
        body = world.observe().body("ball")
        turn = body.orientation
        own = rotation.rotate(turn, moments * rotation.rotate(rotation.inverse(turn), body.spin))
        return own + mass * np.cross([0.0, 0.0, arm], body.velocity)

    start, energy, spins = momentum(), world.observe().health.kinetic, []
    for _ in range(5):
        world.step(round(0.2 / world.time_step))
        assert abs(world.observe().health.dissipated) < tolerance * energy
        assert momentum() == pytest.approx(start, abs=tolerance * np.linalg.norm(start))
        spins.append(world.observe().body("ball").spin)
    assert np.ptp(spins, axis=0).max() > 3.0


CROOKED = np.array([[0.05, 0, 0, 0.01], [0, 0.03, 0.01, 0.015], [-0.02, 0, 0.04, 0.012], [0.03, -0.04, 0.02, 0.008]])


def tensor_about(spheres, place):
    """Mass [kg], centre and inertia [kg m^2] about it of spheres of stone that lie apart, by the theorem of parallel axes."""
    mass = 2500.0 * 4.0 / 3.0 * np.pi * spheres[:, 3] ** 3
    centre = mass @ place / mass.sum()
    inertia = np.zeros((3, 3))
    for one, away, radius in zip(mass, place - centre, spheres[:, 3], strict=True):
        inertia += one * ((0.4 * radius**2 + away @ away) * np.eye(3) - np.outer(away, away))
    return mass.sum(), centre, inertia


@pytest.mark.parametrize("given", ["", "mass", "inertia"])
def test_a_body_without_symmetry_lies_and_turns_as_its_own_frame_says(make_bodies, given):
    """Its principal axes are none of its own frame, unless its inertia is given about those."""
    turn, start, spin = rotation.from_rpy(0.4, -0.7, 1.1), np.array([0.1, -0.2, 0.3]), np.array([3.0, -5.0, 8.0])
    crooked = {"spheres": CROOKED.tolist(), "spin": spin.tolist(), "velocity": [0.2, 0.1, -0.3]}
    crooked |= {"pose": {"position": start.tolist(), "orientation": turn.tolist()}}
    own = np.array([2e-5, 3e-5, 4e-5])
    if given:
        crooked |= {"mass": 0.07} | ({"inertia": own.tolist()} if given == "inertia" else {})
    world = make_bodies({"crooked": crooked}, solver={"time_step": 1e-3, "force_time_step": True})
    first = world.observe()
    mass, centre, inertia = tensor_about(CROOKED, start + rotation.rotate(turn, CROOKED[:, :3]))
    if given:
        axes = rotation.to_matrices(turn)
        mass, inertia = 0.07, axes * own @ axes.T if given == "inertia" else 0.07 / mass * inertia
    assert first.health.kinetic == pytest.approx(0.5 * (mass * 0.14 + spin @ inertia @ spin), rel=1e-4)
    assert world.assembly.bodies[0].distance(first.spheres.position) == pytest.approx(-CROOKED[:, 3], rel=1e-4)
    for seen in (first, world.step(300) or world.observe()):
        body = seen.body("crooked")
        lie = body.position + rotation.rotate(body.orientation, CROOKED[:, :3])
        assert seen.spheres.position == pytest.approx(lie, abs=1e-7)
        apart = seen.spheres.position - centre - seen.time * body.velocity
        assert seen.spheres.velocity == pytest.approx(body.velocity + np.cross(body.spin, apart), abs=1e-5)
    assert first.body("crooked").position == pytest.approx(start, abs=1e-7)
    assert abs(first.body("crooked").orientation @ turn) == pytest.approx(1.0, abs=1e-9)
    axes = rotation.to_matrices(rotation.multiply(body.orientation, rotation.inverse(turn)))
    assert axes @ inertia @ axes.T @ body.spin == pytest.approx(inertia @ spin, rel=1e-4)  # angular momentum
    assert np.linalg.norm(body.spin - spin) > 1.0
