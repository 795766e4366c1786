"""A run that blows up is stopped within a frame, keeps its last good state, and says why; all through the public interface."""

import json
import re
import subprocess
import sys
import threading

import numpy as np
import pytest
import trimesh
from scenes import floor, write_small_scene

from sand_sim import SceneError, UnstableError, World, load_scene
from sand_sim.simulation import Simulation
from sand_sim.tool_motion.playing import commands_at, frame_times
from sand_sim.tool_motion.track import pose_on_trajectory

FORCED = {"time_step": 9.0e-4, "force_time_step": True}
LOW_FLOOR = [{"name": "floor", "type": "plane", "material": "steel", "point": [0, 0, -0.02], "normal": [0, 0, 1]}]


def small_world(folder, boundaries=None, **solver):
    further = {"boundaries": boundaries} if boundaries else {}
    return World(load_scene(write_small_scene(folder, solver=solver, **further)))


def play(world):
    for time in frame_times(world.scene):
        for command in commands_at(world.scene, time):
            world.apply(command)
        world.step(round((time - world.time) / world.time_step))
        yield world.observe()


def safe_step_in(message):
    return float(re.search(r"a time step of (\S+) s would be safe", message).group(1))


def test_force_time_step_is_needed_and_warned_about(tmp_path):
    with pytest.raises(SceneError, match=r"solver.time_step: .* times the safe step .* or set solver.force_time_step"):
        small_world(tmp_path, time_step=FORCED["time_step"])
    with pytest.raises(SceneError, match=r"solver.force_time_step: needs a 'time_step'"):
        small_world(tmp_path, force_time_step=True)
    with pytest.raises(SceneError, match=r"solver.force_time_step: must be true or false"):
        small_world(tmp_path, time_step=1e-5, force_time_step=1)
    world = small_world(tmp_path, **FORCED)
    assert "times the safe step" in world.assembly.time_step.warning
    assert any("time step" in doubt for doubt in world.observe().health.doubts)


def test_last_good_state_is_kept_and_named(tmp_path):
    # The grains fall freely for some frames, which no step spoils, before they meet the floor.
    world, shown = small_world(tmp_path, boundaries=LOW_FLOOR, **FORCED), []
    with pytest.raises(UnstableError) as caught:
        shown.extend(play(world))
    message = str(caught.value)
    assert re.search(r"grain \d+ moves by .* of its radius in one step|J, most of the energy there is, appeared", message)
    kept = float(re.search(r"kept is the state at t = (\S+) s", message).group(1))
    blown = float(re.search(r"blown up at t = (\S+) s", message).group(1))
    assert 0.0 < kept < blown <= world.scene.duration
    assert world.time == pytest.approx(kept, rel=1e-5)
    after = world.observe()
    before = next(one for one in shown if one.steps == after.steps)
    assert np.array_equal(after.grains.position, before.grains.position)
    assert np.array_equal(after.grains.velocity, before.grains.velocity)
    expected, _ = pose_on_trajectory(world.scene.tools[0].trajectory, world.time)  # on its way already to the pose after
    assert after.tools[0].position == pytest.approx(expected)
    assert after.health.kinetic == before.health.kinetic
    assert after.health.fastest < 1.0


def test_the_step_named_is_safe(tmp_path):
    world = small_world(tmp_path, **FORCED)
    with pytest.raises(UnstableError) as caught:
        list(play(world))
    safe = safe_step_in(str(caught.value))
    assert safe < 0.1 * FORCED["time_step"]
    observations = list(play(small_world(tmp_path, time_step=safe)))
    assert observations[-1].health.doubts == ()


def test_reset_brings_a_world_back(tmp_path):
    world = small_world(tmp_path, boundaries=LOW_FLOOR, **FORCED)
    first = [world.observe()]
    for _ in range(2):
        shown = []
        with pytest.raises(UnstableError):
            shown.extend(play(world))
        first.append(shown)
        world.reset()
        assert world.time == 0.0
        assert np.array_equal(world.observe().grains.position, first[0].grains.position)
    assert [one.time for one in first[1]] == [one.time for one in first[2]]


def test_a_grain_that_is_not_finite_is_named(make_world):
    """Two grains whose stiffness overflows single precision."""
    world = make_world(
        [[0.0, 0.0, 0.0], [0.0, 0.0, 0.009]],
        0.005,
        precision="single",
        time_step=1e-3,
        force_time_step=True,
        material={"density": 1e-30, "young": 1e30, "poisson": 0.25},
    )
    with pytest.raises(UnstableError, match=r"the velocity of grain [01] is not finite|moves by .* of its radius"):
        world.step(10)
    assert world.time == 0.0
    assert np.all(np.isfinite(world.observe().grains.position))


def test_energy_from_nowhere_stops_a_run(tmp_path):
    """With a step far too large the resting bed heats up before any grain crosses half its radius in a step."""
    safe = small_world(tmp_path).assembly.time_step.safe
    world = small_world(tmp_path, time_step=26.0 * safe, force_time_step=True)
    with pytest.raises(UnstableError, match=r"J, most of the energy there is, appeared from nowhere"):
        list(play(world))
    assert world.observe().health.gained < 1e-3 * world.observe().health.dissipated


@pytest.mark.parametrize("max_speed", [0.1, 50.0])
def test_energy_from_nowhere_is_told_however_fast_a_tool_may_be(make_world, tmp_path, max_speed):
    """A tool that does nothing must not widen what the balance puts up with."""
    trimesh.creation.box((0.01, 0.01, 0.01)).export(tmp_path / "idle.stl")
    tool = {"mesh": "idle.stl", "material": "wall", "particle_radius": 0.004, "max_speed": max_speed}
    places = np.stack(np.meshgrid(*3 * [0.0101 * np.arange(4.0)], indexing="ij"), -1).reshape(-1, 3) + [0.0, 0.0, 0.005]
    world = make_world(
        places,
        0.005,
        gravity=[0.0, 0.0, -9.81],
        boundaries=floor(),
        tools={"idle": tool | {"pose": {"position": [0.0, 0.0, 0.2]}}},
    )
    world.step(round(0.05 / world.time_step))
    assert not any("nowhere" in doubt for doubt in world.observe().health.doubts)
    state = world.save()
    for name in ("grains.motion", "grains.half_motion"):
        state[name][:, 2] += 0.05
    world.restore(state)
    assert any("appeared from nowhere" in doubt for doubt in world.observe().health.doubts)


def test_a_bed_that_blows_up_while_settling_is_refused(tmp_path):
    scene = load_scene(write_small_scene(tmp_path, solver=FORCED, settle={"time": 0.5}))
    with pytest.raises(SceneError, match=r"settle: the bed blows up while it settles: grain \d+ moves"):
        World(scene)


def test_overlap_at_the_start_is_a_doubt(make_world):
    world = make_world([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0075]], 0.005)
    doubts = world.observe().health.doubts
    assert any("grains overlap one another by 50 % of a radius at the start" in doubt for doubt in doubts)


def test_simulation_stops_answers_and_comes_back(tmp_path):
    faults, shown, changed = [], [], threading.Condition()

    def show(observation):
        with changed:
            shown.append(observation)
            changed.notify_all()

    def fail(error):
        with changed:
            faults.append(error)
            changed.notify_all()

    simulation = Simulation(small_world(tmp_path, **FORCED), "fast", on_frame=show, on_fault=fail)
    simulation.start()
    try:
        with changed:
            assert changed.wait_for(lambda: faults, 30.0)
        assert simulation.fault is faults[0]
        assert simulation.world.time == 0.0
        with pytest.raises(UnstableError):
            simulation.step().result(30.0)
        command = commands_at(simulation.world.scene, 0.1)[0]
        simulation.submit(command)
        number = len(shown)
        simulation.pause(True)
        simulation.reset().result(30.0)
        assert simulation.fault is None
        assert simulation.rejected == {"stopped": 1}
        assert len(shown) == number + 1
        assert shown[-1].time == 0.0
        assert len(faults) == 1
        simulation.pause(False)
        with changed:
            assert changed.wait_for(lambda: len(faults) == 2, 30.0)
    finally:
        simulation.stop()


def test_run_ends_with_one_line_and_keeps_what_was_recorded(tmp_path):
    scene = write_small_scene(tmp_path, solver=FORCED, boundaries=LOW_FLOOR)
    command = [sys.executable, "-m", "sand_sim", "run", scene, "--out", "results"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("sand_sim: ")]
    assert len(lines) == 1
    assert lines[0].startswith("sand_sim: blown up at t = ")
    assert "Traceback" not in done.stderr
    summary = json.loads((tmp_path / "results" / "small.json").read_text())
    assert 0.03 < summary["simulated_s"] < 0.4
    assert any("blown up" in doubt for doubt in summary["doubts"])
    assert len(np.load(tmp_path / "results" / "small.npz")["time"]) > 2
    assert "written: results/small.rrd" in done.stdout


@pytest.mark.parametrize("number", [2, 6000])
def test_keeping_the_last_good_state_is_cheap(make_world, number):
    """Measured against the steps of a frame: well under 3 % whatever the number of grains."""
    from time import perf_counter

    side = int(np.ceil(number ** (1 / 3)))
    lattice = np.stack(np.meshgrid(*[range(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:number]
    world = make_world(0.00999 * lattice, 0.005, precision="single")
    world.step(10)

    def quickest(work):
        times = []
        for _ in range(5):
            begin = perf_counter()
            work()
            times.append(perf_counter() - begin)
        return min(times)

    step = quickest(lambda: world._solver.run(20)) / 20
    world.observe()
    assert quickest(world._keep) < 0.03 * step * world.frame_steps, "beyond what an observation measures anyway"
