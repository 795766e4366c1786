"""Friction of one sphere against closed forms."""

import numpy as np
import pytest
from scenes import floor, record

OXIDE = {"density": 4000.0, "young": 380e9, "poisson": 0.23}


def oblique_impact(make_world, angle, **further):
    """Grains after the impact of Chung & Ooi 2011, T4, at an angle [deg] from the normal; the time step is the automatic one."""
    radius, speed, contact = 0.0025, 3.9, 6.105e-6
    turn = np.radians(angle)
    common = {"material": OXIDE, "restitution": 0.98, "friction": 0.092, "precision": "single", "threads": 1}
    world = make_world(
        [[0.0, 0.0, radius * 1.0005]],
        radius,
        velocity=[speed * np.sin(turn), 0.0, -speed * np.cos(turn)],
        boundaries=floor(),
        **common | further,
    )
    world.step(round(4.0 * contact / world.time_step))
    grains = world.observe().grains
    assert grains.velocity[0, 2] > 0.0
    return grains.velocity[0, 0] / (speed * np.sin(turn)), grains.spin[0, 1], grains.velocity[0, 0] - radius * grains.spin[0, 1]


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize(
    ("angle", "expected", "omega", "tolerance"),
    [
        (20, 0.6201, 506.7, 1e-2),
        (25, 0.6381, 596.5, 1e-2),
        (30, 0.6845, 615.3, 5e-3),
        (35, 0.7398, 582.0, 5e-3),
        (40, 0.7829, 544.2, 5e-3),
        (45, 0.8178, 502.4, 5e-3),
        (60, 0.8948, 355.2, 5e-3),
        (80, 0.9679, 123.4, 5e-3),
    ],
)
def test_oblique_impact(make_world, angle, expected, omega, tolerance, precision):
    """Chung & Ooi 2011, T4: tangential restitution and spin; up to 25 degrees the contact sticks for a while."""
    tangential, spin, _ = oblique_impact(make_world, angle, precision=precision)
    assert tangential == pytest.approx(expected, rel=tolerance)
    assert spin == pytest.approx(omega, rel=tolerance)


def test_patch_leaves_backwards_below_32_5_degrees(make_world):
    """``v_t - mu (1 + e) v_n (1 + 5/2) = 0`` at tan(angle) = 7/2 mu (1 + e)."""
    assert oblique_impact(make_world, 32.0)[2] < 0.0
    assert oblique_impact(make_world, 33.0)[2] > 0.0


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.9])
def test_sliding_takes_mu_times_the_normal_momentum(make_world, restitution):
    """``v_t' = v_t - mu (1 + e) v_n`` whatever the damping."""
    turn = np.radians(50.0)
    tangential, *_ = oblique_impact(make_world, 50.0, restitution=restitution)
    assert tangential == pytest.approx(1.0 - 0.092 * (1.0 + restitution) / np.tan(turn), rel=1e-3)


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
    world.step(round(0.09 / world.time_step))
    history = record(world, 100, round(1e-4 / world.time_step))
    slip = history["velocity"][:, 0, 0] - 0.005 * history["spin"][:, 0, 1]
    rolling = history["time"][np.argmax(slip <= 0.0)]
    assert rolling == pytest.approx(0.09708, rel=5e-3)
    world.step(round(0.3 / world.time_step))
    assert world.observe().grains.velocity[0, 0] == pytest.approx(5.0 / 7.0, rel=5e-3)


@pytest.mark.parametrize(("degrees", "friction"), [(20.0, 0.5), (34.0, 0.2)])
def test_rolls_down_a_slope_without_slip(make_world, degrees, friction):
    """``a = 5/7 g sin(slope)`` as long as ``tan(slope) <= 3.5 mu``, which is 35 degrees with mu = 0.2."""
    slope = np.radians(degrees)
    world = on_floor(make_world, friction=friction, slope=slope)
    world.step(round(0.1 / world.time_step))
    grains = world.observe().grains
    assert grains.velocity[0, 0] == pytest.approx(5.0 / 7.0 * 9.81 * np.sin(slope) * world.time, rel=5e-3)
    assert grains.velocity[0, 0] == pytest.approx(0.005 * grains.spin[0, 1], rel=5e-3)


@pytest.mark.parametrize(("degrees", "friction"), [(40.0, 0.1), (36.0, 0.2)])
def test_slides_down_a_steep_slope(make_world, degrees, friction):
    """``a = g (sin - mu cos)`` and ``omega' = 5/2 mu g cos / r`` beyond ``tan(slope) = 3.5 mu``."""
    slope = np.radians(degrees)
    world = on_floor(make_world, friction=friction, slope=slope)
    world.step(round(0.1 / world.time_step))
    grains = world.observe().grains
    down, across = np.sin(slope), friction * np.cos(slope)
    assert grains.velocity[0, 0] == pytest.approx(9.81 * (down - across) * world.time, rel=5e-3)
    assert grains.spin[0, 1] == pytest.approx(2.5 * 9.81 * across / 0.005 * world.time, rel=5e-3)


def test_smooth_floor_gives_no_kicks(make_world):
    """A frictionless sphere that slides over a plane keeps speed and height to 1e-6, and does not turn."""
    world = on_floor(make_world, friction=0.0, velocity=[1.0, 0.0, 0.0])
    height = world.observe().grains.position[0, 2]
    history = record(world, 100, 20)
    assert history["position"][-1, 0, 0] > 0.05
    assert history["velocity"][:, 0, 0] == pytest.approx(1.0, rel=1e-6)
    assert np.abs(history["velocity"][:, 0, 1:]).max() < 1e-6
    assert np.abs(history["position"][:, 0, 2] - height).max() < 1e-6 * 0.005
    assert np.all(history["spin"] == 0.0)
