"""The node with real publishers, subscribers and services."""

import threading
import time

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")  # one after the other, so that each knows what it has left behind

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from node_client import PATIENCE, START, Client, drive
from scenes import write_small_scene
from std_srvs.srv import Trigger

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_pose, wrench_to_arrays
from msg_adapters.sensor_msgs import cloud_to_points
from sand_sim import load_scene
from sand_sim.tool_motion.playing import commands_at, frame_times


def test_a_recording_that_cannot_be_written_is_told_on_diagnostics(client, start_node, tmp_path):
    blocked = tmp_path / "out"
    blocked.touch()
    start_node(pacing="fast", recording=str(blocked / "run.rrd"))
    client.connect()
    client.wait_for(lambda: client.diagnostics and "run.rrd: " in client.diagnostics[-1].status[0].message)
    assert client.diagnostics[-1].status[0].level == DiagnosticStatus.WARN
    blocked.unlink()
    client.wait_for(lambda: "run.rrd" not in client.diagnostics[-1].status[0].message)


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


def test_all_of_a_path_sent_at_once_is_passed(client, start_node):
    """A thousand poses, of which the first is not taken before the last has been sent; corners lie at the ends of frames."""
    node = start_node(pacing="lockstep", points_rate=0.0)
    sent, taken, submit = threading.Event(), [], node.simulation.submit

    def hear(command):
        sent.wait(PATIENCE)
        taken.append(command.time)
        submit(command)

    node.simulation.submit = hear
    shown = []
    client.node.create_subscription(PoseStamped, "/sand_sim/tools/plate/pose_actual", shown.append, 200)
    client.connect()
    times = 0.002 * np.arange(1, 1001)
    heights = 0.005 * np.abs((times / 0.02 + 1.0) % 2.0 - 1.0)
    for at, height in zip(times, heights, strict=True):
        client.send(START + [0.0, 0.0, height], at=at)
    sent.set()
    client.wait_for(lambda: shown and stamp_to_time(shown[-1].header.stamp) > times[-1] - 1e-6)
    assert taken == pytest.approx(times)
    assert node.simulation.rejected == {}
    corners = {round(stamp_to_time(message.header.stamp) / 0.02): message.pose.position.z for message in shown}
    for k in range(1, 101):
        assert corners[k] - START[2] == pytest.approx(0.005 * (k % 2), abs=2e-5), f"corner {k}"


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
    client.wait_for(
        lambda: (
            client.diagnostics
            and client.diagnostics[-1].status[0].message == "in lockstep: waiting for the next command of plate"
        )
    )
    assert client.call(Trigger, "pause").message == "paused"
    client.wait_for(lambda: client.diagnostics[-1].status[0].message == "paused")
    client.send(START, at=0.1)
    assert client.call(Trigger, "step").message == "t = 0.020000 s"
    assert client.call(Trigger, "resume").message == "running"
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
    assert stamp_to_time(client.diagnostics[-1].header.stamp) == pytest.approx(client.time)
    assert client.diagnosed("commands rejected: unknown_frame") == "2"
    assert "header.frame_id" in client.diagnosed("last rejection") or "stamp" in client.diagnosed("last rejection")


@pytest.mark.parametrize("step", [2, 4])
def test_cloud_rate_and_decimation(client, start_node, step):
    start_node(pacing="lockstep", points_rate=10.0, points_decimation=step)
    client.connect()
    before = len(client.clouds)
    client.send(START, at=1.0)
    client.wait_for(lambda: client.time > 0.999)
    client.wait_for(lambda: stamp_to_time(client.clouds[-1].header.stamp) > 0.99)
    clouds = client.clouds[before:]
    assert 9 <= len(clouds) <= 11
    assert sorted(cloud_to_points(clouds[-1])["id"]) == list(range(0, 32, step))


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
    answer = client.call(Trigger, "resume")
    assert not answer.success
    assert answer.message.startswith("stepping has stopped, reset to go on: blown up")
    assert node.simulation.rejected["stopped"] == 1
    assert client.call(Trigger, "reset").success
    client.wait_for(lambda: client.time == 0.0)
    assert client.call(Trigger, "step").message.startswith("t = 0.0")
    client.wait_for(lambda: client.diagnostics[-1].status[0].level == DiagnosticStatus.WARN)
