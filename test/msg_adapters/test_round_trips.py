"""Every adapter against its opposite, through serialised messages where that matters."""

import numpy as np
import pytest
from timing import quickest

pytest.importorskip("rclpy", reason="needs ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Image, PointCloud2, PointField

from msg_adapters.builtin_interfaces import stamp_to_time, time_to_stamp
from msg_adapters.diagnostic_msgs import health_to_diagnostics
from msg_adapters.geometry_msgs import (
    arrays_to_wrench,
    command_to_pose,
    command_to_twist,
    frame_to_transform,
    pose_to_command,
    transform_to_frame,
    twist_to_command,
    wrench_to_arrays,
)
from msg_adapters.nav_msgs import grid_to_metadata
from msg_adapters.sensor_msgs import cloud_to_points, grains_to_cloud, heights_to_image, image_to_heights
from msg_adapters.visualization_msgs import contacts_to_markers
from sand_sim.border import Frame, GrainCloud, Health, ToolContacts, ToolPose, ToolVelocity


@pytest.mark.parametrize("seconds", [0.0, 1e-9, 0.1, 0.3, 12.345678901, 86400.000000001])
def test_times(seconds):
    assert stamp_to_time(time_to_stamp(seconds)) == pytest.approx(seconds, abs=6e-10)
    assert time_to_stamp(seconds).nanosec < 1_000_000_000


def test_times_go_to_the_nearest_nanosecond():
    stamps = [time_to_stamp(1e-3 * k) for k in range(3000)]  # of which many lie a little below what is meant
    assert [10**9 * stamp.sec + stamp.nanosec for stamp in stamps] == [10**6 * k for k in range(3000)]


@pytest.mark.parametrize("time_of_pose", [None, 0.25])
def test_poses(time_of_pose):
    command = ToolPose("spade", np.array([1.0, -2.0, 3.5]), np.array([0.5, -0.5, 0.5, 0.5]), time_of_pose)
    message = deserialize_message(serialize_message(command_to_pose(command, "world")), PoseStamped)
    assert message.header.frame_id == "world"
    back = pose_to_command(message, "spade")
    assert np.array_equal(back.position, command.position)
    assert np.array_equal(back.orientation, command.orientation)
    assert back.time == time_of_pose


@pytest.mark.parametrize(("in_tool_frame", "at"), [(True, None), (False, 0.25)])
def test_velocities(in_tool_frame, at):
    command = ToolVelocity("spade", np.array([1.0, -2.0, 3.5]), np.array([0.1, 0.2, -0.3]), in_tool_frame, at)
    message = deserialize_message(serialize_message(command_to_twist(command, "arm")), TwistStamped)
    assert message.header.frame_id == "arm"
    back = twist_to_command(message, "spade", in_tool_frame)
    assert np.array_equal(back.linear, command.linear)
    assert np.array_equal(back.angular, command.angular)
    assert (back.tool, back.time, back.in_tool_frame) == ("spade", at, in_tool_frame)


@pytest.mark.parametrize("at", [None, 0.25])
def test_frames(at):
    frame = Frame("arm", "base", np.array([1.0, -2.0, 3.5]), np.array([0.5, -0.5, 0.5, 0.5]), at)
    message = deserialize_message(serialize_message(frame_to_transform(frame)), TransformStamped)
    back = transform_to_frame(message, fixed=at is None)
    assert (back.name, back.parent, back.time) == ("arm", "base", at)
    assert np.array_equal(back.position, frame.position)
    assert np.array_equal(back.orientation, frame.orientation)


def test_wrenches():
    sent = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    message = arrays_to_wrench(*sent, 1.5, "spade")
    force, torque = wrench_to_arrays(message)
    assert np.array_equal(force, sent[0])
    assert np.array_equal(torque, sent[1])
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
        mass=random.uniform(0.1, 0.2, number).astype(np.float32),
        orientation=np.tile([0.0, 0.0, 0.0, 1.0], (number, 1)),
    )


@pytest.mark.parametrize("number", [0, 1, 1000])
def test_clouds(number):
    cloud = grains(number)
    message = deserialize_message(serialize_message(grains_to_cloud(cloud, 2.0, "world")), PointCloud2)
    points = cloud_to_points(message)
    assert np.array_equal(points["id"], cloud.identity)
    assert np.column_stack([points[name] for name in "xyz"]) == pytest.approx(cloud.position, rel=1e-6)
    assert np.array_equal(points["radius"], cloud.radius)
    assert points["speed"] == pytest.approx(cloud.speed)
    assert [field.name for field in message.fields] == ["x", "y", "z", "radius", "speed", "id"]
    assert message.width * message.point_step == message.row_step == len(message.data)


def test_clouds_have_the_fields_that_are_asked_for():
    cloud = grains(10)
    points = cloud_to_points(grains_to_cloud(cloud, 2.0, "world", ("x", "vz", "mass", "id")))
    assert points.dtype.names == ("x", "vz", "mass", "id")
    assert np.array_equal(points["vz"], cloud.velocity[:, 2])
    assert points.dtype["id"] == np.uint32


def test_clouds_are_what_their_headers_say():
    """Read as strangers do: by offset, type, step and order of bytes."""
    cloud = grains(7)
    message = grains_to_cloud(cloud, 2.0, "world", ("id", "velocity", "mass", "position", "radius", "speed"))
    assert (message.height, message.width, message.is_dense) == (1, 7, True)  # no point is missing
    kinds = {PointField.FLOAT32: "f4", PointField.UINT32: "u4"}
    order, data = "><"[not message.is_bigendian], bytes(message.data)
    found = {
        field.name: np.ndarray(7, order + kinds[field.datatype], data, field.offset, (message.point_step,))
        for field in message.fields
    }
    meant = {"id": cloud.identity, "mass": cloud.mass, "radius": cloud.radius, "speed": np.linalg.norm(cloud.velocity, axis=1)}
    for k, axis in enumerate("xyz"):
        meant |= {axis: cloud.position[:, k], f"v{axis}": cloud.velocity[:, k]}
    assert found.keys() == meant.keys()
    for name, values in meant.items():
        assert found[name] == pytest.approx(values, rel=1e-6), name


def test_heights():
    heights = np.array([[0.1, np.nan, 0.3], [0.4, 0.5, 0.6]], np.float32)
    message = deserialize_message(serialize_message(heights_to_image(heights, 2.0, "world")), Image)
    assert (message.height, message.width, message.encoding, message.step) == (2, 3, "32FC1", 12)
    assert np.array_equal(image_to_heights(message), heights, equal_nan=True)
    order = "><"[not message.is_bigendian]
    assert np.ndarray((2, 3), order + "f4", bytes(message.data), 0, (message.step, 4)) == pytest.approx(heights, nan_ok=True)
    grid = grid_to_metadata(np.array([-0.5, 0.25]), 0.01, heights.shape)
    assert (grid.width, grid.height) == (3, 2)
    assert (grid.origin.position.x, grid.origin.position.y, grid.resolution) == (-0.5, 0.25, pytest.approx(0.01))
    turn = grid.origin.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)


def test_contacts_are_drawn_from_their_points_along_their_forces():
    random = np.random.default_rng(2)
    point, normal, force = random.normal(size=(3, 5, 3))
    contacts = ToolContacts("spade", np.zeros(3), point, normal, force, np.zeros((5, 3)), np.full(5, 1e-6), np.arange(5))
    lines, points = contacts_to_markers(contacts, 2.0, "world", 0.1, 0.004).markers
    found = np.array([[p.x, p.y, p.z] for p in lines.points]).reshape(5, 2, 3)
    assert np.array_equal(found[:, 0], point)
    assert found[:, 1] - found[:, 0] == pytest.approx(0.1 * force)
    assert len(points.points) == 5
    assert (lines.ns, lines.id != points.id, points.scale.x) == ("spade", True, 0.004)
    assert lines.scale.x == pytest.approx(0.001)  # a quarter of it


def test_large_clouds_do_not_go_byte_by_byte():
    """As they would if an array were assigned to the data field."""
    cloud = grains(100_000)
    data = np.frombuffer(grains_to_cloud(cloud, 0.0, "world").data, np.uint8)
    assert quickest(lambda: grains_to_cloud(cloud, 0.0, "world")) < 0.2 * quickest(lambda: PointCloud2(data=data), times=1)


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
    numbers = [float(values[f"{name} energy{of} [J]"]) for name, of in (("kinetic", ""), ("potential", " against start"))]
    numbers += [float(values[f"{name} [J]"]) for name in ("elastic energy", "work of tools", "dissipated")]
    assert numbers == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert [float(values[name]) for name in ("time step [s]", "largest overlap / radius", "fastest grain [m/s]")] == [
        1e-5,
        0.02,
        0.5,
    ]
    if doubts:
        assert doubts[0] in status.message
