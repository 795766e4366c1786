"""Every adapter against its opposite, through serialised messages where that matters."""

import time

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.builtin_interfaces import stamp_to_time, time_to_stamp
from msg_adapters.diagnostic_msgs import health_to_diagnostics
from msg_adapters.geometry_msgs import command_to_pose, pose_to_command, report_to_wrench, wrench_to_arrays
from msg_adapters.sensor_msgs import cloud_to_points, grains_to_cloud
from sand_sim.border import GrainCloud, Health, ToolPose, ToolReport


@pytest.mark.parametrize("seconds", [0.0, 1e-9, 0.1, 0.3, 12.345678901, 86400.000000001])
def test_times(seconds):
    assert stamp_to_time(time_to_stamp(seconds)) == pytest.approx(seconds, abs=6e-10)
    assert time_to_stamp(seconds).nanosec < 1_000_000_000


@pytest.mark.parametrize("time_of_pose", [None, 0.25])
def test_poses(time_of_pose):
    command = ToolPose("spade", np.array([1.0, -2.0, 3.5]), np.array([0.5, -0.5, 0.5, 0.5]), time_of_pose)
    message = deserialize_message(serialize_message(command_to_pose(command, "world")), PoseStamped)
    assert message.header.frame_id == "world"
    back = pose_to_command(message, "spade")
    assert np.array_equal(back.position, command.position)
    assert np.array_equal(back.orientation, command.orientation)
    assert back.time == time_of_pose


def test_wrenches():
    zeros = np.zeros(3)
    report = ToolReport(
        "spade",
        zeros,
        np.array([0, 0, 0, 1.0]),
        zeros,
        zeros,
        np.array([1.0, 2.0, 3.0]),
        np.array([4.0, 5.0, 6.0]),
        zeros,
        0.0,
        0.0,
    )
    message = report_to_wrench(report, 1.5)
    force, torque = wrench_to_arrays(message)
    assert np.array_equal(force, report.force)
    assert np.array_equal(torque, report.torque)
    assert message.header.frame_id == "spade"
    assert stamp_to_time(message.header.stamp) == 1.5


def grains(number):
    random = np.random.default_rng(0)
    return GrainCloud(
        identity=np.arange(number),
        position=random.normal(size=(number, 3)),
        velocity=random.normal(size=(number, 3)).astype(np.float32),
        spin=np.zeros((number, 3), np.float32),
        radius=random.uniform(0.001, 0.002, number).astype(np.float32),
        mass=np.ones(number, np.float32),
        orientation=np.tile([0.0, 0.0, 0.0, 1.0], (number, 1)),
    )


@pytest.mark.parametrize(("number", "decimation"), [(0, 1), (1, 1), (1000, 1), (1000, 7)])
def test_clouds(number, decimation):
    cloud = grains(number)
    sent = grains_to_cloud(cloud, 2.0, "world", decimation)
    message = deserialize_message(serialize_message(sent), PointCloud2)
    points = cloud_to_points(message)
    kept = cloud.identity[::decimation]
    assert np.array_equal(points["id"], kept)
    assert np.column_stack([points[name] for name in "xyz"]) == pytest.approx(cloud.position[kept], rel=1e-6)
    assert np.array_equal(points["radius"], cloud.radius[kept])
    assert points["speed"] == pytest.approx(cloud.speed[kept])
    assert [field.name for field in message.fields] == ["x", "y", "z", "radius", "speed", "id"]
    assert message.width * message.point_step == message.row_step == len(message.data)


def test_large_clouds_do_not_go_byte_by_byte():
    """Assigning bytes to the data field would take a quarter of a second for these points; generous against a busy machine."""
    cloud = grains(100_000)
    start = time.perf_counter()
    grains_to_cloud(cloud, 0.0, "world")
    assert time.perf_counter() - start < 0.15


@pytest.mark.parametrize("doubts", [(), ("overlap reached 12 % of a radius",)])
def test_health(doubts):
    health = Health(1e-5, 1.0, 0.02, 1.0, 2.0, 3.0, 4.0, 5.0, 1e-9, 0.5, 123, 4, doubts)
    message = health_to_diagnostics(health, 1.0, "sand_sim: world", "cpu", {"more": "1"})
    status = message.status[0]
    assert status.level == (DiagnosticStatus.WARN if doubts else DiagnosticStatus.OK)
    values = {entry.key: entry.value for entry in status.values}
    assert values["contacts"] == "123"
    assert values["grains retired"] == "4"
    assert values["more"] == "1"
    if doubts:
        assert doubts[0] in status.message
