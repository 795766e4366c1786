"""Sinks that fail: the run goes on, says so once, and takes them up again."""

import json
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import World, load_scene
from sand_sim.sinks.recorder import Recorder
from sand_sim.sinks.run_log import RunLog

pytest.importorskip("rerun")

with socket.socket() as free:  # none that is fixed: another run of the tests may be under way
    free.bind(("127.0.0.1", 0))
    PORT = free.getsockname()[1]
FULL = OSError(28, "No space left on device")


@pytest.fixture
def world(tmp_path):
    return World(load_scene(write_small_scene(tmp_path)))


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    """Every frame is written and looked after."""
    monkeypatch.setattr("sand_sim.sinks.recording_file._RETRY", 0.02)
    monkeypatch.setattr("sand_sim.sinks.viewer._EVERY", 0.0)


def frames(recorder, world, number):
    for _ in range(number):
        world.step(100)
        recorder.write(world.observe())


def frames_until(recorder, world, condition):
    """Go on until something has come of it; how many frames it took."""
    begin, number = time.monotonic(), 0
    while not condition():
        assert time.monotonic() - begin < 20.0
        frames(recorder, world, 1)
        time.sleep(0.01)
        number += 1
    return number


def is_sound(path):
    """Whether Rerun finds nothing wrong with a recording."""
    return (
        subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", path], capture_output=True, check=False).returncode == 0
    )


def times_in(path, timeline="sim_time"):
    """Moments of a timeline that a recording holds grains of."""
    command = [sys.executable, "-m", "rerun", "rrd", "print", "-vv", path]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    chunks = [chunk for chunk in printed.split("\nChunk(") if "/world/grains" in chunk and f" {timeline} " in chunk]
    return sum(int(chunk.split(" with ")[1].split()[0]) for chunk in chunks)


def test_a_recording_holds_each_frame(world, tmp_path):
    recorder = Recorder(world, tmp_path / "run.rrd")
    frames(recorder, world, 7)
    assert recorder.close() == [tmp_path / "run.rrd"]
    assert times_in(tmp_path / "run.rrd") == 7 + 1, "and the radii, which are drawn once"
    assert is_sound(tmp_path / "run.rrd")


def test_what_comes_after_a_reset_is_not_mixed_with_what_was(world, tmp_path):
    recorder = Recorder(world, tmp_path / "run.rrd")
    frames(recorder, world, 4)
    world.remove_grains(identity=[0])
    frames(recorder, world, 3)
    world.reset()
    frames(recorder, world, 5)
    recorder.close()
    assert times_in(tmp_path / "run.rrd") == 7 + 2, "and the radii of all, and of one less"
    assert times_in(tmp_path / "run.rrd", "sim_time_2") == 5 + 1
    assert is_sound(tmp_path / "run.rrd")


@pytest.mark.parametrize("tools", [True, False])
def test_a_bed_that_has_left_the_domain_leaves_all_files(tmp_path, tools):
    pytest.importorskip("matplotlib")
    world = World(load_scene(write_small_scene(tmp_path, **({} if tools else {"tools": {}}))))
    recorder = Recorder(world, tmp_path / "out" / "run.rrd", tmp_path / "out")
    world.remove_grains(box=([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]))
    frames(recorder, world, 2)
    assert [path.name for path in recorder.close()] == ["run.rrd", "small.npz", "small.json", "small.png"]
    assert not recorder.failed


def test_a_full_disk_is_told_once_and_nothing_is_lost(world, tmp_path, monkeypatch):
    told = []
    recorder = Recorder(world, tmp_path / "run.rrd", report=told.append)
    frames(recorder, world, 3)
    with monkeypatch.context() as patch:
        patch.setattr("sand_sim.sinks.recording_file._Pump._append", fail)
        number = frames_until(recorder, world, lambda: told)
        frames(recorder, world, 5)
    number += frames_until(recorder, world, lambda: len(told) > 1)
    recorder.close()
    assert len(told) == 2
    assert "No space left on device; the simulation goes on" in told[0]
    assert told[1].endswith("goes on")
    assert recorder.failed == []
    assert times_in(tmp_path / "run.rrd") == 3 + 5 + number + 1
    assert is_sound(tmp_path / "run.rrd")


def fail(*_):
    raise FULL


def test_a_disk_that_is_full_in_the_middle_of_a_write(world, tmp_path):
    """A limit on the size of files plays the disk."""
    told = []
    recorder = Recorder(world, tmp_path / "run.rrd", report=told.append)
    frames(recorder, world, 3)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_001, before[1]))
    try:
        number = frames_until(recorder, world, lambda: told)
        assert (tmp_path / "run.rrd").stat().st_size == 50_001
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    number += frames_until(recorder, world, lambda: len(told) > 1)
    recorder.close()
    assert len(told) == 2
    assert "File too large" in told[0]
    assert times_in(tmp_path / "run.rrd") == 3 + number + 1
    assert is_sound(tmp_path / "run.rrd")


def test_what_waits_for_a_disk_has_a_bound(world, tmp_path, monkeypatch):
    """Beyond it frames are missing, and the recording goes on in a second file when there is room again."""
    told = []
    monkeypatch.setattr("sand_sim.sinks.recording_file._MOST_WAITING", 100_000)
    recorder = Recorder(world, tmp_path / "run.rrd", report=told.append)
    with monkeypatch.context() as patch:
        patch.setattr("sand_sim.sinks.recording_file._Pump._append", fail)
        pump = next(iter(recorder._sinks.values()))._pump
        frames_until(recorder, world, lambda: pump.lost)
    frames_until(recorder, world, lambda: len(told) > 1)
    frames(recorder, world, 3)
    assert recorder.close() == [tmp_path / "run.rrd"]
    assert recorder.failed == [tmp_path / "run.2.rrd"]
    assert "bytes are missing" in told[-1]
    assert times_in(tmp_path / "run.2.rrd") >= 3
    assert is_sound(tmp_path / "run.2.rrd")


def test_a_deleted_recording_is_begun_again(world, tmp_path):
    path = tmp_path / "sub" / "run.rrd"
    recorder = Recorder(world, path)
    frames_until(recorder, world, path.exists)
    path.unlink()
    frames_until(recorder, world, path.exists)
    frames(recorder, world, 3)
    assert recorder.close() == [path]
    assert times_in(path) >= 4
    assert is_sound(path)


def test_a_folder_that_cannot_be_written(world, tmp_path):
    """A file stands where the folder shall be; it goes away before the end."""
    told, blocked = [], tmp_path / "out"
    blocked.touch()
    recorder = Recorder(world, blocked / "run.rrd", blocked, report=told.append)
    number = frames_until(recorder, world, lambda: told)
    frames(recorder, world, 3)
    assert len(told) == 1
    assert "File exists" in told[0]
    blocked.unlink()
    number += 3 + frames_until(recorder, world, lambda: len(told) > 1)
    assert len(recorder.close()) >= 3
    assert recorder.failed == []
    assert times_in(blocked / "run.rrd") == number + 1
    with np.load(blocked / "small.npz") as history:
        assert len(history["time"]) == number


def test_files_that_cannot_be_written_at_the_end_are_named(world, tmp_path):
    told, blocked = [], tmp_path / "out"
    blocked.touch()
    recorder = Recorder(world, blocked / "run.rrd", blocked, report=told.append)
    frames(recorder, world, 3)
    assert recorder.close() == []
    assert {path.name for path in recorder.failed} == {"run.rrd", "small.npz", "small.json", "small.png"}
    assert all(any(path.name in line for line in told) for path in recorder.failed)


def wait_until(listens):
    from sand_sim.sinks.viewer import _listens

    begin = time.monotonic()
    while _listens() != listens:
        assert time.monotonic() - begin < 60.0
        time.sleep(0.1)


def listener():
    """A program that viewers connect to, in place of a viewer."""
    command = [sys.executable, "-m", "rerun", "--serve-grpc", "--bind", "127.0.0.1", "--port", str(PORT)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    wait_until(listens=True)
    return process


def end(process):
    """Kill it; the program that listens is a child, which goes a little later."""
    os.killpg(process.pid, 9)
    process.wait()
    wait_until(listens=False)


@pytest.mark.xdist_group("processes")
def test_a_viewer_may_be_killed_and_come_back(world, monkeypatch):
    monkeypatch.setattr("sand_sim.sinks.viewer.PORT", PORT)
    told, viewer = [], listener()
    try:  # one that is open already, as a run before has left it, is taken
        recorder = Recorder(world, view=True, report=told.append)
        frames(recorder, world, 5)
        assert told == []
        end(viewer)
        begin = time.monotonic()
        frames(recorder, world, 50)
        assert time.monotonic() - begin < 20.0, "the run does not wait for it"
        assert told == [f"the Rerun viewer: nobody listens on 127.0.0.1:{PORT}; the simulation goes on, and this is tried again"]
        viewer = listener()
        frames(recorder, world, 5)
        assert told[1:] == ["the Rerun viewer goes on"]
        begin = time.monotonic()
        end(viewer)
        recorder.close()
        assert time.monotonic() - begin < 25.0
    finally:
        if viewer.poll() is None:
            end(viewer)


def test_a_folder_that_cannot_be_made_is_told_before_the_run(world, tmp_path):
    told = []
    (tmp_path / "file").touch()
    recorder = Recorder(world, output=tmp_path / "file" / "out", report=told.append)
    assert told == [f"{tmp_path}/file/out cannot be made: Not a directory; summary and history are tried again in the end"]
    frames(recorder, world, 1)
    (tmp_path / "file").unlink()
    assert tmp_path / "file" / "out" / "small.json" in recorder.close()
    assert not recorder.failed


def test_a_history_stays_within_its_bound(tmp_path):
    """Of a run without end rows are thinned out evenly, from its beginning to now."""
    world = World(load_scene(write_small_scene(tmp_path)))
    log, first = RunLog(world.scene, most_rows=20), world.observe()
    for k in range(1000):
        log.write(replace(first, steps=k, time=0.02 * k))
    steps = log.columns()["steps"]
    assert 10 <= len(steps) <= 20
    assert steps[0] <= 1
    assert steps[-1] >= 1000 - 2 * 1000 / 10
    assert len(set(np.diff(steps))) == 1
    resumed = RunLog(world.scene, most_rows=20)
    resumed.unpack(log.pack())
    for k in range(999, 1015):  # the frame of the checkpoint is seen again
        resumed.write(replace(first, steps=k, time=0.02 * k))
    assert len(set(np.diff(resumed.columns()["steps"]))) == 1, "also from before a checkpoint to after"
    assert len(resumed.rows) < len(steps) + 3


def test_peaks_are_of_all_frames_also_of_those_that_are_given_up(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    log, first = RunLog(world.scene, most_rows=4), world.observe()
    for k in range(100):
        pull = np.array([0.0, -7.0, -5.0] if k == 41 else [0.0, 3.0, 1.0])
        tool = replace(first.tools[0], velocity=np.array([0.0, 0.2, 0.0]), world_force=pull, torque=pull)
        log.write(replace(first, steps=k, tools=(tool,)))
    resumed = RunLog(world.scene, most_rows=4)
    resumed.unpack(log.pack())
    resumed.write(replace(first, steps=100))
    for one in (log, resumed):
        assert 41 not in one.columns()["steps"]
        (told,) = one.summarise()["tools"].values()
        assert (told["peak_draft_N"], told["peak_lift_N"]) == pytest.approx((7.0, 5.0))
        assert (told["peak_force_N"], told["peak_torque_Nm"]) == pytest.approx((74**0.5, 74**0.5))


def test_a_file_of_an_earlier_run_stays_whole_where_a_new_one_cannot_be_written(world, tmp_path, monkeypatch):
    def write_half(path, **arrays):
        Path(path).write_bytes(b"half")
        raise FULL

    monkeypatch.setattr("sand_sim.sinks.run_log.np.savez_compressed", write_half)
    history = tmp_path / "out" / "small.npz"
    recorder = Recorder(world, output=tmp_path / "out", report=lambda line: None)
    history.write_bytes(b"whole")
    frames(recorder, world, 1)
    recorder.close()
    assert recorder.failed == [history]
    assert history.read_bytes() == b"whole"
    assert not list(history.parent.glob(".*"))


def test_frames_are_written_in_few_pieces(tmp_path, world):
    """Rerun keeps something of each piece in memory to the end: of slow runs it was a gigabyte an hour."""
    recorder = Recorder(world, tmp_path / "run.rrd")
    for _ in range(20):
        frames(recorder, world, 1)
        time.sleep(0.05)
    recorder.close()
    told = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "stats", tmp_path / "run.rrd"], capture_output=True, text=True, check=True
    ).stdout
    pieces, entities = (int(re.search(rf"{name} = (\d+)", told)[1]) for name in ("num_chunks", "num_entity_paths"))
    assert pieces < 2 * entities


def test_columns_of_the_history_are_those_that_are_documented(tmp_path):
    plunger = {"type": "plunger", "name": "press", "material": "steel", "point": [0.0, 0.0, 0.2], "normal": [0.0, 0.0, -1.0]}
    scene = write_small_scene(tmp_path)
    scene.write_text(scene.read_text().replace("boundaries:", f"boundaries:\n- {json.dumps(plunger | {'velocity': 0.1})}"))
    world = World(load_scene(scene))
    log = RunLog(world.scene)
    log.write(world.observe())
    log.save_history(tmp_path / "history.npz")
    document = (Path(__file__).parents[1] / "docs" / "python.md").read_text(encoding="utf-8")
    for name in np.load(tmp_path / "history.npz").files:
        told = name.replace("plate.", "TOOL.").replace("wall.press.position", "wall.PLUNGER.position")
        told = told.replace("wall.press.", "wall.WALL.").replace("wall.floor.", "wall.WALL.")
        assert f"`{told}`" in document or name.startswith("bed.")
