"""The command line as users type it."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from scenes import write_small_scene

PATIENCE = 120.0

pytestmark = pytest.mark.xdist_group("processes")  # one after the other, as those of the node


def sand_sim(folder, *words, **further):
    command = [sys.executable, "-m", "sand_sim", *map(str, words)]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **further)


def finish(process):
    try:
        output, errors = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)  # or the processes it has started would talk into the tests that follow
        pytest.fail(f"still running: {process.communicate(timeout=PATIENCE)}")
    return process.returncode, output, errors


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["demo", "--help"], ["play", "--help"]])
def test_help(tmp_path, words):
    code, output, _ = finish(sand_sim(tmp_path, *words))
    assert code == 0
    assert "usage: sand_sim" in output


def test_help_without_docstrings(tmp_path):
    code, output, errors = finish(sand_sim(tmp_path, "run", "--help", env=os.environ | {"PYTHONOPTIMIZE": "2"}))
    assert code == 0, errors
    assert "--resume" in output


def test_version(tmp_path):
    code, output, _ = finish(sand_sim(tmp_path, "--version"))
    assert code == 0
    assert output.split() == ["sand_sim", ElementTree.parse(Path(__file__).parents[2] / "package.xml").findtext("version")]


def test_run_writes_everything_and_sums_up(tmp_path):
    scene = write_small_scene(tmp_path)
    code, output, errors = finish(sand_sim(tmp_path, "run", scene, "--out", "results", "--threads", 2))
    assert code == 0, errors
    summary = json.loads((tmp_path / "results" / "small.json").read_text())
    assert summary["grains"] == 32
    assert summary["simulated_s"] == pytest.approx(0.4)
    assert summary["tools"]["plate"]["peak_draft_N"] >= 0.0
    assert {"carried_kg", "spilled_kg"} <= set(summary["tools"]["plate"])
    assert summary["doubts"] == []
    assert summary["scene"]["tools"]["plate"]["mesh"].startswith("sha256 ")  # where variants of a scene differ
    written = yaml.safe_load(scene.read_text())["materials"]
    assert {name: found["density"] for name, found in summary["scene"]["materials"].items()} == {
        name: given["density"] for name, given in written.items()
    }
    assert summary["versions"]["warp-lang"] == version("warp-lang")
    assert summary["device"].startswith(("cpu, ", "cuda:")), "the one that was used, not what was asked for"
    for kind in ("rrd", "npz", "png"):
        assert (tmp_path / "results" / f"small.{kind}").stat().st_size > 1000
    for word in ("real-time factor", "peak draft", "energy balance", "energy from nowhere", "largest overlap / radius"):
        assert word in output


def test_one_impact_of_milliseconds_is_told_as_it_is(tmp_path):
    """A picture of one sphere has no extent but its own; what a scene says is absent needs no warning."""
    code, output, errors = finish(sand_sim(tmp_path, "run", "impact", "--out", "results"))
    assert code == 0, errors
    assert "simulated                 0.002 s in" in output
    assert "warning" not in errors.lower()


@pytest.mark.parametrize("buffered", ["", "1"])
@pytest.mark.parametrize("words", ["sand_sim --help", "sand_sim bench --list", "sand_sim plan impact --json", "sand_sim.node -h"])
def test_output_that_nobody_reads_is_no_error(tmp_path, words, buffered):
    if "node" in words:
        pytest.importorskip("rclpy", reason="needs ROS 2")
    command = f"{sys.executable} -m {words} | true"
    places = {**os.environ, "PYTHONUNBUFFERED": buffered}
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, env=places, capture_output=True, text=True, check=False)
    assert "rror" not in done.stderr and "roken" not in done.stderr


def test_refusals_are_one_line(tmp_path):
    code, _, errors = finish(sand_sim(tmp_path, "run", "nothing"))
    assert code == 1
    assert errors.startswith("sand_sim: scene 'nothing': there is no such file")
    assert len(errors.strip().splitlines()) == 1


@pytest.mark.parametrize("command", [["sand_sim", "run", "dig"], ["sand_sim.node"]])
def test_a_folder_for_kernels_that_cannot_be_made_is_told(tmp_path, command):
    if command == ["sand_sim.node"]:
        pytest.importorskip("rclpy", reason="needs ROS 2")
    (tmp_path / "file").touch()
    environment = os.environ | {"WARP_CACHE_PATH": str(tmp_path / "file")}
    done = subprocess.run([sys.executable, "-m", *command], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("sand_sim: compiled kernels cannot be kept: [Errno 20] Not a directory")
    assert done.stderr.endswith("; set WARP_CACHE_PATH to a folder that can be written\n")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("words", [["pareto", "impact"], ["stability"], ["demo"], ["run", "dig"]])
def test_a_folder_that_cannot_be_made_is_refused_at_once(tmp_path, words):
    (tmp_path / "file").touch()
    code, output, errors = finish(sand_sim(tmp_path, *words, "--out", "file/out"))
    assert code == 1
    assert errors == "sand_sim: --out file/out: is no folder that can be made: Not a directory; name another\n"
    assert not output


@pytest.mark.parametrize("option", [["pareto", "impact", "--write"], ["bench", "W1-1000", "--out"]])
def test_a_file_that_cannot_be_written_is_refused_at_once(tmp_path, option):
    (tmp_path / "folder").mkdir()
    code, output, errors = finish(sand_sim(tmp_path, *option, "folder"))
    assert code == 1
    assert errors == f"sand_sim: {option[-1]} folder: cannot be written; name another file\n"
    assert not output


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--duration", "nan"], "argument --duration: must be positive, got nan"),
        (["--duration", "inf"], "argument --duration: must be positive, got inf"),
        (["--duration", "0"], "argument --duration: must be positive, got 0"),
        (["--threads", "-3"], "argument --threads: must be at least 1, got -3"),
    ],
)
def test_numbers_without_sense_are_refused(tmp_path, words, told):
    code, _, errors = finish(sand_sim(tmp_path, "run", write_small_scene(tmp_path), *words))
    assert code == 2
    assert errors.strip().splitlines()[-1] == f"sand_sim run: error: {told}"


def test_a_trajectory_that_is_too_fast_is_told_before_the_run(tmp_path):
    scene = write_small_scene(tmp_path)
    good = scene.read_text()
    for old, new, told in [
        ("max_speed: 1.0", "max_speed: 0.2", "trajectory[2]: on the way there a point of the tool moves at 0.265 m/s, faster"),
        ("max_speed: 1.0", "max_speed: 1.0\n    pose: {position: [0, 0, 0.1]}", "pose: is 0.0474 m from where the trajectory"),
    ]:
        scene.write_text(good.replace(old, new))
        code, _, errors = finish(sand_sim(tmp_path, "run", scene, "--out", "results"))
        assert code == 1
        assert errors.strip().splitlines()[-1].startswith(f"sand_sim: tools.plate.{told}")
    assert not list((tmp_path / "results").iterdir())


def test_ctrl_c_keeps_what_was_recorded(tmp_path):
    process = sand_sim(tmp_path, "run", "dig", "--out", "results")
    begin = time.monotonic()
    while not (tmp_path / "results" / "dig.rrd").exists():
        assert time.monotonic() - begin < PATIENCE
        time.sleep(0.1)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    code, output, errors = finish(process)
    assert code == 130
    assert "Traceback" not in errors
    summary = json.loads((tmp_path / "results" / "dig.json").read_text())
    assert summary["steps"] > 0
    assert summary["interrupted"]
    assert "interrupted               by the user, before its end" in output
    assert "written: results/dig.rrd" in output


@pytest.mark.usefixtures("hears_hang_up")
@pytest.mark.parametrize("before", [[], ["nohup"]])
def test_a_terminal_that_is_closed_ends_a_run_as_ctrl_c_does(tmp_path, before):
    """As that of a remote login that breaks off; the results were lost, and what is told afterwards finds no terminal."""
    write_small_scene(tmp_path)
    command = [*before, sys.executable, "-m", "sand_sim", "run", "small.yaml", "--duration", "1" if before else "1000"]
    leader, follower = os.openpty()
    take = "import os, sys; os.open(sys.argv[1], os.O_RDWR); os.execvp(sys.argv[2], sys.argv[2:])"  # it is the session's
    process = subprocess.Popen(
        [sys.executable, "-c", take, os.ttyname(follower), *command],
        cwd=tmp_path,
        stdin=follower,
        stdout=follower,
        stderr=follower,
        start_new_session=True,
    )
    os.close(follower)
    end = time.monotonic() + PATIENCE
    while not (tmp_path / "out" / "small.rrd").exists() and time.monotonic() < end:
        if not before:  # nohup writes to a file
            os.read(leader, 100_000)
    os.close(leader)  # which hangs up
    assert process.wait(timeout=PATIENCE) == (0 if before else 130)
    assert json.loads((tmp_path / "out" / "small.json").read_text())["interrupted"] == (not before)


def test_a_run_without_rerun_says_so_before_the_work_and_goes_on(tmp_path):
    (tmp_path / "without" / "rerun").mkdir(parents=True)
    (tmp_path / "without" / "rerun" / "__init__.py").write_text("raise ImportError('not there')")
    scene = write_small_scene(tmp_path, duration=0.1)
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "without")}
    code, output, errors = finish(sand_sim(tmp_path, "run", scene, env=environment))
    assert code == 0, errors
    assert errors.startswith("recording: Rerun cannot be imported (not there); pip install 'sand_sim[recording]'")
    assert "written: out/small.npz" in output


def test_demo_drives_the_node_through_ros(tmp_path):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    scene = write_small_scene(tmp_path)
    code, output, errors = finish(sand_sim(tmp_path, "demo", scene, "--out", "results"))
    assert code == 0, errors
    assert "written: results/small.rrd, results/small.png" in output
    assert json.loads((tmp_path / "results" / "small.json").read_text())["simulated_s"] == pytest.approx(0.4)


def test_demo_without_its_recording_says_so(tmp_path):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    scene = write_small_scene(tmp_path, duration=0.1)
    (tmp_path / "results" / "small.rrd").mkdir(parents=True)
    code, output, errors = finish(sand_sim(tmp_path, "demo", scene, "--out", "results"))
    assert code == 1
    assert "recording results/small.rrd: Is a directory" in errors
    assert "written: results/small.png, results/small.npz, results/small.json" in output


def test_a_demo_with_nothing_to_play_ends(tmp_path):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "pose": {"position": [0.0, 0.0, 0.06]}}
    scene = write_small_scene(tmp_path, tools={"plate": plate})
    code, _, errors = finish(sand_sim(tmp_path, "demo", scene, "--out", "results"))
    assert code == 1
    assert "sand_sim: scene 'small' has no tool with a trajectory, so there is nothing to play" in errors


@pytest.mark.parametrize("delay", [0.5, 4.0])
def test_ctrl_c_ends_the_demo_and_its_processes(tmp_path, delay):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    process = sand_sim(tmp_path, "demo", "dig", "--out", "results")
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    code, _, errors = finish(process)
    assert code == 130, errors
    assert "Traceback" not in errors
    left = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout
    assert str(tmp_path) not in left


def test_two_demos_do_not_drive_each_other(tmp_path):
    """Both have a tool of the same name, on ways of their own, on one machine and in one ROS domain."""
    pytest.importorskip("rclpy", reason="needs ROS 2")
    started = []
    for name, aside in (("one", 0.0), ("other", 0.03)):
        (tmp_path / name).mkdir()
        write_small_scene(tmp_path / name)
        scene = yaml.safe_load((tmp_path / name / "small.yaml").read_text())
        for stop in scene["tools"]["plate"]["trajectory"]:
            stop["position"][0] += aside
        (tmp_path / name / "small.yaml").write_text(yaml.safe_dump(scene))
        started.append(sand_sim(tmp_path / name, "demo", "small.yaml", "--out", "results"))
    for process, name, end in zip(started, ("one", "other"), (0.02, 0.05), strict=True):
        code, _, errors = finish(process)
        assert code == 0, errors
        history = np.load(tmp_path / name / "results" / "small.npz")
        assert history["plate.position"][-1] == pytest.approx([end, 0.015, 0.05], abs=1e-6)
