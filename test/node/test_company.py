"""A node among others: readers that are slow, vanish or come late, a second node, many starts in a row."""

import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE, START, Client
from processes import kill, shared_memory
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from scenes import write_small_scene
from sensor_msgs.msg import PointCloud2

from sand_sim.node.node import SandSimNode

READER = """
import sys, time, rclpy
from sensor_msgs.msg import PointCloud2
rclpy.init()
node = rclpy.create_node("reader")
heard = []
node.create_subscription(PointCloud2, "/sand_sim/points", heard.append, 5)
while not heard:
    rclpy.spin_once(node, timeout_sec=0.1)
print("heard", flush=True)
while sys.argv[1] == "reading":
    rclpy.spin_once(node, timeout_sec=0.1)
time.sleep(1000)
"""


@pytest.mark.parametrize("what", ["reading", "asleep"])
def test_readers_that_sleep_or_are_killed_do_not_hold_it_up(client, start_node, what):
    node = start_node(pacing="fast", points_rate=1000.0)
    client.connect()
    reader = subprocess.Popen([sys.executable, "-c", READER, what], stdout=subprocess.PIPE, text=True)
    try:
        assert reader.stdout.readline() == "heard\n"
        before, heard = node.simulation.world.time, len(client.clouds)
        client.wait_for(lambda: node.simulation.world.time > before + 0.5)
        client.wait_for(lambda: len(client.clouds) > heard + 5)
    finally:
        kill(reader)
    before, heard = node.simulation.world.time, len(client.clouds)
    client.wait_for(lambda: node.simulation.world.time > before + 0.5)
    client.wait_for(lambda: len(client.clouds) > heard + 5)
    assert node.simulation.fault is None


def test_a_reader_that_comes_late_hears_all_that_follows(client, start_node):
    start_node(pacing="lockstep", points_rate=50.0)
    client.connect()
    client.send(START, at=1.0)
    client.wait_for(lambda: client.time > 0.999)
    late = Client()
    try:
        late.wait_for(lambda: late.node.count_publishers("/sand_sim/points") and late.poses.get_subscription_count())
        late.send(START, at=1.2)
        late.wait_for(lambda: late.time > 1.199)
        late.wait_for(lambda: late.clouds and late.clouds[-1].width == 32)
    finally:
        late.close()


def test_two_nodes_under_two_names(client, start_node, tmp_path):
    start_node(pacing="lockstep")
    (tmp_path / "second").mkdir()
    scene = write_small_scene(tmp_path / "second")
    overrides = {"scene": str(scene), "pacing": "fast", "publish_clock": False}
    parameters = [Parameter(name, value=value) for name, value in overrides.items()]
    second = SandSimNode(parameter_overrides=parameters, cli_args=["--ros-args", "-r", "__node:=second"])
    try:
        second.start()
        client.connect()
        heard = []
        client.node.create_subscription(PointCloud2, "/second/points", heard.append, 5)
        client.wait_for(lambda: len(heard) > 2)
        assert client.time <= 0.0, "the first one waits, and the second one does not speak for it"
        assert client.node.count_publishers("/clock") == 1
        client.send(START, at=0.1)
        client.wait_for(lambda: client.time == pytest.approx(0.1, abs=1e-4))
    finally:
        second.destroy_node()


def test_nodes_of_two_namespaces_are_told_apart_on_diagnostics(client, start_node, tmp_path):
    start_node(pacing="lockstep")
    (tmp_path / "second").mkdir()
    overrides = {"scene": str(write_small_scene(tmp_path / "second")), "pacing": "lockstep", "publish_clock": False}
    parameters = [Parameter(name, value=value) for name, value in overrides.items()]
    second = SandSimNode(parameter_overrides=parameters, cli_args=["--ros-args", "-r", "__ns:=/robot"])
    executor = SingleThreadedExecutor()
    executor.add_node(second)
    try:
        second.start()

        def names():
            executor.spin_once(timeout_sec=0.0)
            return {message.status[0].name for message in client.diagnostics}

        client.wait_for(lambda: names() == {"sand_sim: world", "robot/sand_sim: world"})
    finally:
        executor.shutdown()
        second.destroy_node()


@pytest.mark.slow
def test_twenty_starts_in_a_row(start_process, tmp_path):
    write_small_scene(tmp_path)
    for number in range(20):
        process = start_process(scene="small.yaml", pacing="fast")
        while "is ready" not in process.stderr.readline():
            assert process.poll() is None
        own = shared_memory(process)
        assert own
        time.sleep(0.05 * number)
        process.send_signal(signal.SIGINT if number % 2 else signal.SIGTERM)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, errors
        assert "Traceback" not in errors
        assert not [segment for segment in own if segment.exists()], "shared memory is left"
