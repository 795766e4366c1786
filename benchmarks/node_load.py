"""What the node adds to the time of the steps, and how long a pose takes to become a wrench. Needs ROS 2.

Load: a bed of 104,000 grains under a node that runs as fast as it can, with poses of a tool coming in at 1 kHz, beside a bare
world of the same scene in this process; they take turns, and the node is paused meanwhile. Latency: a few grains, one frame at a
time in lockstep, from publishing a stamped pose until the wrench of that time has come back.

``added_share`` is by the wall clock and holds what other processes, this client among them, take from the cores;
``added_processor_share`` is the processor time of the threads that step and publish, per step, over that of the bare world.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.beds import RADIUS, bed_scene, blade_tool
from benchmarks.processes import use_own_domain
from benchmarks.provenance import provenance
from benchmarks.scaling import repeated_scene
from benchmarks.speed import Setup, spread
from sand_sim import SceneError, ToolPose, World, read_scene

TILES = (13, 1)  # 104,000 grains
FRAME_RATE = 1000.0  # [1/s] simulated; commands are taken in once a frame
POSE_RATE = 1000.0  # [1/s] wall
WINDOW = 5.0  # [s] wall, of the node and of the bare world in turn
CLOUD_RATES = {"clouds at 30 Hz": 30.0, "a cloud every frame": FRAME_RATE, "no clouds": 0.0}  # per simulated second
PINGS, PINGS_BEFORE = 1000, 50
HIGH = np.array([0.0, 0.0, 0.1])  # of the blade, clear of the bed [m]
SWING = np.array([0.0, 0.0, 0.002])  # [m]
PATIENCE = 60.0  # [s]


def time_node(setup: Setup, tiles: tuple[int, int] = TILES, pings: int = PINGS) -> Iterator[dict]:
    """Rows for the load at each number of cores, and for the latency."""
    try:
        import rclpy
    except ModuleNotFoundError as error:
        raise SceneError(f"bench: the case 'node' needs ROS 2, and {error.name} cannot be imported") from None
    from rclpy.signals import SignalHandlerOptions

    use_own_domain()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        for threads in setup.threads:
            yield from _time_load(setup, tiles, threads)
        yield _time_latency(setup, pings)
    finally:
        rclpy.try_shutdown()


def _time_load(setup: Setup, tiles: tuple[int, int], threads: int) -> Iterator[dict]:
    folder = setup.folder.resolve()
    fields = {"frame_rate": FRAME_RATE, "solver": {"threads": threads}}
    parsed = repeated_scene("tile_8000", tiles, setup, **fields) | {"tools": _blade(folder)}
    world = World(read_scene(parsed, folder), setup.progress)
    with _running_node(parsed, folder, "fast", setup) as client:
        bare, node = [], {name: [] for name in CLOUD_RATES}
        for done in range(setup.rounds + 1):
            setup.progress(f"node on {threads} threads", done / (setup.rounds + 1))
            client.pause(True)
            bare.append(_bare_rate(world, setup))
            client.pause(False)
            for name, rate in CLOUD_RATES.items():
                client.set_points_rate(rate)
                node[name].append(client.rate(WINDOW, HIGH))
        setup.progress(f"node on {threads} threads", 1.0)
    health = world.observe().health
    row = {"benchmark": "node", "threads": threads, "grains": len(world.assembly.table), "poses_per_second": POSE_RATE}
    alone = np.array(bare[1:])
    row |= {"frame_steps": world.frame_steps, "bare_steps_per_second": spread(alone[:, 0] / world.time_step)}
    for name, rates in node.items():
        added = alone / np.array(rates[1:]) - 1.0
        mine = {"case": name, "steps_per_second": spread(np.array(rates[1:])[:, 0] / world.time_step)}
        mine |= {"added_share": spread(added[:, 0]), "added_processor_share": spread(added[:, 1])}
        yield row | mine | ({"failed": "; ".join(health.doubts)} if health.doubts else {}) | provenance(threads)


def _bare_rate(world: World, setup: Setup) -> tuple[float, float]:
    """Simulated seconds of a world by itself over wall and over processor seconds, frame by frame."""
    begin, spent, first = time.perf_counter(), time.process_time(), world.time
    while time.perf_counter() - begin < WINDOW:
        world.step(world.frame_steps)
        setup.progress("bare world", 0.0)
    passed = world.time - first
    return passed / (time.perf_counter() - begin), passed / (time.process_time() - spent)


def _time_latency(setup: Setup, pings: int) -> dict:
    folder = setup.folder.resolve()
    corners = np.stack(np.meshgrid(range(4), range(4), range(2), indexing="ij"), -1).reshape(-1, 3)
    path = folder / "few.npz"
    np.savez(path, position=(1.0 + 2.0 * corners) * RADIUS, radius=np.full(len(corners), RADIUS))
    fields = {"frame_rate": FRAME_RATE, "solver": {"threads": 1}, "tools": _blade(folder)}
    parsed = bed_scene((8.0 * RADIUS, 8.0 * RADIUS), path, **fields)
    world = World(read_scene(parsed, folder))
    frames = []
    for _ in range(PINGS_BEFORE + pings):
        begin = time.perf_counter()
        world.step(world.frame_steps)
        world.observe()
        frames.append(time.perf_counter() - begin)
    with _running_node(parsed, folder, "lockstep", setup) as client:
        waits = client.ping(PINGS_BEFORE + pings, 1.0 / FRAME_RATE, HIGH)[PINGS_BEFORE:]
    row = {"benchmark": "node", "case": "lockstep latency", "threads": 1, "grains": len(corners), "pings": pings}
    ends = {"median_ms": np.median(waits), "p99_ms": np.percentile(waits, 99), "most_ms": max(waits)}
    row |= {name: round(1e3 * float(value), 3) for name, value in ends.items()}
    row["bare_frame_ms"] = round(1e3 * float(np.median(frames[PINGS_BEFORE:])), 3)
    return row | provenance(1)


def _blade(folder: Path) -> dict:
    return {"blade": blade_tool(folder) | {"pose": {"position": HIGH.tolist()}, "max_speed": 1.0}}


@contextmanager
def _running_node(parsed: dict, folder: Path, pacing: str, setup: Setup):
    """A node in a process of its own, and a client that it can hear."""
    scene = folder / "node.yaml"
    scene.write_text(json.dumps(parsed))
    parameters = {"scene": str(scene), "pacing": pacing, "points_rate": 0.0}
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}:={json.dumps(value)}")]
    command = [sys.executable, "-m", "sand_sim.node", "--ros-args", "--log-level", "warn", *words]
    process = subprocess.Popen(command, start_new_session=True)
    client = _Client(process, setup.progress)
    try:
        client.connect()
        yield client
    finally:
        client.close()
        process.send_signal(signal.SIGINT)
        try:
            process.wait(20.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class _Client:
    """Drives the blade of a node and watches its clock."""

    def __init__(self, process: subprocess.Popen, progress):
        import rclpy
        from geometry_msgs.msg import PoseStamped, WrenchStamped
        from rclpy.executors import SingleThreadedExecutor
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import PointCloud2

        self._process, self._progress = process, progress
        self._node = rclpy.create_node("bench")
        self._poses = self._node.create_publisher(PoseStamped, "/sand_sim/tools/blade/pose", 100)
        self._clocks: list[tuple[float, float]] = []  # wall, simulated
        self._wrench = -1.0
        self._node.create_subscription(Clock, "/clock", self._hear_clock, 5)
        self._node.create_subscription(WrenchStamped, "/sand_sim/tools/blade/wrench", self._hear_wrench, 5)
        self._node.create_subscription(PointCloud2, "/sand_sim/points", lambda cloud: None, 5)  # heard, as in use
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _hear_clock(self, message) -> None:
        self._clocks.append((time.perf_counter(), _seconds(message.clock)))

    def _hear_wrench(self, message) -> None:
        self._wrench = _seconds(message.header.stamp)

    def connect(self) -> None:
        """Wait until the node hears us and we have heard it; it may need a push to say something."""
        from std_srvs.srv import Trigger

        self._wait_for(self._poses.get_subscription_count)
        while self._wrench < 0.0 or not self._clocks:
            self._call(Trigger, "step", Trigger.Request())
            self._executor.spin_once(timeout_sec=0.5)

    def _wait_for(self, condition) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            self._progress("waiting for the node", 0.0)
            if self._process.poll() is not None or time.monotonic() > end:
                raise SceneError("bench: the node has ended or does not answer")
            self._executor.spin_once(timeout_sec=0.1)

    def _call(self, kind, name: str, request):
        service = self._node.create_client(kind, f"/sand_sim/{name}")
        self._wait_for(service.service_is_ready)
        future = service.call_async(request)
        self._wait_for(future.done)
        self._node.destroy_client(service)
        return future.result()

    def pause(self, paused: bool) -> None:
        """Hold the node, until the frame it is in is over, or let it go on."""
        from std_srvs.srv import Trigger

        self._call(Trigger, "pause" if paused else "resume", Trigger.Request())
        heard = -1
        while paused and heard != len(self._clocks):
            heard = len(self._clocks)
            end = time.monotonic() + 2.0
            while time.monotonic() < end:
                self._executor.spin_once(timeout_sec=0.1)

    def set_points_rate(self, rate: float) -> None:
        """Clouds per simulated second."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        request = SetParameters.Request(parameters=[Parameter("points_rate", value=rate).to_parameter_msg()])
        self._call(SetParameters, "set_parameters", request)

    def _send(self, position: np.ndarray, at: float | None = None) -> None:
        from msg_adapters.geometry_msgs import command_to_pose

        self._poses.publish(command_to_pose(ToolPose("blade", position, np.array([0.0, 0.0, 0.0, 1.0]), at), "world"))

    def rate(self, window: float, middle: np.ndarray) -> tuple[float, float]:
        """Simulated seconds of the node over wall seconds, and over those of its stepping threads, while poses stream in."""
        self._wait_for_clock()
        first, spent = len(self._clocks) - 1, self._stepping_seconds()
        begin = time.perf_counter()
        sent = heard = 0
        while time.perf_counter() - begin < window or len(self._clocks) < heard + 1:
            if time.perf_counter() - begin < window:
                heard = len(self._clocks)
            due = int((time.perf_counter() - begin) * POSE_RATE)
            while sent < due:
                sent += 1
                self._send(middle + SWING * np.sin(0.01 * sent))
            self._executor.spin_once(timeout_sec=max(0.0, begin + (sent + 1) / POSE_RATE - time.perf_counter()))
            if sent % 100 == 0:
                self._progress("node under load", 0.0)
        spent = self._stepping_seconds() - spent
        (wall, simulated), (last_wall, last_simulated) = self._clocks[first], self._clocks[-1]
        return (last_simulated - simulated) / (last_wall - wall), (last_simulated - simulated) / spent

    def _wait_for_clock(self) -> None:
        heard = len(self._clocks)
        self._wait_for(lambda: len(self._clocks) > heard)

    def _stepping_seconds(self) -> float:
        """Processor seconds of the node's threads, without the one that spins and those of the middleware."""
        ticks, process = 0, self._process.pid
        for task in Path(f"/proc/{process}/task").iterdir():
            head, _, tail = (task / "stat").read_text().rpartition(")")
            if int(task.name) != process and not head.split("(", 1)[1].startswith("dds"):
                ticks += sum(int(word) for word in tail.split()[11:13])
        return ticks / os.sysconf("SC_CLK_TCK")

    def ping(self, number: int, frame: float, middle: np.ndarray) -> list[float]:
        """Seconds from each stamped pose to the wrench of its time."""
        waits, now = [], self._clocks[-1][1]
        for k in range(1, number + 1):
            at = round(now + k * frame, 9)
            begin = time.perf_counter()
            self._send(middle + SWING * np.sin(0.01 * k), at)
            while self._wrench < at - 0.5 * frame:
                self._executor.spin_once(timeout_sec=1.0)
                if time.perf_counter() - begin > PATIENCE:
                    raise SceneError("bench: the node does not answer")
            waits.append(time.perf_counter() - begin)
            if k % 50 == 0:
                self._progress("latency", k / number)
        return waits

    def close(self) -> None:
        """Leave."""
        self._executor.shutdown()
        self._node.destroy_node()


def _seconds(stamp) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec
