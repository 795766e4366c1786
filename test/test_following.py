"""Tools on the trajectories of a scene: every waypoint is passed, also those between two frames."""

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import SceneError, World, follow, frame_times, load_scene
from sand_sim.tool_motion.track import pose_on_trajectory

HIGH, LOW = [0.015, 0.015, 0.03], [0.015, 0.015, 0.0232]  # the bed's top is at 0.02, the plate two particles and 4 mm thick


def plate_on(tmp_path, stops, **further):
    trajectory = [{"time": time, "position": position} for time, position in stops]
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 10.0, "trajectory": trajectory}
    return World(load_scene(write_small_scene(tmp_path, tools={"plate": plate}, **further)))


def test_a_waypoint_between_two_frames_is_passed(tmp_path):
    """A plate that dips into the bed and is back before the frame ends has pushed it, as much as one that is looked at often."""
    stops = [(0.0, HIGH), (0.005, LOW), (0.01, HIGH), (0.04, HIGH)]
    seldom, often = plate_on(tmp_path, stops), plate_on(tmp_path, stops, frame_rate=1000)
    follow(seldom, 0.02)
    for end in list(frame_times(often.scene))[:20]:
        follow(often, end)
        often.observe()
    assert often.time == pytest.approx(seldom.time, abs=1e-9)
    work = seldom.observe().tool("plate").work
    assert work > 1e-4
    assert work == pytest.approx(often.observe().tool("plate").work, rel=0.01)
    assert seldom.observe().tool("plate").position == pytest.approx(HIGH)


@pytest.mark.parametrize("turns", [8, 10, 5])
def test_a_blade_turns_as_told_however_seldom_it_is_looked_at(tmp_path, turns):
    """So many turns a second with four waypoints each, at ten frames a second; its corner goes round, so work is done."""
    trajectory = [
        {"time": k / (4 * turns), "position": [0, 0, 0.2], "rpy": [0, 0, 90 * k * np.pi / 180]} for k in range(2 * turns)
    ]
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 10.0, "trajectory": trajectory}
    world = World(load_scene(write_small_scene(tmp_path, tools={"plate": plate}, frame_rate=10.0)))
    for end in list(frame_times(world.scene))[:3]:
        follow(world, end)
        report = world.observe().tool("plate")
        meant = pose_on_trajectory(world.scene.tools[0].trajectory, world.time)[1]
        assert abs(report.orientation @ meant) == pytest.approx(1.0, abs=1e-6)
        assert report.spin == pytest.approx([0.0, 0.0, 2.0 * np.pi * turns], rel=1e-6)


@pytest.mark.parametrize(("frame_rate", "turns"), [(10.0, 8), (50.0, 8), (10.0, 3)])
def test_a_blade_turns_and_sinks_as_a_motion_tells(tmp_path, frame_rate, turns):
    """As many turns a second, whatever the frame rate, from one line."""
    motion = {"time": 1.0, "velocity": [0.0, 0.0, -0.1], "spin": [0.0, 0.0, 2.0 * np.pi * turns]}
    trajectory = [{"time": 0.05, "position": [0, 0, 0.2]}, motion]
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 10.0, "trajectory": trajectory}
    world = World(load_scene(write_small_scene(tmp_path, tools={"plate": plate}, frame_rate=frame_rate)))
    follow(world, 0.05)
    for end in (0.1, 0.2, 0.3):
        follow(world, end)
        report, passed = world.observe().tool("plate"), world.time - 0.05
        assert report.position == pytest.approx([0.0, 0.0, 0.2 - 0.1 * passed], abs=1e-6)
        half = np.pi * turns * passed
        assert abs(report.orientation @ [0.0, 0.0, np.sin(half), np.cos(half)]) == pytest.approx(1.0, abs=1e-6)
        assert report.spin == pytest.approx([0.0, 0.0, 2.0 * np.pi * turns], rel=1e-6)


def test_a_plate_vibrates_though_its_period_is_that_of_the_frames(tmp_path):
    """``A sin(2 pi f t)``, and ``2 pi f A cos(2 pi f t)`` to a sixteenth of the peak; at each frame it is where it began."""
    sine = {"time": 1.0, "oscillation": {"amplitude": [0.0, 0.0, 1e-3], "frequency": 20.0}}
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 10.0}
    plate |= {"trajectory": [{"time": 0.0, "position": [0.0, 0.0, 0.2]}, sine]}
    world = World(load_scene(write_small_scene(tmp_path, tools={"plate": plate}, frame_rate=20.0)))
    follow(world, 0.05)
    assert world.observe().tool("plate").position == pytest.approx([0.0, 0.0, 0.2], abs=2e-6)
    for end in np.linspace(0.051, 0.1, 23):
        follow(world, end)
        report, phase = world.observe().tool("plate"), 2.0 * np.pi * 20.0 * world.time
        assert report.position[2] - 0.2 == pytest.approx(1e-3 * np.sin(phase), abs=2e-6)
        assert report.velocity[2] == pytest.approx(0.126 * np.cos(phase), abs=0.126 / 16.0)


def test_a_motion_that_is_too_fast_is_refused_before_the_run(tmp_path):
    """The speed of a corner of the plate: it turns on an arm of 42 mm, and swings at up to 0.63 m/s."""
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 1.0}
    for motion, speed in (
        ({"spin": [0.0, 0.0, 30.0]}, "1.3"),
        ({"velocity": [0.0, 0.5, 0.0], "oscillation": {"amplitude": [0.0, 0.0, 1e-3], "frequency": 100.0}}, "1.13"),
    ):
        tools = {"plate": plate | {"trajectory": [{"time": 0.0, "position": [0.0, 0.0, 0.2]}, {"time": 1.0} | motion]}}
        with pytest.raises(SceneError, match=rf"tools.plate.trajectory\[1\]: on the way there .* moves at {speed}"):
            World(load_scene(write_small_scene(tmp_path, tools=tools)))


def test_waypoints_closer_than_a_step_are_left_out(tmp_path):
    """The tool is where it should be again at the next."""
    stops = [(0.0, HIGH), (0.01, LOW), *((0.01 + 1e-7 * k, LOW) for k in range(1, 10)), (0.03, HIGH)]
    world = plate_on(tmp_path, stops)
    follow(world, 0.04)
    assert world.observe().tool("plate").position == pytest.approx(HIGH)


def test_a_tool_that_begins_too_far_from_its_trajectory_is_refused_before_the_run(tmp_path):
    stops = [{"time": 0.0, "position": HIGH}, {"time": 0.001, "position": HIGH}, {"time": 0.1, "position": HIGH}]
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 1.0, "trajectory": stops}
    plate |= {"pose": {"position": [0.015, 0.015, 0.035]}}  # 5 mm, which is near enough for a frame but not for its first pose
    with pytest.raises(SceneError, match=r"tools.plate.pose: is 0.005 m from where the trajectory has it 0.001 s later"):
        World(load_scene(write_small_scene(tmp_path, tools={"plate": plate})))
