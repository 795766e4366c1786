"""Which commands are taken, and where they lead a tool."""

from collections import Counter

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import ToolPose, World, load_scene, rotation
from sand_sim.border import ToolVelocity
from sand_sim.courses import Courses, StampRules

START = np.array([0.015, 0.015, 0.06])
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


class Driven:
    """A world whose tool follows its course, stepped by hand."""

    def __init__(self, folder, lockstep=False, **rules):
        self.world = World(load_scene(write_small_scene(folder)))
        self.courses = Courses(self.world, lockstep, StampRules(**rules))
        self.rejected, self.messages = Counter(), []

    def reject(self, error):
        self.rejected[error.reason] += 1
        self.messages.append(str(error))

    def take(self, *commands):
        self.courses.take(list(commands), self.reject)

    def go_to(self, time):
        while self.world.time < time - 0.5 * self.world.time_step:
            self.courses.begin_waiting(self.reject)
            until = min(time, self.courses.next_begin())
            self.world.step(max(1, round((until - self.world.time) / self.world.time_step)))

    @property
    def tool(self):
        return self.world.observe().tools[0]


@pytest.fixture
def driven(tmp_path):
    return Driven(tmp_path)


def pose(height, at=None, orientation=NO_TURN):
    return ToolPose("plate", START + [0.0, 0.0, height], orientation, at)


def velocity(linear, angular=(0.0, 0.0, 0.0), in_tool_frame=False, at=None):
    return ToolVelocity("plate", np.array(linear), np.array(angular), in_tool_frame, at)


def test_lockstep_tells_whom_it_waits_for(tmp_path):
    driven = Driven(tmp_path, lockstep=True)
    assert driven.courses.awaited() == ["plate"]
    driven.take(pose(0.0, 0.02))
    assert driven.courses.awaited() == []
    driven.go_to(0.02)
    assert driven.courses.awaited() == ["plate"]


@pytest.mark.parametrize(
    ("commands", "reason"),
    [
        ([pose(0.0, 100.0)], "future"),
        ([pose(0.0, 1.8e9)], "future"),  # the wall clock
        ([pose(0.0, 0.3)], "too_old"),
        ([pose(0.0, 1.02), pose(0.0, 1.01)], "out_of_order"),
        ([pose(0.0, 0.95), pose(0.0, 0.94)], "out_of_order"),
        ([pose(0.4, 1.02)], "too_fast"),
        ([velocity((np.inf, 0.0, 0.0))], "not_finite"),
    ],
)
def test_stamps_that_break_the_rules_are_refused(driven, commands, reason):
    driven.go_to(1.0)
    driven.take(*commands)
    assert driven.rejected == {reason: 1}
    assert "tool 'plate'" in driven.messages[0]
    driven.go_to(1.05)
    assert driven.tool.position == pytest.approx(START, abs=1e-12)


def test_limits_can_be_set(tmp_path):
    driven = Driven(tmp_path, oldest=0.1, furthest=0.5)
    driven.go_to(0.3)
    driven.take(pose(0.0, 0.19), pose(0.0, 0.81))
    assert driven.rejected == {"too_old": 1, "future": 1}
    driven.take(pose(0.0, 0.21), pose(0.0, 0.79))
    assert driven.rejected.total() == 2


def test_poses_ahead_of_time_are_passed_one_by_one(driven):
    """All of a path sent at once: the tool is at each of its poses at its time."""
    times = 0.02 * np.arange(1, 11)
    heights = 0.01 * np.sin(20.0 * times)
    driven.take(*(pose(height, time) for height, time in zip(heights, times, strict=True)))
    for height, time in zip(heights, times, strict=True):
        driven.go_to(time)
        assert driven.tool.position[2] - START[2] == pytest.approx(height, abs=1e-5)  # 1 step of up to 0.2 m/s
    assert not driven.rejected


def test_a_pose_without_stamp_replaces_all_that_wait(driven):
    driven.take(pose(0.0, 0.1), pose(0.05, 0.3))
    driven.go_to(0.05)
    driven.take(pose(0.01))
    driven.go_to(0.4)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.01])
    driven.take(pose(0.02, 0.42))
    driven.go_to(0.42)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.02]), "stamps begin anew behind what was discarded"
    assert not driven.rejected


@pytest.mark.parametrize("rounding", [-4e-10, 0.0, 4e-10])
def test_a_pose_stamped_now_is_no_pose_ahead(driven, rounding):
    """Stamps are rounded to nanoseconds: one of the clock's last time may lie above simulated time by less than nothing."""
    for k in range(1, 6):
        driven.go_to(0.02 * k)
        driven.take(pose(0.001 * k, driven.world.time + rounding))
    driven.go_to(0.115)
    assert not driven.rejected
    assert driven.courses.limited == 0
    assert driven.tool.velocity[2] == pytest.approx(0.05, rel=0.02)


def test_of_poses_with_one_stamp_the_last_counts(driven):
    """Ahead of time: while they wait for their turn, and while the tool is under way to the first of them."""
    driven.take(pose(0.001, 0.1), pose(0.0, 0.2), pose(0.003, 0.2))
    driven.go_to(0.15)
    driven.take(pose(0.005, 0.2))
    driven.go_to(0.2)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.005], abs=1e-6)
    driven.take(pose(0.005, 0.4), pose(0.007, 0.6))
    driven.go_to(0.3)
    driven.take(pose(0.009, 0.6))
    driven.go_to(0.4)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.005], abs=1e-6), "what is to be passed before is passed"
    driven.go_to(0.6)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.009], abs=1e-6)
    assert not driven.rejected
    assert driven.courses.alike == 3


def test_the_last_of_one_stamp_comes_too_late_for_its_time(driven):
    driven.take(pose(0.0, 0.1))
    driven.go_to(0.099)
    driven.take(pose(0.05, 0.1))
    driven.go_to(0.2)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.05], abs=1e-6)
    assert not driven.rejected
    assert driven.courses.limited == 1


def test_a_stream_faster_than_its_clock_keeps_its_speed_and_reaches_its_goal(driven):
    """A pose every 2 ms, stamped by a clock that ticks every 20 ms."""
    heights = []
    for k in range(1, 251):
        driven.go_to(0.002 * k)
        heights.append(driven.tool.position[2])
        driven.take(pose(0.0002 * min(k, 200), 0.02 * (k // 10)))
    assert not driven.rejected
    assert driven.courses.alike > 200
    assert np.diff(heights[100:200]) / 0.002 == pytest.approx([0.1] * 99, rel=0.15)
    driven.go_to(0.55)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.04], abs=1e-6)


def test_in_lockstep_the_first_of_one_stamp_counts(tmp_path):
    """Whether time has gone on to that stamp when the second comes must not matter."""
    driven = Driven(tmp_path, lockstep=True)
    driven.take(pose(0.001, 0.1), pose(0.002, 0.1))
    driven.go_to(0.1)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.001], abs=1e-6)
    assert driven.rejected == {"out_of_order": 1}
    assert driven.courses.alike == 0


def test_in_lockstep_time_goes_as_far_as_the_stamps_of_all_tools_that_are_driven(tmp_path):
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003}
    tools = {name: plate | {"pose": {"position": [0.0, 0.0, height]}} for name, height in (("a", 0.1), ("b", 0.15), ("c", 0.2))}
    world = World(load_scene(write_small_scene(tmp_path, tools=tools)))
    courses, errors = Courses(world, True, StampRules()), []
    known = [courses.promised]
    for tool, at in (("a", 0.04), ("b", 0.02), ("b", 0.06), ("a", 0.05)):  # nobody drives c
        courses.take([ToolPose(tool, world.observe().tool(tool).position, NO_TURN, at)], errors.append)
        known.append(courses.promised)
    assert not errors
    assert known == [-np.inf, 0.04, 0.02, 0.04, 0.05]


def test_after_a_stray_stamp_a_pose_without_one_begins_anew(driven, tmp_path):
    driven.take(pose(0.0, 50.0), pose(0.01, 0.1))
    assert driven.rejected == {"out_of_order": 1}
    assert driven.messages[0].endswith("send one without a stamp, which replaces all before it, or reset, to begin anew")
    driven.take(pose(0.0))
    driven.take(pose(0.01, 0.1))
    driven.go_to(0.1)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.01], abs=1e-6)
    assert driven.rejected.total() == 1
    lockstep = Driven(tmp_path, lockstep=True)
    lockstep.take(pose(0.0, 50.0), pose(0.01, 0.1))
    assert lockstep.messages[0].endswith("the stamp of the command before; reset to begin anew"), (
        "where none may be without a stamp"
    )


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("late", [pose(0.01, 1.0), pose(0.01, 0.99), velocity((0.0, 0.0, 0.1), at=1.0)])
@pytest.mark.parametrize("first", [0.02, 0.0])
def test_what_was_on_its_way_at_a_reset_is_forgotten(driven, together, late, first):
    driven.go_to(1.0)
    driven.world.reset()
    driven.courses.clear()
    driven.courses.heed_late_ones(1.0)
    for commands in [[late, pose(-0.002, first)]] if together else [[late], [pose(-0.002, first)]]:
        driven.take(*commands)
    driven.take(pose(-0.004, 0.04), pose(-0.006, 1.5))
    driven.go_to(0.04)
    assert driven.tool.position[2] == pytest.approx(START[2] - 0.004, abs=1e-9)
    driven.go_to(1.5)
    assert driven.tool.position[2] == pytest.approx(START[2] - 0.006, abs=1e-9)
    driven.take(pose(0.0, 1.45))
    assert driven.rejected == {"out_of_order": 1}, "as ever"


def test_a_delayed_stream_keeps_its_speed(driven):
    """Poses measured every 20 ms that come in 50 ms late, and unevenly."""
    sent = 0
    for k in range(1, 60):
        driven.go_to(0.05 + 0.005 * k)
        while 0.02 * (sent + 1) + 0.05 + 0.004 * ((7 * sent) % 3) <= driven.world.time:
            sent += 1
            driven.take(pose(-0.002 * sent, 0.02 * sent))
    assert not driven.rejected
    assert driven.courses.limited == 0
    assert sent > 10
    assert driven.tool.velocity[2] == pytest.approx(-0.1, rel=0.35)


def test_after_a_gap_a_stream_begins_gently(tmp_path):
    driven = Driven(tmp_path, gap=0.1)
    driven.go_to(0.5)
    driven.take(pose(-0.01))
    driven.go_to(0.55)
    assert driven.tool.velocity[2] == pytest.approx(-0.1, rel=1e-3), "a hundredth of a metre within the gap's tenth of a second"


def test_a_velocity_is_kept_for_a_while_then_the_tool_stops(tmp_path):
    driven = Driven(tmp_path, hold=0.1)
    driven.take(velocity((0.0, 0.0, 0.2)))
    driven.go_to(0.05)
    assert driven.tool.velocity == pytest.approx([0.0, 0.0, 0.2])
    driven.take(velocity((0.0, 0.0, 0.3)))
    driven.go_to(0.3)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.05 * 0.2 + 0.1 * 0.3], abs=3e-5)
    assert driven.tool.velocity == pytest.approx(np.zeros(3))


def test_a_velocity_in_the_tool_frame_turns_with_it(driven):
    quarter = rotation.from_vector(np.array([0.0, 0.5 * np.pi, 0.0]))
    driven.take(pose(0.1, 0.5, quarter))
    driven.go_to(0.5)
    driven.take(velocity((0.1, 0.0, 0.0), (1.0, 0.0, 0.0), in_tool_frame=True))
    driven.go_to(0.6)
    assert driven.tool.velocity == pytest.approx([0.0, 0.0, -0.1], abs=1e-6), "its x axis points down"
    assert driven.tool.spin == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)


def test_a_velocity_beyond_the_limit_is_slowed_and_counted(driven):
    driven.take(velocity((3.0, 0.0, 4.0)))
    driven.go_to(0.1)
    assert driven.tool.velocity == pytest.approx([0.6, 0.0, 0.8], rel=1e-6), "max_speed is 1 m/s"
    assert driven.courses.limited == 1
    driven.go_to(0.3)
    assert driven.tool.velocity == pytest.approx(np.zeros(3)), "not longer than others"


def turned(angle):
    """The orientation that it should have by now, but for the sign."""
    return rotation.from_vector(np.array([0.0, 0.0, angle]))


@pytest.mark.parametrize("own", [False, True], ids=["world", "tool"])
def test_a_tool_turns_by_more_than_half_a_turn_while_a_velocity_holds(tmp_path, own):
    """A drill of 20 rad/s: 5 rad in its quarter of a second, on a straight way, also where that is told in its own axes."""
    driven = Driven(tmp_path, hold=0.25)
    driven.take(velocity((0.04, 0.0, 0.0), (0.0, 0.0, 20.0), own))
    for time in (0.1, 0.2, 0.25, 0.4):
        driven.go_to(time)
        held = min(time, 0.25)
        assert abs(driven.tool.orientation @ turned(20.0 * held)) == pytest.approx(1.0, abs=1e-6)
        assert driven.tool.position == pytest.approx(START + [0.04 * held, 0.0, 0.0], abs=1e-6)
    assert driven.tool.spin == pytest.approx(np.zeros(3))
    assert not driven.rejected
    assert driven.courses.limited == 0


def test_a_pose_replaces_what_is_left_of_a_velocity(tmp_path):
    driven = Driven(tmp_path, hold=0.25)
    driven.take(velocity((0.0, 0.0, 0.0), (0.0, 0.0, 20.0)))
    driven.go_to(0.02)
    driven.take(pose(0.0, 0.1))
    driven.go_to(0.2)
    assert driven.tool.spin == pytest.approx(np.zeros(3))
    assert not driven.rejected


def test_a_spin_beyond_the_limit_is_slowed_until_the_next_command(tmp_path):
    """Corners of the plate, 44 mm from its axis with their particles, are 1 m/s fast at most."""
    driven = Driven(tmp_path, hold=0.25)
    driven.take(velocity((0.0, 0.0, 0.0), (0.0, 0.0, 100.0)))
    driven.go_to(0.15)
    fastest = driven.tool.spin[2]
    assert 20.0 < fastest < 25.0
    assert driven.courses.limited == 1
    assert abs(driven.tool.orientation @ turned(fastest * 0.15)) == pytest.approx(1.0, abs=1e-6)
    driven.take(velocity((0.0, 0.0, 0.1)))
    driven.go_to(0.2)
    assert driven.tool.spin == pytest.approx(np.zeros(3)), "nothing of it waits any more"


def test_turns_in_lockstep_may_be_as_long_as_their_stamps_say(tmp_path):
    driven = Driven(tmp_path, lockstep=True)
    driven.take(velocity((0.0, 0.0, 0.0), (0.0, 0.0, 15.0), at=0.5), velocity((0.0, 0.0, 0.0), (0.0, 0.0, -5.0), at=0.7))
    driven.go_to(0.5)
    assert abs(driven.tool.orientation @ turned(7.5)) == pytest.approx(1.0, abs=1e-6)
    driven.go_to(0.7)
    assert abs(driven.tool.orientation @ turned(6.5)) == pytest.approx(1.0, abs=1e-6)
    assert not driven.rejected


def test_velocities_in_lockstep_last_until_their_stamps(tmp_path):
    driven = Driven(tmp_path, lockstep=True)
    driven.take(velocity((0.1, 0.0, 0.0), at=0.1), velocity((0.0, 0.0, 0.1), at=0.3))
    assert driven.courses.promised == 0.3
    driven.go_to(0.3)
    assert driven.tool.position == pytest.approx(START + [0.01, 0.0, 0.02], abs=2e-5)
    driven.take(velocity((0.1, 0.0, 0.0)), velocity((0.1, 0.0, 0.0), at=0.3))
    assert driven.rejected == {"no_stamp": 1, "out_of_order": 1}


def test_stamps_of_another_clock_are_counted_from_the_first(tmp_path):
    driven, clock = Driven(tmp_path, relative=True, gap=0.1), 1.8e9
    driven.go_to(0.5)
    driven.take(pose(0.0, np.nan), pose(0.001, clock), pose(0.003, clock + 0.05))  # a bad one does not set the clock
    for time, height in ((0.6, 0.001), (0.625, 0.002), (0.65, 0.003)):
        driven.go_to(time)
        assert driven.tool.position == pytest.approx(START + [0.0, 0.0, height], abs=1e-6)
    driven.take(pose(0.003, clock + 0.02), pose(0.003, clock + 100.0))
    assert driven.rejected == {"not_finite": 1, "out_of_order": 1, "future": 1}
    assert "stamps:=relative" in driven.messages[-1]


def test_a_clock_is_forgotten_with_the_commands(tmp_path):
    driven = Driven(tmp_path, lockstep=True, relative=True, gap=0.1)
    for clock in (5.0e8, 20.0):
        driven.take(pose(0.001, clock))
        assert driven.courses.promised == pytest.approx(driven.world.time + 0.1, abs=1e-6)
        driven.courses.clear()
    assert driven.rejected == {}


def test_a_first_pose_may_say_where_a_tool_begins(driven):
    """Not sent there, which would take half a second at its 1 m/s; what comes after it is a way, until commands are forgotten."""
    driven.courses.placed = frozenset({"plate"})
    for _ in range(2):
        begin = driven.world.time
        assert driven.courses.take([pose(0.5, begin + 0.1), pose(0.6, begin + 0.3)], driven.reject)
        assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.5])
        assert not driven.courses.take([pose(0.7, begin + 0.5)], driven.reject)
        for time, height in ((0.1, 0.5), (0.2, 0.55), (0.3, 0.6), (0.4, 0.65)):
            driven.go_to(begin + time)
            assert driven.tool.position[2] - START[2] == pytest.approx(height, abs=2e-5)
        driven.courses.clear()
    assert not driven.rejected


def test_a_first_pose_in_the_bed_is_refused_and_the_next_one_is_the_first(driven):
    driven.courses.placed = frozenset({"plate"})
    assert not driven.courses.take([pose(-0.055)], driven.reject)
    assert driven.rejected == {"blocked": 1}
    assert driven.tool.position == pytest.approx(START)
    assert driven.courses.take([pose(0.1), pose(-0.055)], driven.reject), "the last good one"
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.1])


def test_a_tool_that_is_put_somewhere_else_forgets_what_waits(driven):
    driven.take(pose(0.1, 0.2), pose(0.2, 0.4))
    driven.go_to(0.1)
    driven.courses.place("plate", START + [0.1, 0.0, 0.1])
    driven.go_to(0.5)
    assert driven.tool.position == pytest.approx(START + [0.1, 0.0, 0.1])
    driven.take(pose(0.2, 0.45))  # before the stamp that has been forgotten
    driven.go_to(1.0)
    assert driven.tool.position == pytest.approx(START + [0.0, 0.0, 0.2])
    assert not driven.rejected
