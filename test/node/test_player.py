"""``sand_sim play``: a client of its own that says what became of it."""

import signal
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE
from processes import kill
from scenes import write_small_scene

from sand_sim.tool_motion.playing import commands_at


@pytest.fixture
def play(tmp_path):
    """``play(...)`` starts a player of the small scene in another process."""
    started = []

    def start(*words):
        command = [sys.executable, "-X", "faulthandler", "-m", "sand_sim", "play", tmp_path / "small.yaml", *words]
        started.append(subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        kill(process)


def finish(process):
    try:
        _, errors = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGABRT)  # which tells where it hangs
        pytest.fail(f"it does not end: {process.communicate()[1]}")
    told = [line for line in errors.splitlines(keepends=True) if "waiting for" not in line]  # on a slow machine that comes first
    return process.returncode, "".join(told)


def test_it_comes_too_late_and_says_so(client, start_node, play):
    node = start_node(pacing="fast")
    client.wait_for(lambda: client.time > node.simulation.world.scene.duration)
    code, errors = finish(play())
    assert code == 1
    assert errors.startswith("sand_sim: nothing played: simulated time is ")
    assert "past the 0.4 s of scene 'small'; reset the node just before (ros2 service call /sand_sim/reset" in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize("asked", ["", "base"])
def test_poses_are_in_the_world_frame_of_the_node_or_the_one_that_is_asked_for(start_node, play, asked):
    node = start_node(
        pacing="lockstep", frame_id="map", **{"frame_names": ["base"], "frames.base.pose": [0.0, 0.0, 0.01, 0.0, 0.0, 0.0]}
    )
    code, errors = finish(play("--frame-id", asked) if asked else play())
    assert code == 0, errors
    scene, observe = node.simulation.world.scene, node.simulation.world.observe
    tool = node.simulation.request(observe).result(PATIENCE).tools[0]
    (last,) = commands_at(scene, scene.duration)
    assert tool.position == pytest.approx(last.position + np.array([0.0, 0.0, 0.01 if asked else 0.0]), abs=1e-6)
    assert node.simulation.rejected == {}


@pytest.mark.parametrize(
    ("parameters", "target", "missing"),
    [
        ({}, "another", "node 'another': nobody hears /another/tools/plate/pose"),
        ({"publish_clock": False}, "sand_sim", "node 'sand_sim': nobody tells the time on /clock"),
    ],
)
def test_it_says_what_it_waits_for(start_node, play, parameters, target, missing):
    start_node(pacing="lockstep", **parameters)
    process = play("--node", target)
    told = process.stderr.readline()
    if "nobody hears /sand_sim" in told:  # the two took long to find each other; what is missing then is told next
        told = process.stderr.readline()
    assert told == f"sand_sim: waiting for {missing}\n"
    process.send_signal(signal.SIGINT)
    assert finish(process) == (130, "")


def test_it_is_left_alone_and_says_so(client, start_node, play):
    node = start_node(pacing="lockstep", paused=True)
    process = play()
    client.wait_for(lambda: len(node.simulation.courses.by_tool["plate"].waiting) > 0)
    node.destroy_node()
    code, errors = finish(process)
    assert code == 1
    assert errors.startswith("sand_sim: node 'sand_sim' has gone, or takes no poses any more, at 0.00 s of 0.4 s")


def test_a_scene_without_a_path(tmp_path, play):
    write_small_scene(tmp_path)
    text = (tmp_path / "small.yaml").read_text()
    head, _, rest = text.partition("    trajectory:")
    assert rest
    (tmp_path / "small.yaml").write_text(head)
    code, errors = finish(play())
    assert code == 1
    assert "has no tool with a trajectory" in errors


@pytest.mark.parametrize("name", ["my arm", "", "1st"])
def test_a_name_that_no_node_can_have(tmp_path, play, name):
    write_small_scene(tmp_path)
    code, errors = finish(play("--node", name))
    assert code == 1
    assert errors.startswith(f"sand_sim: --node '{name}': ")
    assert len(errors.splitlines()) == 1
