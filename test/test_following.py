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
