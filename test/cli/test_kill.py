"""``kill -9`` at any moment, and on."""

import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim.checkpoint import read_checkpoint

PATIENCE = 600.0

STOPS = [{"time": 0.1 * k, "position": [0.015, 0.015, (0.06, 0.024)[k % 2]]} for k in range(101)]
PRESSING = {
    "boundaries": [
        {"name": "bin", "type": "box", "material": "steel", "low": [-0.02, -0.02, 0], "high": [0.06, 0.06, 0.3], "open": ["top"]}
    ],
    "tools": {"plate": {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "trajectory": STOPS}},
    "duration": 10.0,
}

pytestmark = pytest.mark.xdist_group("processes")


def sand_sim(folder, *words):
    command = [sys.executable, "-m", "sand_sim", *map(str, words)]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def run(folder, scene, out, *words):
    """A run to its end; what it said."""
    process = sand_sim(folder, "run", scene, "--out", out, "--checkpoint", f"{out}_states", "--checkpoint-period", 0, *words)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return output, errors


def killed(folder, scene, out, delay, *words):
    """A run that is killed a while after it has begun to step; whether it was still running, and what it said."""
    process = sand_sim(folder, "run", scene, "--out", out, "--checkpoint", f"{out}_states", "--checkpoint-period", 0, *words)
    states = folder / f"{out}_states"
    before, begin = sorted(states.glob("*.checkpoint")), time.monotonic()
    while sorted(states.glob("*.checkpoint")) == before and process.poll() is None and time.monotonic() - begin < PATIENCE:
        time.sleep(0.002)
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    _, errors = process.communicate(timeout=PATIENCE)
    return process.returncode == -signal.SIGKILL, errors


def assert_same_end(folder, out, expected, name):
    """Last states and whole histories of two runs."""
    newest = [sorted((folder / f"{one}_states").glob("*.checkpoint"))[-1] for one in (out, expected)]
    found, wanted = (read_checkpoint(path) for path in newest)
    assert found.header == wanted.header
    assert found.state.keys() == wanted.state.keys()
    active = int(wanted.state["grains.number"])
    for key, array in wanted.state.items():
        end = active + 1 if key.endswith(".starts") else None  # beyond the grains that are left they mean nothing
        np.testing.assert_array_equal(found.state[key][:end] if end else found.state[key], array[:end] if end else array, key)
    with np.load(folder / out / f"{name}.npz") as found, np.load(folder / expected / f"{name}.npz") as wanted:
        assert set(found) == set(wanted)
        for key in wanted:
            if key != "wall":
                np.testing.assert_array_equal(found[key], wanted[key], err_msg=key)


def kill_again_and_again(folder, scene, name, kills, longest, *words):
    """Number of kills that hit a running process, and of those that left a checkpoint half written."""
    run(folder, scene, "whole", *words)
    chance, hits, torn = random.Random(7), 0, 0
    for k in range(kills):
        hit, errors = killed(folder, scene, "broken", chance.uniform(0.0, longest), *words, *(["--resume"] if k else []))
        hits += hit
        torn += bool(list((folder / "broken_states").glob(".*.writing")))
        assert "Traceback" not in errors
        if k:
            assert "resumed from" in errors
    output, errors = run(folder, scene, "broken", *words, "--resume")
    assert "resumed from" in errors
    assert "from-" in output, "the recording of the broken run is left as it is"
    assert_same_end(folder, "broken", "whole", name)
    assert not list((folder / "broken_states").glob(".*.writing"))
    return hits, torn


def test_two_kills(tmp_path):
    scene = write_small_scene(tmp_path, **PRESSING)
    hits, _ = kill_again_and_again(tmp_path, scene, "small", 2, 0.5)
    assert hits == 2


@pytest.mark.slow
def test_many_kills_while_checkpoints_are_written(tmp_path):
    scene = write_small_scene(tmp_path, **PRESSING)
    hits, torn = kill_again_and_again(tmp_path, scene, "small", 20, 0.5)
    print(f"{hits} of 20 kills hit, {torn} of them while a checkpoint was being written")
    assert hits == 20
    assert torn >= 1


@pytest.mark.slow
def test_kills_in_a_dig(tmp_path):
    hits, _ = kill_again_and_again(tmp_path, "dig", "dig", 6, 3.0, "--threads", 1, "--duration", 1.2)
    assert hits == 6


def test_resume_without_anything_there_begins_anew(tmp_path):
    scene = write_small_scene(tmp_path, duration=0.1)
    _, errors = run(tmp_path, scene, "fresh", "--resume")
    assert "starting from the beginning" in errors
    run(tmp_path, scene, "whole")
    assert_same_end(tmp_path, "fresh", "whole", "small")


def test_a_damaged_checkpoint_is_named_and_the_one_before_used(tmp_path):
    scene = write_small_scene(tmp_path, duration=0.2)
    run(tmp_path, scene, "whole")
    run(tmp_path, scene, "broken")
    newest = sorted((tmp_path / "broken_states").glob("*.checkpoint"))[-1]
    newest.write_bytes(bytes(newest.stat().st_size))
    _, errors = run(tmp_path, scene, "broken", "--resume")
    assert f"{newest.name}: is no checkpoint" in errors
    assert_same_end(tmp_path, "broken", "whole", "small")


def test_refusals(tmp_path):
    scene = write_small_scene(tmp_path, duration=0.1)
    run(tmp_path, scene, "some")
    for words, reason in (
        (["--resume"], "--checkpoint FOLDER"),
        (["--checkpoint-period", "5"], "--checkpoint-period: give the folder for checkpoints with --checkpoint FOLDER"),
        (["--checkpoint", "small.yaml"], "checkpoint folder small.yaml: File exists"),
        (["--checkpoint", "some_states", "--checkpoint-period", "-1"], "period of checkpoints: must be 0 s or more"),
    ):
        process = sand_sim(tmp_path, "run", scene, *words)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 1
        assert reason in errors
        assert len(errors.strip().splitlines()) == 1
    write_small_scene(tmp_path, duration=0.1, gravity=[0.0, 0.0, -1.6])
    process = sand_sim(tmp_path, "run", scene, "--checkpoint", "some_states", "--resume")
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "made in another scene: gravity.2 is -9.81 there and -1.6 here" in errors


def test_files_that_cannot_be_written_do_not_stop_a_run(tmp_path):
    """The simulation goes to its end, each trouble is one line, and the exit code tells."""
    scene = write_small_scene(tmp_path)
    for kind in ("rrd", "npz", "json", "png"):
        (tmp_path / "blocked" / f"small.{kind}").mkdir(parents=True)
    process = sand_sim(tmp_path, "run", scene, "--out", "blocked")
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "0.40 s in" in output
    assert "Traceback" not in errors
    lines = [line for line in errors.splitlines() if "blocked" in line]
    assert sum("goes on" in line for line in lines) == 1
    assert len(lines) == 5, errors  # that one, and each file at the end
