"""Tools that follow TF, and tools whose frames are told to it, with messages generated from their one field."""

import shutil

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from geometry_msgs.msg import PoseStamped
from node_client import NO_TURN, START
from rclpy.qos import DurabilityPolicy, QoSProfile
from scenes import write_small_scene

from msg_adapters.geometry_msgs import frame_to_transform
from sand_sim.border import Frame

pytestmark = [
    pytest.mark.slow,
    pytest.mark.xdist_group("processes"),
    pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("g++")), reason="needs a compiler"),
]


@pytest.fixture(scope="module")
def tf_message(build_messages):
    """The message type, importable here and in nodes."""
    build_messages("tf2_msgs")
    from tf2_msgs.msg import TFMessage

    return TFMessage


def test_a_tool_follows_its_frame(client, start_process, tf_message, tmp_path):
    write_small_scene(tmp_path)
    start_process(scene="small.yaml", pacing="lockstep", **{"tools.plate.source": "tf", "tools.plate.frame": "tcp"})
    poses = []
    client.node.create_subscription(PoseStamped, "/sand_sim/tools/plate/pose_actual", poses.append, 100)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    fixed = client.node.create_publisher(tf_message, "/tf_static", latched)
    moving = client.node.create_publisher(tf_message, "/tf", 10)
    client.wait_for(lambda: fixed.get_subscription_count() and moving.get_subscription_count())
    client.wait_for(lambda: client.node.count_publishers("/sand_sim/tools/plate/pose_actual"))
    fixed.publish(tf_message(transforms=[frame_to_transform(Frame("arm", "world", np.array([0.0, 0.0, 0.05]), NO_TURN))]))
    for k in range(1, 11):
        at, place = 0.02 * k, START - [0.0, 0.0, 0.05 + 0.001 * k]
        moving.publish(tf_message(transforms=[frame_to_transform(Frame("tcp", "arm", place, NO_TURN, at))]))
    client.wait_for(lambda: client.time > 0.1999 and poses and poses[-1].header.stamp.nanosec > 199_000_000)
    assert poses[-1].pose.position.z == pytest.approx(START[2] - 0.01, abs=1e-5)


def test_frames_of_tools_are_told(client, start_process, tf_message, tmp_path):
    write_small_scene(tmp_path)
    start_process(scene="small.yaml", pacing="lockstep")
    heard = []
    client.node.create_subscription(tf_message, "/tf", heard.append, 100)
    client.connect()
    client.wait_for(lambda: client.node.count_publishers("/tf"))
    client.send(START - [0.0, 0.0, 0.01], at=0.1)
    client.wait_for(lambda: heard and heard[-1].transforms[0].header.stamp.nanosec > 99_000_000)
    (told,) = heard[-1].transforms
    assert (told.header.frame_id, told.child_frame_id) == ("world", "plate")
    assert told.transform.translation.z == pytest.approx(START[2] - 0.01, abs=1e-9)


def test_whoever_comes_late_is_told_the_frames_once_though_nothing_moves(client, start_process, tf_message, tmp_path):
    write_small_scene(tmp_path)
    start_process(scene="small.yaml", pacing="lockstep")
    client.connect()
    client.wait_for(lambda: client.node.count_publishers("/tf") and len(client.diagnostics) > 1)
    heard = []
    client.node.create_subscription(tf_message, "/tf", heard.append, 100)
    client.wait_for(lambda: heard)
    assert heard[0].transforms[0].transform.translation.z == pytest.approx(START[2])
    seen = len(client.diagnostics)
    client.wait_for(lambda: len(client.diagnostics) > seen + 3)
    assert len(heard) == 1, "TF complains of what it has heard already"
