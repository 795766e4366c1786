"""Pacing, commands and requests of a running world, without ROS."""

import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import ToolPose, World, load_scene
from sand_sim.simulation import Simulation
from sand_sim.tool_motion.playing import commands_at, frame_times

NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
START = np.array([0.015, 0.015, 0.06])


class Running:
    """A simulation with the observations it has shown."""

    def __init__(self, scene, pacing, **further):
        self.shown, self.faults = [], []
        self._news = threading.Condition()
        self.simulation = Simulation(World(scene), pacing, on_frame=self._show, on_fault=self.faults.append, **further)

    def __enter__(self):
        self.simulation.start()
        return self

    def __exit__(self, *_):
        self.simulation.stop()
        assert not self.faults

    def _show(self, observation):
        with self._news:
            self.shown.append(observation)
            self._news.notify_all()

    def wait_for(self, condition, patience=30.0):
        """Wait until a condition on the observations holds."""
        with self._news:
            assert self._news.wait_for(lambda: condition(self.shown), patience), "nothing came of it"


@pytest.fixture
def scene(tmp_path):
    return load_scene(write_small_scene(tmp_path))


def pose(position, at=None):
    return ToolPose("plate", np.asarray(position, float), NO_TURN, at)


def test_lockstep_equals_plain_stepping(scene):
    """The trajectory through the simulation thread, and by hand, to the bit."""
    world = World(scene)
    for at in frame_times(scene):
        for command in commands_at(scene, at):
            world.apply(command)
        world.step(world.frame_steps)
    expected = world.observe()
    with Running(scene, "lockstep") as running:
        for at in frame_times(scene):
            for command in commands_at(scene, at):
                running.simulation.submit(command)
        running.wait_for(lambda shown: shown and shown[-1].time > scene.duration - 1e-6)
    found = running.shown[-1]
    assert np.array_equal(found.grains.position, expected.grains.position)
    assert np.array_equal(found.grains.spin, expected.grains.spin)
    assert found.tools[0].position == pytest.approx(expected.tools[0].position, abs=1e-15)
    times = [observation.time for observation in running.shown]
    assert times == pytest.approx([0.0, *frame_times(scene)], abs=1e-9)


def test_lockstep_waits_for_poses(scene):
    with Running(scene, "lockstep") as running:
        running.wait_for(lambda shown: len(shown) == 1)
        time.sleep(0.2)
        assert running.simulation.world.time == 0.0
        running.simulation.submit(pose(START, 0.013))  # not a whole frame
        running.wait_for(lambda shown: len(shown) == 2)
        assert running.shown[-1].time == pytest.approx(0.013, abs=3e-5)
        running.simulation.submit(pose(START, 0.05))
        running.wait_for(lambda shown: shown[-1].time > 0.049)
        assert [o.time for o in running.shown[2:]] == pytest.approx([0.02, 0.04, 0.05], abs=3e-5)


def test_lockstep_rejects_poses_out_of_order(scene):
    with Running(scene, "lockstep") as running:
        for at in (0.1, None, 0.05):
            running.simulation.submit(pose(START, at))
        running.wait_for(lambda shown: shown and shown[-1].time > 0.099)
        assert running.simulation.rejected == {"out_of_order": 1, "no_stamp": 1}
        assert "must be later than 0.1" in running.simulation.last_rejection


def test_bad_commands_are_counted_and_do_no_harm(scene):
    with Running(scene, "lockstep") as running:
        for position, at in (([np.nan, 0, 0], 0.1), ([5.0, 0, 0], 0.02)):
            running.simulation.submit(pose(position, at))
        running.simulation.submit(ToolPose("plate", START, np.zeros(4), 0.1))
        running.simulation.submit(ToolPose("spade", START, NO_TURN, 0.1))
        running.wait_for(lambda shown: shown and shown[-1].time > 0.019)
        assert running.simulation.rejected == {"not_finite": 1, "zero_quaternion": 1, "unknown_tool": 1, "too_fast": 1}
        assert running.shown[-1].tools[0].position == pytest.approx(START)


def test_step_and_pause(scene):
    with Running(scene, "fast") as running:
        running.simulation.pause(True)
        running.wait_for(lambda shown: shown)
        time.sleep(0.1)
        held = running.simulation.world.time
        time.sleep(0.2)
        assert running.simulation.world.time == held
        running.simulation.step().result(30.0)
        assert running.simulation.world.time == pytest.approx(held + 0.02, abs=2e-5)
        running.simulation.pause(False)
        running.wait_for(lambda shown: shown[-1].time > held + 0.2)


def test_reset_begins_anew(scene):
    with Running(scene, "lockstep") as running:
        running.simulation.submit(pose(START - [0.0, 0.0, 0.03], 0.2))
        running.wait_for(lambda shown: shown and shown[-1].time > 0.199)
        first = running.shown[-1]
        running.simulation.reset().result(30.0)
        assert running.shown[-1].time == 0.0
        assert running.shown[-1].tools[0].position == pytest.approx(START)
        running.simulation.submit(pose(START - [0.0, 0.0, 0.03], 0.2))
        running.wait_for(lambda shown: shown[-1].time > 0.199)
        assert np.array_equal(running.shown[-1].grains.position, first.grains.position)


@pytest.mark.parametrize("loaded", [True, False])
def test_poses_on_their_way_at_a_reset_hold_up_no_others(scene, tmp_path, loaded):
    with Running(scene, "realtime") as running:
        simulation = running.simulation
        simulation.pause(True)
        simulation.reset().result(30.0)
        path = simulation.save_state(tmp_path / "begin.state").result(30.0)
        for _ in range(40):
            simulation.step().result(30.0)
        (simulation.load_state(path) if loaded else simulation.reset()).result(30.0)
        for position, at in ((START, 0.8), (START - [0.0, 0.0, 0.002], 0.02)):
            simulation.submit(pose(position, at))
            simulation.request(bool).result(30.0)  # so that they do not come together
        simulation.step().result(30.0)
        assert running.shown[-1].tools[0].position == pytest.approx(START - [0.0, 0.0, 0.002], abs=1e-9)
        assert simulation.rejected == {}


def test_real_time_follows_the_wall_clock(scene):
    with Running(scene, "realtime", real_time_factor=0.5) as running:
        running.wait_for(lambda shown: shown)
        begin, first = time.monotonic(), running.simulation.world.time
        running.wait_for(lambda shown: shown[-1].time > first + 0.5)
        assert time.monotonic() - begin > 0.9


def test_it_goes_on_at_once_from_a_later_state(scene, tmp_path):
    """A frame takes a second of wall time; a clock that had gone on from time zero would stand still for 40 s."""
    with Running(scene, "realtime", real_time_factor=0.02) as running:
        for _ in range(40):
            running.simulation.step().result(30.0)
        path = running.simulation.save_state(tmp_path / "late.state").result(30.0)
        running.simulation.reset().result(30.0)
        begin = running.simulation.load_state(path).result(30.0)
        running.wait_for(lambda shown: shown[-1].time > begin + 0.01, patience=10.0)
        assert running.shown[-1].time == pytest.approx(begin + 0.02, abs=1e-4)


def test_streamed_poses_are_reached_after_their_own_interval(scene):
    """Poses without stamps, every 20 ms of simulated time: the plate moves evenly at the commanded speed."""
    with Running(scene, "fast") as running:
        simulation = running.simulation
        simulation.pause(True)
        running.wait_for(lambda shown: shown)
        for k in range(1, 11):
            simulation.submit(pose(START - [0.0, 0.0, 0.002 * k]))
            simulation.step().result(30.0)
        report = running.shown[-1].tools[0]
        assert report.velocity == pytest.approx([0.0, 0.0, -0.1], abs=2e-3)
        assert START[2] - 0.02 <= report.position[2] <= START[2] - 0.0175


def test_of_poses_that_came_together_the_last_good_one_counts(scene):
    world = World(scene)
    simulation = Simulation(world, "fast")
    for k in range(5):
        simulation.submit(pose(START - [0.0, 0.0, 0.001 * k]))
    simulation.submit(pose([np.nan, 0.0, 0.0]))
    simulation.submit(pose(START + 1.0, at=1e-3))  # too fast
    simulation._take_in()
    assert simulation.rejected == {"not_finite": 1, "too_fast": 1}
    world.step(round((world.arrival("plate") - world.time) / world.time_step))
    assert world.observe().tools[0].position == pytest.approx(START - [0.0, 0.0, 0.004])
    assert simulation.courses.limited == 0, "it has all the time that passed since the poses before"


def test_streamed_poses_out_of_reach_are_approached_at_top_speed(scene):
    with Running(scene, "fast") as running:
        simulation = running.simulation
        simulation.pause(True)
        simulation.submit(pose(START + [0.0, 0.0, 0.4]))
        simulation.step().result(30.0)
        assert simulation.courses.limited == 1
        assert running.shown[-1].tools[0].velocity[2] == pytest.approx(1.0, rel=1e-3)


def test_stop_comes_soon_whatever_it_does(scene):
    with Running(scene, "fast") as running:
        running.wait_for(lambda shown: len(shown) > 2)
        begin = time.monotonic()
    assert time.monotonic() - begin < 5.0
    assert not running.simulation._thread.is_alive()


def test_a_request_that_nobody_waits_for_any_more_is_left_out(scene):
    with Running(scene, "lockstep") as running:
        simulation, held, done = running.simulation, threading.Event(), []
        first = simulation.request(lambda: held.wait(30.0))
        given_up, last = simulation.request(lambda: done.append("given up")), simulation.request(lambda: done.append("last"))
        assert given_up.cancel()
        held.set()
        assert first.result(30.0)
        last.result(30.0)
    assert done == ["last"]


def test_whoever_waits_is_answered_when_an_error_ends_the_stepping(scene):
    running = Running(scene, "lockstep")
    simulation = running.simulation
    broken, next_one = simulation.request(lambda: 1 / 0), simulation.step()  # taken in together
    simulation.start()
    with pytest.raises(ZeroDivisionError):
        broken.result(30.0)
    with pytest.raises(CancelledError):
        next_one.result(30.0)
    assert running.faults == [simulation.fault]
    assert simulation.step().cancelled()
    simulation.stop()


ABANDONED = """
import sys
from pathlib import Path

from sand_sim import World, load_scene
from sand_sim.simulation import Simulation

simulation = Simulation(World(load_scene(Path(sys.argv[1]))), sys.argv[2])
simulation.start()
simulation.step().result()
raise SystemExit("whoever was to stop it has failed")
"""


@pytest.mark.parametrize("pacing", ["lockstep", "realtime", "fast"])
def test_a_process_that_has_failed_ends(tmp_path, pacing):
    """As a test or a controller of a user's, which broke off before it could stop what it hosts: nothing waits for ever."""
    command = [sys.executable, "-c", ABANDONED, write_small_scene(tmp_path), pacing]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines() == ["whoever was to stop it has failed"]
