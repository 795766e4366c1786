"""Free rigid bodies in topics: where they are, how they move, and what pushes them."""

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from node_client import ask
from std_srvs.srv import Trigger

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import arrays_to_wrench
from sand_sim import rotation
from sand_sim.node.body_ports import topic_part

MASS, INERTIA, YAW = 0.05, 2e-5, 0.4
BALL = {"spheres": [[0, 0, 0, 0.02]], "material": "sand", "mass": MASS, "inertia": [INERTIA] * 3}
AFLOAT = {
    "gravity": [0, 0, 0],
    "solver": {"precision": "double"},
    "bodies": {"ball-1": BALL | {"pose": {"position": [-0.1, -0.1, 0.2], "rpy": [0, 0, YAW]}}},
}
TOPIC = "/sand_sim/bodies/ball_1"


@pytest.fixture
def heard(client):
    messages = []
    client.node.create_subscription(Odometry, f"{TOPIC}/odometry", messages.append, 100)
    return messages


@pytest.fixture
def pushes(client):
    return client.node.create_publisher(WrenchStamped, f"{TOPIC}/push", 10)


def step(client, heard):
    """A frame on; what is told of the ball then."""
    before = len(heard)
    assert client.call(Trigger, "step").success
    client.wait_for(lambda: len(heard) > before)
    return heard[-1]


def vector(message):
    return np.array([message.x, message.y, message.z])


def connect(client, node, pushes, heard):
    client.wait_for(lambda: pushes.get_subscription_count() and node.simulation.world.observed)
    client.wait_for(lambda: client.node.count_publishers(f"{TOPIC}/odometry"))
    step(client, heard)


@pytest.mark.parametrize("frame", ["world", "ball-1"])
def test_a_body_is_pushed_in_the_axes_of_a_frame_and_tells_how_it_moves_in_its_own(client, start_node, pushes, heard, frame):
    """``v = F t / m`` in the world, ``w = T t / I`` about z; the message has velocities in the axes of its child frame."""
    node = start_node(AFLOAT, pacing="lockstep")
    connect(client, node, pushes, heard)
    pushes.publish(arrays_to_wrench([0.02, 0.0, 0.0], [0.0, 0.0, 1e-5], 0.0, frame))
    client.wait_for(lambda: np.any(node.simulation.world.assembly.solver.arrays.bodies.pushes.numpy()["force"]))
    begin = stamp_to_time(heard[-1].header.stamp)
    for _ in range(5):
        told = step(client, heard)
    passed = stamp_to_time(told.header.stamp) - begin
    assert passed == pytest.approx(0.1, abs=1e-6)
    assert (told.header.frame_id, told.child_frame_id) == ("world", "ball-1")
    turned = 0.5 * 1e-5 / INERTIA * passed**2
    of = told.pose.pose.orientation
    there = np.array([of.x, of.y, of.z, of.w])
    assert abs(there @ rotation.from_rpy(0.0, 0.0, YAW + turned)) == pytest.approx(1.0, abs=1e-6)
    along = np.array([1.0, 0.0, 0.0]) if frame == "world" else np.array([np.cos(YAW), np.sin(YAW), 0.0])
    assert rotation.rotate(there, vector(told.twist.twist.linear)) == pytest.approx(0.02 / MASS * passed * along, abs=1e-6)
    assert vector(told.twist.twist.angular) == pytest.approx([0.0, 0.0, 1e-5 / INERTIA * passed], abs=1e-5)
    place = np.array([-0.1, -0.1, 0.2]) + 0.5 * 0.02 / MASS * passed**2 * along
    assert vector(told.pose.pose.position) == pytest.approx(place, abs=1e-6)


def test_a_service_pushes_before_the_next_step_and_says_why_not(client, start_node, pushes, heard):
    """In lockstep a client that waits for the answer knows from which step on it acts."""
    node = start_node(AFLOAT, pacing="lockstep")
    connect(client, node, pushes, heard)
    assert ask(client, "push_body", body="ball-1", force=[0.0, 0.0, 0.02]) == (True, "body 'ball-1' is pushed")
    first = step(client, heard)
    assert first.twist.twist.linear.z == pytest.approx(0.02 / MASS * 0.02, rel=1e-5)
    assert ask(client, "push_body", body="ball-1") == (True, "body 'ball-1' is pushed")
    assert step(client, heard).twist.twist.linear.z == pytest.approx(first.twist.twist.linear.z, rel=1e-6)
    good, told = ask(client, "push_body", body="rock")
    assert not good
    assert "body 'rock' is unknown; known are ball-1" in told
    good, told = ask(client, "push_body", body="ball-1", force=[1.0])
    assert not good
    assert "body 'ball-1': force must be 3 numbers" in told


def test_pushes_that_make_no_sense_are_rejected_and_counted(client, start_node, pushes, heard):
    node = start_node(AFLOAT, pacing="lockstep")
    connect(client, node, pushes, heard)
    pushes.publish(arrays_to_wrench([1.0, 0.0, 0.0], [0.0] * 3, 0.0, "mars"))
    pushes.publish(arrays_to_wrench([np.nan, 0.0, 0.0], [0.0] * 3, 0.0, "world"))
    client.wait_for(lambda: sum(node.simulation.rejected.values()) == 2)
    assert node.simulation.rejected == {"unknown_frame": 1, "not_finite": 1}
    assert vector(step(client, heard).twist.twist.linear) == pytest.approx([0.0] * 3, abs=1e-12)


def test_a_body_that_has_left_is_told_no_more(client, start_node, pushes, heard):
    fields = AFLOAT | {"bodies": {"ball-1": BALL | {"pose": {"position": [-0.17, -0.1, 0.2]}, "velocity": [-2.0, 0.0, 0.0]}}}
    node = start_node(fields, pacing="lockstep")
    connect(client, node, pushes, heard)
    client.wait_for(lambda: client.call(Trigger, "step").success and not node.recorder.log.last.bodies)
    number = len(heard)
    assert node._movers[1].frame(node.recorder.log.last) is None
    for _ in range(3):
        assert client.call(Trigger, "step").success
    assert len(heard) <= number + 1
    pushes.publish(arrays_to_wrench([1.0, 0.0, 0.0], [0.0] * 3, 0.0, "world"))
    client.wait_for(lambda: node.simulation.rejected["outside"] == 1)


def test_a_body_may_be_called_as_the_world_frame(client, start_node):
    """Its frame is another one, and what is pushed in the world frame is not turned with it."""
    node = start_node(AFLOAT | {"bodies": {"world": AFLOAT["bodies"]["ball-1"]}}, pacing="lockstep")
    heard = []
    client.node.create_subscription(Odometry, "/sand_sim/bodies/world/odometry", heard.append, 100)
    pushes = client.node.create_publisher(WrenchStamped, "/sand_sim/bodies/world/push", 10)
    client.wait_for(lambda: pushes.get_subscription_count() and node.simulation.world.observed)
    client.wait_for(lambda: client.node.count_publishers("/sand_sim/bodies/world/odometry"))
    told = step(client, heard)
    assert (told.header.frame_id, told.child_frame_id) == ("world", "bodies/world")
    pushes.publish(arrays_to_wrench([0.02, 0.0, 0.0], [0.0] * 3, 0.0, "world"))
    acting = node.simulation.world.assembly.solver.arrays.bodies.pushes
    client.wait_for(lambda: np.any(acting.numpy()["force"]))
    assert acting.numpy()["force"][0] == pytest.approx([0.02, 0.0, 0.0], abs=1e-12)


def test_a_body_called_as_a_fixed_frame_gets_another_one(start_node):
    """Else the frame would have two parents."""
    node = start_node(AFLOAT | {"bodies": {"base": AFLOAT["bodies"]["ball-1"]}}, frame_names=["base"])
    assert node._movers[-1]._frame_id == "bodies/base"


def test_bodies_that_would_share_a_topic_are_refused(start_node):
    ball = AFLOAT["bodies"]["ball-1"]
    other = ball | {"pose": {"position": [0.1, 0.1, 0.2]}}
    with pytest.raises(ValueError, match="bodies 'ball-1' and 'ball_1' would share '~/bodies/ball_1'; rename one"):
        start_node(AFLOAT | {"bodies": {"ball-1": ball, "ball_1": other}})


def test_names_become_parts_of_topics():
    assert [topic_part(name) for name in ("rock", "rock-1", "2nd", "Fels größer")] == ["rock", "rock_1", "_2nd", "Fels_gr__er"]
