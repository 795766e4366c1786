"""Error measures."""

import numpy as np
import pytest

from sand_sim.scene.types import SceneError
from sand_sim.study.impact import Impact
from sand_sim.study.quantity import Spread, Wrench, choose_quantity, relative, smoothed
from sand_sim.study.sample import Sample, mean_sample

TIME = np.linspace(0.02, 2.0, 100)


def wrench(force, work=5.0):
    return Sample(TIME, {"tool force": force, "tool torque": 0.1 * force, "tool work": np.linspace(0.0, work, len(TIME))})


def test_relative_distance():
    assert relative(np.array([3.0, 4.0]), np.array([3.0, 4.0])) == 0.0
    assert relative(np.array([0.0, 0.0]), np.array([3.0, 4.0])) == 1.0
    assert relative(np.array(1.1), np.array(1.0)) == pytest.approx(0.1)
    assert relative(np.zeros(2), np.zeros(2)) == 0.0
    assert relative(np.ones(2), np.zeros(2)) == np.inf


def test_smoothing_keeps_what_is_even_and_takes_away_what_is_rough():
    assert smoothed(np.full((100, 3), 2.0), TIME) == pytest.approx(np.full((100, 3), 2.0))
    rough = np.where(np.arange(100) % 2, 1.0, -1.0)
    assert np.abs(smoothed(rough, TIME)[30:-30]).max() < 0.001  # nearer to the ends the mean is one-sided
    assert smoothed(np.sin(2.0 * np.pi * TIME / 20.0), TIME)[50] == pytest.approx(np.sin(2.0 * np.pi * TIME[50] / 20.0), rel=0.01)


def test_wrench_errors():
    force = np.column_stack([-20.0 * TIME, 0.0 * TIME, 5.0 * TIME])
    reference = wrench(force)
    assert max(Wrench().errors(reference, reference).values()) == 0.0
    errors = Wrench().errors(wrench(1.1 * force, work=6.0), reference)
    assert errors == pytest.approx({"tool force": 0.1, "tool torque": 0.1, "tool impulse": 0.1, "tool work": 0.2})


def test_forces_that_only_jitter_are_alike():
    """Two histories with the same smooth part are near one another however much single frames differ."""
    smooth, random = np.column_stack([-20.0 * TIME, 0.0 * TIME, 5.0 * TIME]), np.random.default_rng(0)
    noisy = [wrench(smooth + random.normal(0.0, 8.0, smooth.shape)) for _ in range(2)]
    raw = relative(noisy[0].values["tool force"], noisy[1].values["tool force"])
    assert Wrench().errors(*noisy)["tool force"] < 0.25 * raw


def test_spread_errors():
    reach, height = 0.1 + 0.1 * TIME, 0.05 - 0.01 * TIME
    reference = Sample(TIME, {"reach": reach, "height": height})
    errors = Spread().errors(Sample(TIME, {"reach": reach + 0.01, "height": height}), reference)
    assert errors["reach"] == pytest.approx(0.01 / np.ptp(reach))
    assert errors["height"] == 0.0
    assert errors["last reach"] == pytest.approx(0.01 / reach[-1])


def _flat(make_world, position, velocity, **further):
    """Grains that lie on a floor, or leave the domain."""
    boundaries = [{"type": "plane", "material": "wall", "point": [0, 0, 0], "normal": [0, 0, 1]}]
    domain = {"low": [-0.1, -0.1, -0.1], "high": [0.1, 0.1, 0.1]}
    further |= {"boundaries": boundaries, "domain": domain, "duration": 0.1, "frame_rate": 50.0}
    return make_world(position, 0.005, velocity=velocity, **further)


def test_grains_that_leave_count_for_the_spread(make_world):
    """What stays behind may lie alike though half of the grains have left: reach and height tell nothing of them."""
    stays, leaves = [[-0.05, 0.0, 0.005], [0.05, 0.0, 0.005]], [[-0.05, 0.09, 0.005], [0.05, 0.09, 0.005]]
    still = Spread().measure(_flat(make_world, stays + leaves, [0.0, 0.0, 0.0]), lambda: None)
    velocity = [[0.0, 0.0, 0.0]] * 2 + [[0.0, 2.0, 0.0]] * 2
    halved = Spread().measure(_flat(make_world, stays + leaves, velocity), lambda: None)
    assert halved.values["mass"] == pytest.approx([0.5] * 5)
    assert Spread().errors(halved, still)["mass"] == pytest.approx(0.5)
    assert Spread().errors(still, still)["mass"] == 0.0


def test_a_spread_of_nothing_is_refused(make_world):
    world = _flat(make_world, [[0.0, 0.09, 0.005]], [0.0, 2.0, 0.0])
    with pytest.raises(SceneError, match=r"domain: all grains have left it at t = 0\.02 s"):
        Spread().measure(world, lambda: None)


def test_a_run_without_a_frame_is_refused(make_world):
    with pytest.raises(SceneError, match="duration: is less than half a frame"):
        Spread().measure(make_world([[0.0, 0.0, 0.0]], 0.005, duration=0.009, frame_rate=50.0), lambda: None)


def test_mean_of_samples():
    mean = mean_sample([wrench(np.ones((100, 3))), wrench(3.0 * np.ones((100, 3)))])
    assert mean.values["tool force"] == pytest.approx(2.0 * np.ones((100, 3)))


@pytest.mark.parametrize("bodies", ["plane", "pair"])
@pytest.mark.parametrize("restitution", [1.0, 0.6])
def test_impact_finds_the_closed_form(make_world, bodies, restitution):
    """Against Chung & Ooi 2011, test 1 (glass, two spheres) and test 2 (aluminium alloy on a plane)."""
    if bodies == "pair":
        position, velocity, radius = [[0, 0, 0], [0.02001, 0, 0]], [[10.0, 0, 0], [-10.0, 0, 0]], 0.01
        material, expected = {"density": 2800.0, "young": 48e9, "poisson": 0.2}, (10697.0, 274.11e-6, 40.34e-6)
        boundaries, duration = [], 60e-6
    else:
        position, velocity, radius = [[0, 0, 0.100002]], [0, 0, -0.2], 0.1
        material, expected = {"density": 2699.0, "young": 70e9, "poisson": 0.3}, (11370.0, 49.717e-6, 731.7e-6)
        boundaries = [{"type": "plane", "material": "wall", "point": [0, 0, 0], "normal": [0, 0, 1]}]
        duration = 1e-3
    common = {"material": material, "restitution": restitution, "friction": 0.0, "time_step": expected[2] / 100}
    common |= {"boundaries": boundaries, "duration": duration, "frame_rate": 1e5, "contact": {"tangential": "none"}}
    world = make_world(position, radius, velocity=velocity, **common)
    exact = Impact().exact(world.scene)
    sample = Impact().measure(world, lambda: None)
    if restitution == 1.0:
        figures = [float(exact.values[name]) for name in ("peak force", "peak overlap", "contact time")]
        assert figures == pytest.approx(expected, rel=1e-3)
    else:
        assert set(exact.values) == {"rebound"}
    assert max(Impact().errors(sample, exact).values()) < 5e-3
    assert choose_quantity(world.scene, len(world.observe().grains)) == "impact"


@pytest.mark.parametrize("contact", [{"normal": "viscoelastic"}, {"normal": "linear"}, {"cohesion": "dmt"}])
def test_impacts_by_other_laws_have_no_closed_form(make_world, contact):
    """Hertz's says nothing of them, so that what is right would look wrong."""
    world = make_world(
        [[0, 0, 0.0051]],
        0.005,
        velocity=[0, 0, -0.2],
        contact={"tangential": "none"} | contact,
        numbers={"viscous_time": 1e-6, "stiffness": 1e4, "adhesion": 0.01},
        boundaries=[{"type": "plane", "material": "wall", "point": [0, 0, 0], "normal": [0, 0, 1]}],
        duration=0.005,
    )
    assert Impact().exact(world.scene) is None
    assert 0.3 < Impact().measure(world, lambda: None).values["rebound"] < 1.0


@pytest.mark.parametrize("contact", [{}, {"normal": "linear"}])
@pytest.mark.parametrize("bodies", ["plane", "pair"])
@pytest.mark.parametrize("motion", [{"velocity": [0.1, 0, -0.2]}, {"velocity": [0, 0, -0.2], "spin": [0, 20, 0]}])
def test_impacts_in_which_friction_matters_are_refused(make_world, contact, bodies, motion):
    """The rebound does not show it: without any friction, which would be recommended, it is the same."""
    position, boundaries = [[0, 0, 0.0051]], [{"type": "plane", "material": "wall", "point": [0, 0, 0], "normal": [0, 0, 1]}]
    if bodies == "pair":
        position, boundaries = [[0, 0, 0.0101], [0, 0, 0]], []
        motion = {name: [value, [0.0, 0.0, 0.0]] for name, value in motion.items()}
    numbers = {"stiffness": 1e4}
    world = make_world(position, 0.005, contact=contact, numbers=numbers, boundaries=boundaries, duration=0.005, **motion)
    with pytest.raises(SceneError, match="an impact must be head-on, of grains that do not spin; use another --quantity"):
        Impact().exact(world.scene)
