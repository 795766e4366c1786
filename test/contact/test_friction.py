"""Friction of one sphere against closed forms."""

import numpy as np
import pytest
from scenes import floor, record

OXIDE = {"density": 4000.0, "young": 380e9, "poisson": 0.23}


@pytest.mark.parametrize(
    ("angle", "expected", "omega"),
    [
        (30, 0.6845, 615.3),
        (35, 0.7398, 582.0),
        (40, 0.7829, 544.2),
        (45, 0.8178, 502.4),
        (60, 0.8948, 355.2),
        (80, 0.9679, 123.4),
    ],
)
def test_oblique_impact_while_sliding(make_world, angle, expected, omega):
    """Chung & Ooi 2011, T4: tangential restitution and spin of a sphere that slides through its impact on a rigid plane."""
    radius, speed, contact = 0.0025, 3.9, 6.105e-6
    turn = np.radians(angle)
    world = make_world(
        [[0.0, 0.0, radius * 1.0005]],
        radius,
        velocity=[speed * np.sin(turn), 0.0, -speed * np.cos(turn)],
        material=OXIDE,
        restitution=0.98,
        friction=0.092,
        boundaries=floor(),
        time_step=contact / 100.0,
        precision="single",
    )
    world.step(400)
    grains = world.observe().grains
    assert grains.velocity[0, 2] > 0.0
    assert grains.velocity[0, 0] / (speed * np.sin(turn)) == pytest.approx(expected, rel=5e-3)
    assert abs(grains.spin[0, 1]) == pytest.approx(omega, rel=5e-3)


def on_floor(make_world, friction, velocity=(0.0, 0.0, 0.0), slope=0.0, spin=None):
    """A sphere at rest in its own dent in a floor, under gravity tilted by a slope [rad]."""
    radius, young, poisson, density = 0.005, 1e7, 0.3, 2500.0
    weight = density * 4 / 3 * np.pi * radius**3 * 9.81 * np.cos(slope)
    dent = (3.0 * weight * (1.0 - poisson**2) / (4.0 * young * np.sqrt(radius))) ** (2.0 / 3.0)
    return make_world(
        [[0.0, 0.0, radius - dent]],
        radius,
        velocity=velocity,
        spin=spin,
        material={"density": density, "young": young, "poisson": poisson},
        friction=friction,
        gravity=[9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)],
        boundaries=floor(),
        domain={"low": [-1.0, -0.1, -0.1], "high": [1.0, 0.1, 0.1]},
        precision="single",
    )


def test_sliding_turns_into_rolling(make_world):
    """Slides until ``t = 2 v0 / (7 mu g)``, then rolls for ever at ``5/7 v0``."""
    world = on_floor(make_world, friction=0.3, velocity=[1.0, 0.0, 0.0])
    history = record(world, 400, round(1e-3 / world.time_step))
    speed, slip = history["velocity"][:, 0, 0], history["velocity"][:, 0, 0] - 0.005 * history["spin"][:, 0, 1]
    rolling = history["time"][np.argmax(slip < 1e-2)]
    assert rolling == pytest.approx(0.09708, rel=1e-2)
    late = speed[history["time"] > 0.12]
    assert late == pytest.approx(5.0 / 7.0, rel=5e-3)


def test_rolls_down_a_slope_without_slip(make_world):
    """``a = 5/7 g sin(slope)`` as long as ``tan(slope) <= 3.5 mu``."""
    slope = np.radians(20.0)
    world = on_floor(make_world, friction=0.5, slope=slope)
    steps = round(0.1 / world.time_step)
    world.step(steps)
    grains = world.observe().grains
    assert grains.velocity[0, 0] == pytest.approx(5.0 / 7.0 * 9.81 * np.sin(slope) * world.time, rel=1e-2)
    assert grains.velocity[0, 0] == pytest.approx(0.005 * grains.spin[0, 1], rel=1e-2)


def test_slides_down_a_steep_slope(make_world):
    """``a = g (sin - mu cos)`` and ``omega' = 5/2 mu g cos / r`` beyond ``tan(slope) = 3.5 mu``."""
    slope, friction = np.radians(40.0), 0.1
    world = on_floor(make_world, friction=friction, slope=slope)
    world.step(round(0.1 / world.time_step))
    grains = world.observe().grains
    down, across = np.sin(slope), friction * np.cos(slope)
    assert grains.velocity[0, 0] == pytest.approx(9.81 * (down - across) * world.time, rel=1e-2)
    assert grains.spin[0, 1] == pytest.approx(2.5 * 9.81 * across / 0.005 * world.time, rel=1e-2)


def test_frictionless_sphere_does_not_turn(make_world):
    world = on_floor(make_world, friction=0.0, velocity=[1.0, 0.0, 0.0])
    world.step(1000)
    grains = world.observe().grains
    assert grains.velocity[0, 0] == pytest.approx(1.0, rel=1e-6)
    assert np.all(grains.spin == 0.0)
