"""The node in a process that is not its own: whoever runs it shuts ROS down when they like, and has other nodes."""

import json
import time

import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE
from rclpy.parameter import Parameter
from scenes import write_small_scene

from sand_sim.node.node import SandSimNode


def test_shutting_ros_down_is_no_fault_of_the_run(tmp_path, capfd):
    """As Ctrl-C does in a process that leaves it to rclpy, before anybody can destroy the node."""
    rclpy.init()
    given = {"scene": str(write_small_scene(tmp_path)), "pacing": "fast", "output": str(tmp_path / "out")}
    node = SandSimNode(parameter_overrides=[Parameter(name, value=value) for name, value in given.items()])
    try:
        node.start()
        assert node.simulation.step().result(PATIENCE) is None
        rclpy.shutdown()
        end = time.monotonic() + PATIENCE
        while node.simulation.fault is None and time.monotonic() < end:
            time.sleep(0.01)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    assert json.loads((tmp_path / "out" / "small.json").read_text())["doubts"] == []
    assert not node.incomplete
    assert "stepping has stopped" not in capfd.readouterr().err
