"""The ways of tools along the trajectory of a scene."""

import numpy as np
import pytest

from sand_sim import rotation
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
