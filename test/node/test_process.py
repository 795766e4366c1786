"""The node as a process: bad starts, signals, what it leaves behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")  # one after the other, so that each knows what it has left behind

from node_client import PATIENCE
from scenes import write_small_scene


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


@pytest.mark.parametrize(
    ("words", "code", "named"),
    [
        (["small.yaml"], 1, "unknown arguments 'small.yaml'; usage: sand_sim_node --ros-args -p scene:=FILE"),
        (["-p", "scene:=small.yaml", "--ros-args", "-p", "pacing:=fast"], 1, "unknown arguments '-p scene:=small.yaml'"),
        (["--help"], 0, "usage: sand_sim_node --ros-args -p scene:=FILE"),
    ],
)
def test_arguments_that_are_not_for_ros_run_no_other_scene(words, code, named):
    command = [sys.executable, "-m", "sand_sim.node", *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == code
    told = done.stdout if code == 0 else done.stderr
    assert named in told and len(told.splitlines()) == 1


@pytest.mark.usefixtures("hears_hang_up")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
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


def test_progress_is_told_by_the_name_that_the_node_has(tmp_path):
    scene = write_small_scene(tmp_path, settle={"time": 1000.0, "speed": 1e-9})
    words = ["-r", "__node:=second", "-r", "__ns:=/left", "-p", f"scene:={scene}"]
    command = [sys.executable, "-m", "sand_sim.node", "--ros-args", *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        line = next(line for line in process.stderr if "settling, " in line)
        process.send_signal(signal.SIGINT)
    assert "[left.second]: settling" in line
    assert process.returncode == 0


def test_the_node_can_end_when_a_run_blows_up(start_process, tmp_path):
    write_small_scene(tmp_path, solver={"time_step": 9e-4, "force_time_step": True})
    process = start_process(scene="small.yaml", pacing="fast", end_on_fault=True, output=tmp_path / "out")
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "stepping has stopped: blown up at t = " in errors
    assert "Traceback" not in errors
    assert (tmp_path / "out" / "small.json").is_file()


def test_the_exit_code_tells_of_files_that_could_not_be_written(start_process, tmp_path):
    write_small_scene(tmp_path)
    (tmp_path / "small.json").mkdir()
    process = start_process(scene="small.yaml", pacing="fast", duration=0.1, output=tmp_path)
    _, errors = process.communicate(timeout=PATIENCE)
    assert "small.json cannot be written" in errors
    assert process.returncode == 1
