"""Partners that do not fit are told how to mend it: quality of service, types, sources, clocks; start-up arguments, too."""

import os
import re
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
import yaml

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from geometry_msgs.msg import Pose, PoseStamped, TwistStamped, WrenchStamped
from node_client import PATIENCE
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from scenes import write_small_scene

from sand_sim.node.node import SandSimNode
from sand_sim.node.services import Services

TOOL = "/sand_sim/tools/plate"
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOSSY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.fixture
def stranger():
    """A node of a process of its own, as far as the middleware sees; in one process a topic has one type."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("stranger", context=context)
    yield node
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def test_partners_that_do_not_fit_are_told_how_to_mend_it(client, stranger, start_node):
    heard = []
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    start_node(pacing="lockstep")
    client.node.create_publisher(PoseStamped, f"{TOOL}/pose", LOSSY)
    client.node.create_subscription(WrenchStamped, f"{TOOL}/wrench", lambda message: None, LATCHED)
    stranger.create_publisher(Pose, f"{TOOL}/pose", 1)
    stranger.create_publisher(TwistStamped, f"{TOOL}/twist", 1)
    stranger.create_publisher(Clock, "/clock", 1)
    for told in (
        f"a publisher offers best_effort and is not heard; let it offer reliable, or start with -p qos_overrides.{TOOL}/pose."
        "subscription.reliability:=best_effort",
        f"a subscriber asks for transient_local and hears nothing; let it ask for volatile, or start with -p qos_overrides.{TOOL}"
        "/wrench.publisher.durability:=transient_local",
        f"{TOOL}/pose: 'stranger' publishes geometry_msgs/msg/Pose and is not heard; geometry_msgs/msg/PoseStamped is needed",
        f"{TOOL}/twist: 'stranger' publishes geometry_msgs/msg/TwistStamped and is not heard; the tool follows tools.plate",
        "/clock: 'stranger' publishes rosgraph_msgs/msg/Clock too; leave it out there",
    ):
        client.wait_for(lambda: any(told in message for message in heard))  # noqa: B023
    assert not any("'test_client' publishes" in message for message in heard)


@pytest.mark.parametrize("namespace", ["/", "/elsewhere"])
def test_a_forgotten_node_of_the_same_name(client, start_node, namespace):
    """Its publishers look like our own, but for their number."""
    heard, context = [], rclpy.Context()
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    start_node(pacing="lockstep")
    client.wait_for(lambda: len(client.diagnostics) > 2)
    assert not any("publishes rosgraph_msgs/msg/Clock" in message for message in heard)
    rclpy.init(context=context)
    forgotten = rclpy.create_node("sand_sim", namespace=namespace, context=context)
    try:
        forgotten.create_publisher(Clock, "/clock", 1)
        told = "/clock: 'sand_sim' publishes rosgraph_msgs/msg/Clock " + (
            "twice: there is another node of this name; end one of them, or start it with -r __node:=second"
            if namespace == "/"
            else "too; leave it out there"
        )
        client.wait_for(lambda: any(told in message for message in heard))
    finally:
        forgotten.destroy_node()
        rclpy.try_shutdown(context=context)


def test_two_nodes_that_drive_one_tool_are_told(client, stranger, start_node):
    heard = []
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    start_node(pacing="lockstep")
    client.node.create_publisher(PoseStamped, f"{TOOL}/pose", 1)
    client.wait_for(lambda: len(client.diagnostics) > 2)
    assert not any("as another node does" in message for message in heard), "two publishers of one node"
    stranger.create_publisher(PoseStamped, f"{TOOL}/pose", 1)
    client.wait_for(lambda: any("publishes geometry_msgs/msg/PoseStamped as another node does" in line for line in heard))


def test_the_advice_on_quality_of_service_helps(client, start_node):
    node = start_node(pacing="lockstep", **{f"qos_overrides.{TOOL}/pose.subscription.reliability": "best_effort"})
    lossy = client.node.create_publisher(PoseStamped, f"{TOOL}/pose", LOSSY)
    client.wait_for(lossy.get_subscription_count)
    message = PoseStamped()
    message.header.frame_id = "moon"
    lossy.publish(message)
    client.wait_for(lambda: node.simulation.rejected == {"unknown_frame": 1})


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["-p", "points_rate:=10"], "parameter points_rate: must be a double, such as 10.0"),
        (["-p", "threads:=2.0"], "parameter threads: must be an integer; "),
        (["-p", "points_fields:=[x, y, z]"], "arguments after --ros-args: failed to initialize rcl: Couldn't parse parameter"),
        (
            ["-p", "qos_overrides./clock.publisher.reliability:=sloppy"],
            "parameters qos_overrides./clock: Unexpected QoS",
        ),
        (["--nonsense"], "arguments after --ros-args: ['--nonsense']"),
    ],
)
def test_bad_arguments_end_the_start_with_one_line_of_ours(tmp_path, arguments, named):
    scene = write_small_scene(tmp_path)
    command = [sys.executable, "-m", "sand_sim.node", "--ros-args", "-p", f"scene:={scene}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 1
    assert [line for line in done.stderr.splitlines() if line.startswith("sand_sim: ") and named in line], done.stderr
    assert "Traceback" not in done.stderr


def test_a_log_without_a_place_is_no_fault_of_the_arguments():
    """Services of the system are started without a HOME."""
    bare = {name: value for name, value in os.environ.items() if name not in ("HOME", "ROS_HOME", "ROS_LOG_DIR")}
    command = [sys.executable, "-m", "sand_sim.node"]
    done = subprocess.run(command, env=bare, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 1
    assert re.search(r"^sand_sim: ROS cannot start: .* logging directory.*; set HOME or ROS_LOG_DIR$", done.stderr, re.MULTILINE)


def test_dumped_parameters_can_be_read_again(ros, start_node, tmp_path):
    """As ``ros2 param dump`` writes them."""
    node, tree = start_node(pacing="lockstep"), {}
    for name in node.parameters:
        *path, last = name.split(".")
        branch = tree
        for part in path:
            branch = branch.setdefault(part, {})
        branch[last] = node.get_parameter(name).value
    file = tmp_path / "dump.yaml"
    file.write_text(yaml.safe_dump({"/again": {"ros__parameters": tree | {"autostart": False}}}))
    again = SandSimNode(cli_args=["--ros-args", "-r", "__node:=again", "--params-file", str(file)])
    try:
        assert dict(again.parameters) == {name: node.parameters[name] for name in again.parameters} | {"autostart": False}
    finally:
        again.destroy_node()


def test_an_answer_does_not_wait_for_the_executor_to_wake(ros):
    """Else each step by service takes as long as the executor's longest nap."""
    executor, asked = SingleThreadedExecutor(), Future()
    services = SimpleNamespace(_node=SimpleNamespace(refusal="", executor=executor), _unanswered=set())
    task = executor.create_task(Services.outcome(services, lambda: asked))
    executor.spin_once(timeout_sec=0.0)
    threading.Timer(0.2, lambda: asked.set_result("done")).start()
    begin = time.monotonic()
    while not task.done():
        executor.spin_once(timeout_sec=PATIENCE)
    assert task.result() == (True, "done")
    assert time.monotonic() - begin < 0.5 * PATIENCE
    executor.shutdown()
