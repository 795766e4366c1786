"""The node with real publishers, subscribers and services, in this process and in another."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")  # one after the other, so that each knows what it has left behind

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from scenes import write_small_scene
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool, Trigger

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_pose, wrench_to_arrays
from msg_adapters.sensor_msgs import cloud_to_points
from sand_sim import ToolPose, load_scene
from sand_sim.node.node import SandSimNode
from sand_sim.playing import commands_at, frame_times

START = np.array([0.015, 0.015, 0.06])
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
PATIENCE = 60.0


class Client:
    """An independent ROS node that drives the plate and hears everything."""

    def __init__(self):
        self.node = rclpy.create_node("test_client")
        self.clocks, self.wrenches, self.clouds, self.diagnostics = [], [], [], []
        for kind, topic, heard in (
            (Clock, "/clock", self.clocks),
            (WrenchStamped, "/sand_sim/tools/plate/wrench", self.wrenches),
            (PointCloud2, "/sand_sim/points", self.clouds),
            (DiagnosticArray, "/diagnostics", self.diagnostics),
        ):
            self.node.create_subscription(kind, topic, heard.append, 100)
        self.poses = self.node.create_publisher(PoseStamped, "/sand_sim/tools/plate/pose", 100)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def wait_for(self, condition, patience=PATIENCE):
        end = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < end, "nothing came of it"
            self.executor.spin_once(timeout_sec=0.02)

    def connect(self):
        """Wait until the node hears us and we hear the node."""
        self.wait_for(lambda: self.poses.get_subscription_count() and self.node.count_publishers("/sand_sim/points"))

    def send(self, position, at=None, frame="world", orientation=NO_TURN):
        self.poses.publish(command_to_pose(ToolPose("plate", np.asarray(position, float), orientation, at), frame))

    def call(self, kind, name, request=None):
        client = self.node.create_client(kind, f"/sand_sim/{name}")
        self.wait_for(client.service_is_ready)
        future = client.call_async(request or kind.Request())
        self.wait_for(future.done)
        return future.result()

    @property
    def time(self):
        return stamp_to_time(self.clocks[-1].clock) if self.clocks else -1.0

    def diagnosed(self, key):
        values = {entry.key: entry.value for entry in self.diagnostics[-1].status[0].values} if self.diagnostics else {}
        return values.get(key)

    def close(self):
        self.node.destroy_node()


@pytest.fixture
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def client(ros):
    client = Client()
    yield client
    client.close()


@pytest.fixture
def start_node(ros, tmp_path):
    """``start_node(pacing=..., ...)`` runs a node on the small scene in a thread of this process."""
    running = []

    def start(scene_fields=None, **parameters):
        scene = write_small_scene(tmp_path, **(scene_fields or {}))
        overrides = [Parameter(name, value=value) for name, value in ({"scene": str(scene)} | parameters).items()]
        node = SandSimNode(parameter_overrides=overrides)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        ending = threading.Event()

        def spin():
            while not ending.is_set():
                executor.spin_once(timeout_sec=0.05)

        thread = threading.Thread(target=spin)
        thread.start()
        running.append((node, ending, thread))
        return node

    yield start
    for node, ending, thread in running:
        ending.set()
        thread.join()
        node.close()
        node.destroy_node()


@pytest.fixture
def start_process(tmp_path):
    """``start_process(pacing=..., ...)`` runs the node in another process."""
    running = []

    def start(**parameters):
        assignments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        command = [sys.executable, "-m", "sand_sim.node", "--ros-args", *assignments]
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        running.append(process)
        return process

    yield start
    for process in running:
        if process.poll() is None:
            process.kill()
        process.communicate()


def drive(client, scene):
    """Send the whole trajectory of the scene, stamped, frame by frame; what comes back is kept for five frames only."""
    for at in frame_times(scene):
        for command in commands_at(scene, at):
            client.poses.publish(command_to_pose(command, "world"))
        client.wait_for(lambda: client.time > at - 1e-6)  # noqa: B023
        client.wait_for(lambda: client.wrenches and stamp_to_time(client.wrenches[-1].header.stamp) > at - 1e-6)  # noqa: B023


def test_poses_in_wrench_and_cloud_out(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    scene = node.simulation.world.scene
    drive(client, scene)
    stamps = [stamp_to_time(message.header.stamp) for message in client.wrenches]
    assert stamps[-20:] == pytest.approx(list(frame_times(scene)), abs=1e-6), "one wrench a frame"
    forces = np.array([wrench_to_arrays(message)[0] for message in client.wrenches])
    assert forces[:, 2].max() > 0.5, "pressing on the bed pushes the plate up"
    assert np.all(forces[-1] == 0.0), "zeros without contact"
    assert client.wrenches[-1].header.frame_id == "plate"
    points = cloud_to_points(client.clouds[-1])
    assert len(points) == 32
    assert client.clouds[-1].header.frame_id == "world"
    assert set(points["id"]) == set(range(32))
    assert node.simulation.rejected == {}


def test_same_run_in_another_process_gives_the_same_wrenches(client, start_process, start_node, tmp_path):
    node = start_node(pacing="lockstep", points_rate=0.0)
    client.connect()
    drive(client, node.simulation.world.scene)
    here = [wrench_to_arrays(message)[0] for message in client.wrenches][-20:]
    node.simulation.stop()
    node.destroy_node()

    other = Client()
    process = start_process(scene=tmp_path / "small.yaml", pacing="lockstep", output=tmp_path / "out", duration=0.4)
    try:
        other.connect()
        drive(other, load_scene(tmp_path / "small.yaml"))
    finally:
        other.close()
    there = [wrench_to_arrays(message)[0] for message in other.wrenches][-20:]
    assert np.array_equal(here, there)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    assert (tmp_path / "out" / "small.json").is_file()
    assert (tmp_path / "out" / "small.npz").is_file()
    assert (tmp_path / "out" / "small.png").is_file()


def test_step_reset_and_pause_services(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    answer = client.call(Trigger, "step")
    assert answer.success
    assert answer.message == "t = 0.020000 s"
    client.send(START - [0.0, 0.0, 0.02], at=0.1)
    client.wait_for(lambda: client.time > 0.099)
    assert client.call(Trigger, "reset").success
    client.wait_for(lambda: client.time == 0.0)
    assert node.simulation.world.time == 0.0
    assert client.call(SetBool, "pause", SetBool.Request(data=True)).message == "paused"
    client.send(START, at=0.1)
    assert client.call(Trigger, "step").message == "t = 0.020000 s"
    assert client.call(SetBool, "pause", SetBool.Request(data=False)).message == "running"
    client.wait_for(lambda: client.time > 0.099)


def test_bad_poses_are_rejected_counted_and_the_node_goes_on(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    client.send(START, at=0.02, frame="moon")
    client.send(START, at=0.02, frame="")
    client.send([np.nan, 0.0, 0.0], at=0.02)
    client.send(START, at=0.02, orientation=np.zeros(4))
    client.send(START)
    client.send(START, at=0.02)
    client.wait_for(lambda: client.time > 0.019)
    assert node.simulation.rejected == {"unknown_frame": 2, "not_finite": 1, "zero_quaternion": 1, "no_stamp": 1}
    client.wait_for(lambda: client.diagnosed("commands rejected") == "5")
    assert client.diagnosed("commands rejected: unknown_frame") == "2"
    assert "header.frame_id" in client.diagnosed("last rejection") or "stamp" in client.diagnosed("last rejection")


def test_cloud_rate_and_decimation(client, start_node):
    start_node(pacing="lockstep", points_rate=10.0, points_decimation=4)
    client.connect()
    before = len(client.clouds)
    client.send(START, at=1.0)
    client.wait_for(lambda: client.time > 0.999)
    client.wait_for(lambda: stamp_to_time(client.clouds[-1].header.stamp) > 0.99)
    clouds = client.clouds[before:]
    assert 9 <= len(clouds) <= 11
    assert sorted(cloud_to_points(clouds[-1])["id"]) == list(range(0, 32, 4))


def test_streaming_in_real_time(client, start_node, tmp_path):
    """At half speed never ahead of the wall clock, and beside it in at least one of ten windows, however busy the machine is."""
    soft = {
        "sand": {"density": 2600.0, "young": 1e5, "poisson": 0.25},
        "steel": {"density": 7800.0, "young": 1e6, "poisson": 0.3},
    }
    (tmp_path / "soft").mkdir()
    scene = write_small_scene(tmp_path / "soft", materials=soft)
    factor = 0.5
    node = start_node(scene=str(scene), pacing="realtime", real_time_factor=factor, threads=1)
    client.connect()
    client.wait_for(lambda: client.time > 0.05)
    world = node.simulation.world
    start, begin, rates = time.monotonic(), world.time, []
    while not rates or (len(rates) < 10 and abs(rates[-1] / factor - 1.0) > 0.2):
        opened, first = time.monotonic(), world.time
        for k in range(40):
            client.send(START - [0.0, 0.0, 0.0005 * k])
            end = time.monotonic() + 0.02
            while time.monotonic() < end:
                client.executor.spin_once(timeout_sec=0.002)
            simulated = world.time - begin
            # Arrears of 0.2 s are caught up with, and a frame of 0.02 s is done at once.
            assert simulated < factor * (time.monotonic() - start + 0.2) + 0.021
        rates.append((world.time - first) / (time.monotonic() - opened))
    assert rates[-1] / factor == pytest.approx(1.0, abs=0.2), f"simulated over wall seconds: {rates}"
    heard = len(client.wrenches)
    client.wait_for(lambda: len(client.wrenches) > heard + 10)


def test_parameters_are_described_and_ranged(ros, start_node):
    node = start_node(pacing="lockstep")
    for name in ("scene", "pacing", "points_rate", "real_time_factor", "threads"):
        descriptor = node.describe_parameter(name)
        assert len(descriptor.description) > 10
    assert node.describe_parameter("points_rate").floating_point_range[0].to_value == 1000.0
    result = node.set_parameters([Parameter("points_rate", value=-1.0)])[0]
    assert not result.successful
    result = node.set_parameters([Parameter("points_rate", value=5.0)])[0]
    assert result.successful
    assert not node.set_parameters([Parameter("pacing", value="fast")])[0].successful


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"scene": "no_such_scene"}, "scene 'no_such_scene': there is no such file"),
        ({"scene": "broken.yaml"}, "materials.sand.density: must be greater than 0 [kg/m^3], got -1"),
        ({"scene": "no_mesh.yaml"}, "tools.plate.mesh: mesh 'missing.stl': there is no file"),
        ({"scene": "empty_mesh.yaml"}, "tools.plate.mesh: mesh empty.stl"),
        ({"scene": "small.yaml", "pacing": "slow"}, "parameter pacing: unknown 'slow'; known are realtime, fast, lockstep"),
        ({"scene": "small.yaml", "points_rate": -5.0}, "points_rate"),
    ],
)
def test_bad_start_ends_with_one_line_and_code_1(start_process, tmp_path, parameters, named):
    good = write_small_scene(tmp_path).read_text()
    (tmp_path / "broken.yaml").write_text(good.replace("density: 2600.0", "density: -1"))
    (tmp_path / "no_mesh.yaml").write_text(good.replace("plate.stl", "missing.stl"))
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "empty_mesh.yaml").write_text(good.replace("plate.stl", "empty.stl"))
    process = start_process(**parameters)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert named in errors
    assert len(errors.strip().splitlines()) == 1, errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("delay", [0.3, 1.5, 4.0])
def test_signals_end_the_node_cleanly(start_process, tmp_path, number, delay):
    write_small_scene(tmp_path)
    process = start_process(scene="small.yaml", pacing="fast", recording="out/small.rrd")
    time.sleep(delay)
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors


def shared_memory(process):
    """Names of the middleware's shared-memory files that a process uses."""
    try:
        paths = [line.split()[-1] for line in Path(f"/proc/{process}/maps").read_text().splitlines()]
    except OSError:  # it has ended
        return set()
    return {Path(path).name for path in paths if path.startswith("/dev/shm/") and "fastrtps" in path}


@pytest.mark.skipif(not Path("/proc/self/maps").is_file(), reason="needs /proc")
@pytest.mark.parametrize("ready", [True, False])
def test_nothing_is_left_behind(start_process, tmp_path, ready):
    """No shared memory of ours remains, whether a node ends when it is ready or while it gets ready."""
    write_small_scene(tmp_path, **({} if ready else {"settle": {"time": 1000.0, "speed": 1e-9}}))
    before = set(os.listdir("/dev/shm"))
    process = start_process(scene="small.yaml", pacing="lockstep")
    if ready:
        while "is ready" not in process.stderr.readline():
            assert process.poll() is None
    else:
        end = time.monotonic() + PATIENCE
        while not shared_memory(process.pid):
            assert time.monotonic() < end
            time.sleep(0.01)
    ours = shared_memory(process.pid) - before
    assert ours, "else there is nothing to clean up"
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    others = set().union(*(shared_memory(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()))
    assert (ours - others) & set(os.listdir("/dev/shm")) == set(), "some files serve all processes of a machine"


FORCED = {"time_step": 9e-4, "force_time_step": True}  # blows up when the grains have fallen on to the floor
LOW_FLOOR = [{"name": "floor", "type": "plane", "material": "steel", "point": [0, 0, -0.02], "normal": [0, 0, 1]}]


def test_a_run_that_blows_up_stops_and_comes_back(client, start_node):
    node = start_node({"solver": FORCED, "boundaries": LOW_FLOOR}, pacing="lockstep")
    client.connect()
    for at in frame_times(node.simulation.world.scene):
        for command in commands_at(node.simulation.world.scene, at):
            client.poses.publish(command_to_pose(command, "world"))
    client.wait_for(lambda: client.diagnostics and client.diagnostics[-1].status[0].level == DiagnosticStatus.ERROR)
    message = client.diagnostics[-1].status[0].message
    assert message.startswith("stepping has stopped: blown up at t = ")
    assert "s would be safe" in message
    stopped = node.simulation.world.time
    assert 0.0 < stopped < 0.4

    late = Client()  # comes after the fault, and still sees the last good state
    late.wait_for(lambda: late.clouds and late.wrenches and late.clocks)
    assert stamp_to_time(late.clouds[-1].header.stamp) == pytest.approx(stopped, abs=1e-6)
    assert np.all(np.isfinite(cloud_to_points(late.clouds[-1])["x"]))
    assert late.time == pytest.approx(stopped, abs=1e-6)
    late.close()

    client.send(START, at=stopped + 0.1)
    answer = client.call(Trigger, "step")
    assert not answer.success
    assert "blown up" in answer.message
    assert client.call(SetBool, "pause", SetBool.Request(data=False)).success
    assert node.simulation.rejected["stopped"] == 1
    assert client.call(Trigger, "reset").success
    client.wait_for(lambda: client.time == 0.0)
    assert client.call(Trigger, "step").message.startswith("t = 0.0")
    client.wait_for(lambda: client.diagnostics[-1].status[0].level == DiagnosticStatus.WARN)


def test_the_node_can_end_when_a_run_blows_up(start_process, tmp_path):
    write_small_scene(tmp_path, solver={"time_step": 9e-4, "force_time_step": True})
    process = start_process(scene="small.yaml", pacing="fast", end_on_fault=True, output=tmp_path / "out")
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "stepping has stopped: blown up at t = " in errors
    assert "Traceback" not in errors
    assert (tmp_path / "out" / "small.json").is_file()
