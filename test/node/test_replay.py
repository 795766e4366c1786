"""Poses as a bag keeps and plays them: bytes, with stamps of their time."""

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import NO_TURN, START, Client
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_pose, wrench_to_arrays
from sand_sim import ToolPose

DEPTH = 0.0362
TIMES = np.arange(1, 26) / 50.0


def bag(first):
    """The plate presses for half a second; the first stamp is that of the first pose."""
    places = START - np.outer(TIMES / TIMES[-1], [0.0, 0.0, DEPTH])
    poses = [ToolPose("plate", place, NO_TURN, at) for place, at in zip(places, TIMES + first, strict=True)]
    return [serialize_message(command_to_pose(pose, "world")) for pose in poses]


def play(client: Client, bodies, period):
    for body in bodies:
        client.poses.publish(body)
        client.executor.spin_once(timeout_sec=period)


def felt_in_lockstep(client: Client, bodies, period, until):
    """All wrenches up to a time, after which the node is reset."""
    client.wrenches.clear()
    play(client, bodies, period)
    client.wait_for(lambda: client.wrenches and stamp_to_time(client.wrenches[-1].header.stamp) > until - 1e-6)
    felt = {stamp_to_time(wrench.header.stamp): wrench_to_arrays(wrench) for wrench in client.wrenches}
    assert client.call(Trigger, "reset").success
    return np.array([felt[at] for at in sorted(felt) if at > 0.0])


def test_the_same_wrenches_at_any_speed(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    runs = [felt_in_lockstep(client, bag(0.0), period, TIMES[-1]) for period in (0.0, 0.01)]
    assert np.array_equal(*runs)
    assert np.abs(runs[0]).max() > 1.0
    assert node.simulation.rejected == {}


@pytest.mark.parametrize("stamps", ["simulated", "relative", "ignored"])
def test_stamps_of_years_ago(client, start_node, stamps):
    """They are refused with what to set, and taken if that is set."""
    node = start_node(stamps=stamps)
    client.connect()
    play(client, bag(1.5e9), 0.0)
    if stamps == "simulated":
        client.wait_for(lambda: node.simulation.rejected == {"future": len(TIMES)})
        assert "stamps:=ignored" in node.simulation.last_rejection
    else:
        client.wait_for(lambda: client.wrenches and wrench_to_arrays(client.wrenches[-1])[0][2] > 1.0)
        assert node.simulation.rejected == {}


def test_stamps_of_years_ago_in_lockstep(client, start_node):
    """Counted from the first, they give the same wrenches to the bit, however fast they are played."""
    node = start_node(pacing="lockstep", stamps="relative")
    client.connect()
    runs = [
        felt_in_lockstep(client, bag(1.5e9), period, until=node.parameters["stream_gap"] + TIMES[-2]) for period in (0.0, 0.01)
    ]
    assert np.array_equal(*runs)
    assert np.abs(runs[0]).max() > 1.0
    assert node.simulation.rejected == {}
