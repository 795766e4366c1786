"""States of a running simulation: saved, loaded, kept and resumed, with the commands that wait."""

import json
import threading
from collections import Counter

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import ToolPose, World, load_scene
from sand_sim.checkpoint import CheckpointError, read_checkpoint
from sand_sim.checkpoints import CheckpointFolder
from sand_sim.courses import Courses, StampRules
from sand_sim.pending import pack_told, unpack_told
from sand_sim.simulation import Simulation
from sand_sim.sinks.run_log import RunLog
from sand_sim.tool_motion.playing import commands_at, frame_times

MIDDLE = 0.25
POSE = {"kind": "pose", "tool": "plate", "position": [0, 0, 0.1], "orientation": [0, 0, 0, 1], "time": 1.0}
TIMES = dict.fromkeys(("last_stamp", "followed_stamp", "last_taken", "promised"))


class Running:
    """A simulation in lockstep with the history it has written."""

    def __init__(self, scene, resume=False, folder=None, pacing="lockstep"):
        world = World(scene)
        self.log, self.faults, self.told = RunLog(scene), [], []
        self._news = threading.Condition()
        checkpoints = CheckpointFolder(folder, scene.name, 0.0, self.told.append) if folder else None
        self.simulation = Simulation(
            world,
            pacing,
            on_frame=self._show,
            on_fault=self.faults.append,
            checkpoints=checkpoints,
            pack_history=self.log.pack,
            unpack_history=self.log.unpack,
        )
        if resume:
            self.simulation.resume()

    def __enter__(self):
        self.simulation.start()
        return self

    def __exit__(self, *_):
        self.simulation.stop()
        assert not self.faults

    def _show(self, observation):
        with self._news:
            self.log.write(observation)
            self._news.notify_all()

    def send(self, scene, begin, end):
        """Hand over all poses of the scene's trajectory between two times."""
        for at in frame_times(scene, end):
            if at > begin + 1e-6:
                for command in commands_at(scene, at):
                    self.simulation.submit(command)

    def wait_until(self, time, patience=30.0):
        with self._news:
            assert self._news.wait_for(lambda: self.log.last and self.log.last.time > time - 1e-6, patience)


@pytest.fixture
def scene(tmp_path):
    return load_scene(write_small_scene(tmp_path))


@pytest.fixture
def uninterrupted(scene):
    """History and last state of a run that nothing disturbed."""
    with Running(scene) as running:
        running.send(scene, 0.0, scene.duration)
        running.wait_until(scene.duration)
        return running.log.columns(), running.simulation.world.save()


def assert_equal(running, uninterrupted):
    columns, state = running.log.columns(), running.simulation.world.save()
    for name, column in uninterrupted[0].items():
        if name != "wall":
            np.testing.assert_array_equal(columns[name], column, err_msg=name)
    for name, array in uninterrupted[1].items():
        np.testing.assert_array_equal(state[name], array, err_msg=name)


def test_waiting_poses_are_part_of_a_state(scene, uninterrupted, tmp_path):
    """Saved when half of the poses are still queued; a new simulation needs nobody to send them again."""
    path = tmp_path / "states" / "half.checkpoint"
    with Running(scene) as running:
        simulation = running.simulation
        simulation.submit(ToolPose("plate", [0.0, 0.0, np.nan], [0.0, 0.0, 0.0, 1.0], 1.0))
        running.send(scene, 0.0, scene.duration)
        running.wait_until(0.05)
        saved = simulation.save_state(path)
        assert saved.result(30.0) == path
    checkpoint = read_checkpoint(path)
    assert 0.04 < checkpoint.time < 0.3
    assert len(checkpoint.commands["courses"]["plate"]["waiting"]) > 3
    assert checkpoint.commands["rejected"] == {"not_finite": 1}
    with Running(scene) as running:
        assert running.simulation.load_state(path).result(30.0) == pytest.approx(checkpoint.time)
        running.wait_until(scene.duration)
        assert running.simulation.rejected == {"not_finite": 1}
        assert_equal(running, uninterrupted)


def test_what_tools_were_told_and_what_was_counted_come_back(scene):
    world = World(scene)
    courses = Courses(world, False, StampRules())
    courses.limited = 7
    course = courses.by_tool["plate"]
    course.last_stamp, course.followed_stamp, course.last_taken, course.promised = 0.375, 0.125, -np.inf, 0.5
    course.waiting.append(ToolPose("plate", np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.6, 0.0, 0.8]), 0.5))
    packed = json.loads(json.dumps(pack_told(courses, Counter({"late": 2}), 0.75 * world.frame_steps * world.time_step)))
    by_tool, rejected, limited, frame_end = unpack_told(packed, world)
    assert (rejected, limited) == ({"late": 2}, 7)
    assert frame_end == pytest.approx(0.75 * world.frame_steps * world.time_step)
    waiting, expected = by_tool["plate"].waiting.pop(), course.waiting.pop()
    assert by_tool == courses.by_tool
    for name, value in vars(expected).items():
        assert np.array_equal(getattr(waiting, name), value), name


def test_a_state_is_loaded_into_the_running_simulation(scene, uninterrupted, tmp_path):
    path = tmp_path / "there.checkpoint"
    with Running(scene) as running:
        running.send(scene, 0.0, MIDDLE + 0.01)
        running.wait_until(MIDDLE)
        loaded = [running.simulation.save_state(path), running.simulation.load_state(path)][1]  # not waiting for the file
        assert loaded.result(30.0) >= MIDDLE - 1e-6
        running.simulation.reset().result(30.0)
        running.simulation.load_state(path).result(30.0)
        running.send(scene, running.simulation.courses.promised, scene.duration)
        running.wait_until(scene.duration)
        assert_equal(running, uninterrupted)


def test_a_bad_file_changes_nothing_and_is_named(scene, uninterrupted, tmp_path):
    path = tmp_path / "bad.checkpoint"
    path.write_bytes(b"sand_sim checkpoint 2\n" + bytes(1000))
    with Running(scene) as running:
        running.send(scene, 0.0, scene.duration)
        running.wait_until(MIDDLE)
        for bad in (path, tmp_path / "missing", tmp_path):
            with pytest.raises(CheckpointError, match=f"{bad}: "):
                running.simulation.load_state(bad).result(30.0)
        blocked = tmp_path / "file"
        blocked.touch()
        with pytest.raises(CheckpointError, match=r"cannot be written: File exists: .*file"):
            running.simulation.save_state(blocked / "below").result(30.0)
        running.wait_until(scene.duration)
        assert_equal(running, uninterrupted)


@pytest.mark.parametrize(
    "commands",
    [
        {"courses": {"spade": {"waiting": []}}},
        {"courses": {"plate": {"waiting": []}}},
        {"courses": {"plate": 3}},
        {"courses": {"plate": TIMES | {"waiting": [POSE | {"orientation": [0, 0, 0, 0]}]}}},
        {"courses": {"plate": TIMES | {"waiting": [POSE | {"tool": "spade"}]}}},
        {"courses": {"plate": TIMES | {"waiting": [POSE | {"position": [0, float("nan"), 0]}]}}},
        {"courses": {"plate": TIMES | {"waiting": [POSE | {"time": None}]}}},
        {"courses": {"plate": TIMES | {"waiting": [POSE | {"more": 1}]}}},
        {"courses": {"plate": TIMES | {"promised": "soon", "waiting": []}}},
        {"rejected": {"late": "often"}},
        {"limited": float("inf")},
    ],
)
def test_a_strangers_commands_are_refused(scene, tmp_path, commands):
    from sand_sim.checkpoint import take_checkpoint, write_checkpoint

    path = tmp_path / "strange.checkpoint"
    with Running(scene) as running:
        running.send(scene, 0.0, 0.1)
        running.wait_until(0.1)
        write_checkpoint(path, take_checkpoint(World(scene), commands))
        with pytest.raises(CheckpointError, match=r"strange\.checkpoint: commands"):
            running.simulation.load_state(path).result(30.0)
        assert running.simulation.world.time == pytest.approx(0.1)


def test_a_state_brings_a_simulation_back_after_a_fault(scene, tmp_path):
    path = tmp_path / "good.checkpoint"
    running = Running(scene, pacing="fast")
    with running:
        running.wait_until(0.1)
        running.simulation.pause(True)
        running.simulation.save_state(path).result(30.0)
        broken = running.simulation.world.save()
        broken["grains.half_motion"][0] = [1e6, 0.0, 0.0]
        running.simulation.world.restore(broken)
        with pytest.raises(Exception, match="blown up"):
            running.simulation.step().result(30.0)
        assert running.simulation.fault is not None
        running.simulation.load_state(path).result(30.0)
        assert running.simulation.fault is None
        running.simulation.step().result(30.0)
        running.faults.clear()


def test_resumed_after_a_stop_at_any_moment(scene, uninterrupted, tmp_path):
    """Stopped and resumed again and again; the end is that of a run in one piece, and so is its history."""
    end = 0.0
    for k in range(6):
        with Running(scene, resume=k > 0, folder=tmp_path / "kept") as running:
            simulation = running.simulation
            if k:
                assert "resumed from" in running.told[0]
                assert simulation.world.time >= end - 1e-6
            begin = max(simulation.world.time, simulation.courses.promised)
            running.send(scene, begin, scene.duration)
            running.wait_until(min(0.07 * (k + 1), scene.duration))
            end = simulation.world.time
    with Running(scene, resume=True, folder=tmp_path / "kept") as running:
        running.wait_until(scene.duration)
        assert_equal(running, uninterrupted)
