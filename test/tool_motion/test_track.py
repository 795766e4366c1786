"""The ways of tools along the trajectory of a scene."""

from itertools import pairwise

import numpy as np
import pytest

from sand_sim import rotation
from sand_sim.scene.motion import Motion
from sand_sim.scene.types import Pose, Waypoint
from sand_sim.tool_motion.track import phases_of, pose_on_trajectory


def way(*phases):
    """Waypoints a second apart that name the ways to them."""
    return tuple(Waypoint(float(k), Pose((0.0, 0.0, 0.0)), phase) for k, phase in enumerate(phases))


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        (("", "cut", "cut", "carry"), {"cut": (0.0, 2.0), "carry": (2.0, 3.0)}),
        (("cut", "cut", "cut"), {"cut": (0.0, 2.0)}),  # no way leads to the first waypoint, which is often named all the same
        (("cut", "carry", "", "dump"), {"carry": (0.0, 1.0), "dump": (2.0, 3.0)}),
    ],
)
def test_a_phase_lasts_as_long_as_neighbouring_ways_have_its_name(phases, expected):
    assert phases_of(way(*phases)) == expected


def test_a_screw_turns_on_and_on():
    """Waypoints less than half a turn apart, a hundred turns: ``angle = rate time``, at the waypoints and between them."""
    steps, turn = 250, 0.8 * np.pi
    screw = [Waypoint(float(k), Pose((0.0, 0.0, 0.0), tuple(rotation.from_rpy(0.0, 0.0, k * turn)))) for k in range(steps + 1)]
    for time in np.linspace(0.0, steps, 997):
        orientation = pose_on_trajectory(tuple(screw), time)[1]
        half = 0.5 * time * turn
        assert abs(orientation @ [0.0, 0.0, np.sin(half), np.cos(half)]) == pytest.approx(1.0, abs=1e-12)


def test_a_motion_goes_on_from_the_waypoint_before_it():
    """``x = x0 + v t + A sin(2 pi f t)`` and ``angle = w t`` about an axis of the world; before and after it rests."""
    tilted = rotation.from_rpy(0.3, -0.4, 0.5)
    motion = Motion((0.1, 0.0, -0.2), (0.0, 0.0, 30.0), (0.0, 0.01, 0.02), 7.0)
    end = motion.after(np.array([1.0, 2.0, 3.0]), tilted, 2.05)
    way = (Waypoint(1.0, Pose((1.0, 2.0, 3.0), tuple(tilted))), Waypoint(3.05, Pose(*map(tuple, end)), motion=motion))
    for time in np.linspace(0.9, 3.2, 101):
        position, orientation = pose_on_trajectory(way, time)
        passed = np.clip(time - 1.0, 0.0, 2.05)
        swung = np.sin(2.0 * np.pi * 7.0 * passed)
        assert position == pytest.approx([1.0 + 0.1 * passed, 2.0 + 0.01 * swung, 3.0 - 0.2 * passed + 0.02 * swung], abs=1e-12)
        meant = rotation.multiply(rotation.from_rpy(0.0, 0.0, 30.0 * passed), tilted)
        assert abs(orientation @ meant) == pytest.approx(1.0, abs=1e-12)


def test_a_spin_is_told_less_than_half_a_turn_apart():
    stops = [0.5, *Motion(spin=(0.0, 40.0, 30.0)).stops(0.5, 1.7), 1.7]
    assert 0.0 < np.diff(stops).min() <= np.diff(stops).max() < 0.999 * np.pi / 50.0
    assert Motion((1.0, 0.0, 0.0)).stops(0.0, 9.0) == []


def test_straight_ways_between_its_stops_make_a_sine():
    """To a thousandth of the amplitude."""
    motion, start = Motion(amplitude=(0.0, 3e-4, 4e-4), frequency=60.0), (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    for before, after in pairwise([0.5, *motion.stops(0.5, 1.7), 1.7]):
        ends = np.array([motion.after(*start, time)[0] for time in (before, after)])
        middle = motion.after(*start, 0.5 * (before + after))[0]
        assert before < after
        assert np.linalg.norm(ends.mean(axis=0) - middle) <= 1e-3 * 5e-4
