"""A robot description by parameter or topic: tools that are its links, poses in its fixed frames, what strangers may not."""

import os
import signal
import time

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE, START
from rclpy.qos import DurabilityPolicy, QoSProfile
from robots import joint, link, moved, origin, part, robot
from scenes import write_small_scene
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from msg_adapters.geometry_msgs import wrench_to_arrays
from msg_adapters.sensor_msgs import values_to_joints
from sand_sim import SceneError, rotation
from sand_sim.interruption import InterruptedByUserError
from sand_sim.node.node import SandSimNode

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MAST = (1.0, 0.0, 0.5), (0.0, 0.0, 0.5 * np.pi)  # turned left by a right angle
HANDLE = part('<box size="0.01 0.01 0.05"/>', place=origin((0.0, 0.0, 0.025)))
PLATE = part('<mesh filename="plate.stl" scale="1 1 1"/>')
ROBOT = robot(
    link("world"),
    link("mast"),
    link("blade", PLATE, HANDLE),
    link("arm"),
    joint("world", "mast", origin(*MAST)),
    joint("mast", "arm", kind="revolute"),
    joint("arm", "blade"),
)
TOOLS = {"tools": {"plate": {"link": "blade", "material": "steel", "particle_radius": 0.003, "max_speed": 1.0}}}
TOOLS["tools"]["plate"]["pose"] = {"position": START.tolist()}


def in_mast(position):
    """A world position in the frame of the mast, written out."""
    x, y, z = position
    return [y, 1.0 - x, z - 0.5]


BACK = rotation.from_rpy(0.0, 0.0, -0.5 * np.pi)


def press(client, node):
    """Bring the plate on to the bed by poses in the robot's frame, and tell where it is and what it has felt."""
    client.connect()
    for at, z in ((0.1, 0.06), (0.5, 0.0238), (0.6, 0.0238)):
        client.send(in_mast([0.015, 0.015, z]), at=at, frame="mast", orientation=BACK)
        client.wait_for(lambda: client.time > at - 1e-5)  # noqa: B023
    return node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]


def test_a_link_is_driven_by_poses_in_a_fixed_frame(client, start_node):
    node = start_node(TOOLS, pacing="lockstep", robot_description=ROBOT)
    report = press(client, node)
    assert report.position == pytest.approx([0.015, 0.015, 0.0238], abs=1e-9)
    assert report.orientation == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-9)
    client.wait_for(lambda: any(wrench_to_arrays(message)[0][2] > 0.5 for message in client.wrenches))
    assert client.wrenches[-1].header.frame_id == "blade" == node.parameters["tools.plate.frame"]
    low, high = node.simulation.world.assembly.tools[0].mesh.bounds
    assert low == pytest.approx([-0.03, -0.03, -0.002], abs=1e-6)
    assert high == pytest.approx([0.03, 0.03, 0.05], abs=1e-6), "mesh and handle are one"
    assert node._movers[0].follows, "robot_state_publisher tells where the link is, and TF allows one parent only"
    client.send(START, at=0.7, frame="blade")
    client.wait_for(lambda: node.simulation.rejected == {"unknown_frame": 1})
    assert "frame 'blade' does not hang on 'world'" in node.simulation.last_rejection, "it is behind a movable joint"


def test_a_topic_tells_the_robot(client, start_node):
    client.node.create_publisher(String, "/robot_description", LATCHED).publish(String(data=ROBOT))
    node = start_node(TOOLS, pacing="lockstep", robot_description_topic="robot_description")
    assert press(client, node).position == pytest.approx([0.015, 0.015, 0.0238], abs=1e-9)
    assert not [name for name in client.node.get_node_names() if name.endswith("_listener")]


LIFT = robot(
    link("world"),
    link("mast"),
    link("arm"),
    link("blade", PLATE),
    joint("world", "mast", origin(*MAST)),
    moved("mast", "arm", "prismatic", "0 0 1"),
    joint("arm", "blade", origin((0.015, 0.985, 0.0), (0.0, 0.0, -0.5 * np.pi))),
)


def test_a_link_is_driven_by_joint_states(client, start_node):
    """The mast stands at (1, 0, 0.5), turned left: the blade is at (0.015, 0.015, 0.5 + lift)."""
    node = start_node(TOOLS, pacing="lockstep", robot_description=LIFT, **{"tools.plate.source": "joint_states"})
    states = client.node.create_publisher(JointState, "/joint_states", 10)
    client.wait_for(states.get_subscription_count)
    states.publish(values_to_joints({"gripper": 0.1}, 0.05))  # another one's part
    for at, lift in ((0.1, -0.44), (0.5, -0.4762), (0.6, -0.4762)):
        states.publish(values_to_joints({"wrist": 1.0, "mast_arm": lift}, at))
        client.wait_for(lambda: client.time > at - 1e-5)  # noqa: B023
        report = node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]
        assert report.position == pytest.approx([0.015, 0.015, 0.5 + lift], abs=1e-9)
        assert abs(report.orientation[3]) == pytest.approx(1.0, abs=1e-9)
    client.wait_for(lambda: any(wrench_to_arrays(message)[0][2] > 0.5 for message in client.wrenches))
    states.publish(values_to_joints({"mast_arm": np.nan}, 0.7))
    client.wait_for(lambda: node.simulation.rejected == {"not_finite": 1})


def test_joints_that_are_told_one_by_one_with_the_same_stamp_all_count(client, start_node):
    """As two drivers with one clock do: the later message takes the place of the one before."""
    described = LIFT.replace('<joint name="arm_blade" type="fixed">', '<joint name="arm_blade" type="prismatic">')
    node = start_node(TOOLS, pacing="realtime", robot_description=described, **{"tools.plate.source": "joint_states"})
    states = client.node.create_publisher(JointState, "/joint_states", 10)
    client.wait_for(states.get_subscription_count)
    client.wait_for(lambda: client.time > 0.0)
    at = client.time + 1.0
    for joint_name, value in (("mast_arm", -0.42), ("arm_blade", 0.03)):
        states.publish(values_to_joints({joint_name: value}, at))
    states.publish(values_to_joints({"mast_arm": -0.43}, at))
    client.wait_for(lambda: client.time > at)
    report = node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]
    assert report.position == pytest.approx([0.045, 0.015, 0.07], abs=1e-6)


def test_a_root_that_is_not_the_world_is_placed_by_parameters(client, start_node):
    described = ROBOT.replace('"world"', '"base"')
    placed = {"frame_names": ["base"], "frames.base.pose": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]}
    node = start_node(TOOLS, pacing="lockstep", robot_description=described, **placed)
    client.connect()
    client.send(in_mast(START - [0.0, 0.0, 0.1]), at=0.1, frame="mast", orientation=BACK)
    client.wait_for(lambda: client.time > 0.0999)
    assert node.simulation.world.observe().tools[0].position == pytest.approx(START, abs=1e-9)


def test_a_root_that_nobody_places_is_unknown(client, start_node):
    node = start_node(TOOLS, pacing="lockstep", robot_description=ROBOT.replace('"world"', '"base"'))
    client.connect()
    client.send(in_mast(START), at=0.1, frame="mast", orientation=BACK)
    client.wait_for(lambda: node.simulation.rejected == {"unknown_frame": 1})


def test_parameters_go_before_the_robot_description(client, start_node):
    node = start_node(TOOLS, pacing="lockstep", robot_description=ROBOT, frame_names=["mast"])
    client.connect()
    client.send(START, at=0.1, frame="mast")
    client.wait_for(lambda: client.time > 0.0999)
    assert node.simulation.world.observe().tools[0].position == pytest.approx(START, abs=1e-9)


SHORT = {"robot_description_topic": "/nobody", "robot_description_timeout": 0.2}

BURIED_WORLD = robot(link("base"), link("world"), joint("base", "world"), link("blade", PLATE), joint("base", "blade"))


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        (SHORT, "parameter robot_description_topic: nothing was heard on /nobody for 0.2 s; start robot_state_publisher before"),
        (SHORT | {"robot_description": ROBOT}, "robot_description_topic: give either this one or robot_description"),
        (SHORT | {"robot_description_topic": "no topic!"}, "parameter robot_description_topic: Invalid topic name"),
        ({"robot_description": "<robot>"}, "parameter robot_description: the robot description is not valid XML"),
        ({"robot_description": "x" * 10_000_001}, "parameter robot_description: the robot description is larger than 10 MB"),
        ({"robot_description": '<!DOCTYPE r [<!ENTITY a "b">]><r/>'}, "entities are refused"),
        ({"robot_description": robot(link("base"))}, "tools.plate.link: there is no link 'blade'; known are base"),
        ({}, "tools.plate.link: no robot description is known"),
        ({"robot_description": ROBOT, "mesh_roots": ["/no/such"]}, "mesh_roots: there is no folder '/no/such'"),
        ({"robot_description": ROBOT, "mesh_roots": ["/usr"]}, "mesh 'plate.stl': there is no file /usr/plate.stl"),
        (
            {"robot_description": ROBOT.replace("plate.stl", "file:///etc/passwd")},
            "tools.plate.link: link 'blade', collision 1: mesh 'file:///etc/passwd': lies outside the folders",
        ),
        ({"robot_description": ROBOT.replace("plate.stl", "package://../../etc/passwd")}, "no ROS package '..'"),
        (
            {"robot_description": LIFT, "tools.plate.source": "joint_states", "tools.plate.frame": "tcp"},
            "tools.plate.frame: 'tcp' is no link of the robot",
        ),
        (
            {"tools.plate.source": "joint_states"},
            "tools.plate.source: 'joint_states' needs a robot; give robot_description",
        ),
        ({"robot_description": BURIED_WORLD}, "robot description: frame 'world' in 'base': needs two different names"),
    ],
)
def test_what_is_wrong_is_named(ros, start_node, parameters, named):
    with pytest.raises(ValueError) as caught:
        start_node(TOOLS, pacing="lockstep", **parameters)
    assert named in str(caught.value)


def test_the_mesh_roots_are_those_that_are_named(ros, start_node, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    write_small_scene(tmp_path / "elsewhere")
    outside = ROBOT.replace("plate.stl", f"file://{tmp_path}/elsewhere/plate.stl")
    scene = write_small_scene(tmp_path, **TOOLS)
    (tmp_path / "scenes").mkdir()
    moved = scene.rename(tmp_path / "scenes" / "small.yaml")
    (tmp_path / "bed.npz").rename(tmp_path / "scenes" / "bed.npz")
    parameters = {"scene": str(moved), "pacing": "lockstep", "robot_description": outside}
    with pytest.raises(SceneError, match="lies outside"):
        start_node(**parameters)
    assert start_node(**parameters, mesh_roots=[str(tmp_path / "elsewhere")]).configured


def test_waiting_ends_when_it_is_asked_to(ros, tmp_path):
    """The wait looks at the interruption, and takes what it has made with it."""
    stages = []

    def progress(stage, share):
        stages.append((stage, share))
        if len(stages) == 4:
            raise InterruptedByUserError

    overrides = {"scene": str(write_small_scene(tmp_path, **TOOLS)), "robot_description_topic": "/nobody"}
    node = SandSimNode(
        progress, parameter_overrides=[rclpy.parameter.Parameter(name, value=value) for name, value in overrides.items()]
    )
    begin = time.monotonic()
    with pytest.raises(InterruptedByUserError):
        node.start()
    assert time.monotonic() - begin < 2.0
    assert {stage for stage, _ in stages} == {"waiting for the robot description"}
    assert [share for _, share in stages] == sorted(share for _, share in stages)
    assert not node.configured
    node.destroy_node()


def test_ctrl_c_ends_a_process_that_waits(start_process, tmp_path):
    write_small_scene(tmp_path, **TOOLS)
    process = start_process(scene="small.yaml", robot_description_topic="/nobody", robot_description_timeout=1000.0)
    while "waiting up to 1000 s for the robot description on /nobody" not in process.stderr.readline():
        assert process.poll() is None
    begin = time.monotonic()
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert time.monotonic() - begin < 5.0
    assert "Traceback" not in errors


def test_ctrl_c_is_told_where_a_client_has_asked_for_the_start(client, start_process, tmp_path):
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    write_small_scene(tmp_path, **TOOLS)
    process = start_process(
        scene="small.yaml", autostart=False, robot_description_topic="/nobody", robot_description_timeout=1000.0
    )
    caller = client.node.create_client(ChangeState, "/sand_sim/change_state")
    client.wait_for(caller.service_is_ready)
    caller.call_async(ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE)))
    client.wait_for(lambda: "sand_sim_listener" in client.node.get_node_names())
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert "cannot be configured: interrupted by the user" in errors


def test_configuring_later_waits_in_the_lifecycle_service(client, start_node):
    """The node's own executor is inside the transition while the description is heard."""
    node = start_node(TOOLS, pacing="lockstep", autostart=False, robot_description_topic="/late/robot_description")
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    caller = client.node.create_client(ChangeState, "/sand_sim/change_state")
    client.wait_for(caller.service_is_ready)
    future = caller.call_async(request)
    client.wait_for(lambda: "sand_sim_listener" in client.node.get_node_names())
    late = client.node.create_publisher(String, "/late/robot_description", LATCHED)
    late.publish(String(data=ROBOT))
    client.wait_for(future.done)
    assert future.result().success
    assert node.configured
