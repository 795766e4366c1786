"""How many threads step: few on busy cores, all on free ones, and the same bits whatever their number."""

from itertools import cycle

import numpy as np
import pytest
from kinds import KINDS, flying_grains, same_state
from scenes import write_small_scene

from sand_sim import ToolPose, World, load_scene
from sand_sim.engine.crew import Crew
from sand_sim.engine.lanes import CpuDevice


def play(crew, pace_of, seconds):
    """Let a crew work for some time at a pace [s] a step that hangs on the number of threads; returns (time, threads, steps)."""
    time, rows = 0.0, []
    while time < seconds:
        steps, size = crew.portion, crew.size
        took = steps * pace_of(size)
        crew.note(steps, took)
        time += took
        rows.append((time, size, steps))
    return np.array(rows)


def lost(rows, pace_of, best):
    """Share of the time that would have been saved with the best number of threads."""
    return 1.0 - rows[:, 2].sum() * pace_of(best) / rows[-1, 0]


def share_of(size, rows):
    """Share of the time in which so many threads worked."""
    took = np.diff(rows[:, 0])
    return took[rows[1:, 1] == size].sum() / took.sum()


@pytest.mark.parametrize("step", [3e-6, 5e-5, 2e-3, 0.5])
@pytest.mark.parametrize("lanes", [2, 16])
def test_on_free_cores_all_work_and_next_to_nothing_is_lost(step, lanes):
    random = np.random.default_rng(0)

    def pace(size):
        return step * lanes / size * random.uniform(0.95, 1.05)

    rows = play(Crew(lanes), pace, 300.0)
    assert lost(rows, lambda size: step * lanes / size, lanes) < 0.02
    assert rows[-1, 1] == lanes


@pytest.mark.parametrize("worse", [1.3, 3.0, 300.0])
def test_on_busy_cores_few_work_and_all_again_when_cores_are_free(worse):
    def busy(size):
        return 5e-5 * (1.0 if size == 1 else worse)

    def free(size):
        return 5e-5 / size

    crew = Crew(4)
    play(crew, free, 20.0)
    assert crew.size == 4
    rows = play(crew, busy, 120.0)
    assert share_of(1, rows[rows[:, 0] > 60.0]) > 0.9
    rows = play(crew, free, 120.0)
    assert share_of(4, rows[rows[:, 0] > 60.0]) > 0.95


def test_what_does_not_help_is_given_up_after_a_few_steps():
    crew = Crew(2)
    rows = play(crew, lambda size: 1e-4 if size == 2 else 1e-2, 100.0)
    solo = rows[rows[:, 1] == 1]
    assert len(solo) > 3
    assert np.all(solo[:, 2] == 10)


def test_one_lane_needs_no_trials():
    assert set(play(Crew(1), lambda size: 1e-4, 20.0)[:, 1]) == {1}


class Changing(CpuDevice):
    """Cores on which the number of threads changes with every run."""

    def __init__(self):
        super().__init__(5)
        self._crew = Turns()


class Turns:
    portion = 7

    def __init__(self):
        self._sizes = cycle((5, 1, 2, 4, 3))
        self.size = next(self._sizes)

    def note(self, steps, seconds):
        self.size = next(self._sizes)


def on_one_and_on_changing(with_device, make):
    """The same world on one thread and on threads whose number changes every seven steps."""
    worlds = [with_device(device, make) for device in (CpuDevice(1), Changing())]
    for world in worlds:
        world.step(400)
    return worlds


@pytest.mark.parametrize("case", KINDS)
def test_same_bits_whatever_the_number_of_threads(make_world, with_device, case):
    same_state(*on_one_and_on_changing(with_device, lambda: flying_grains(make_world, case)))


@pytest.mark.parametrize(("contact", "height"), [("rough", 0.0249), ("smooth", 0.0219)])
def test_same_bits_at_a_tool_whatever_the_number_of_threads(tmp_path, with_device, contact, height):
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "pose": {"position": [0.015, 0.015, height]}}
    scene = load_scene(write_small_scene(tmp_path, tools={"plate": plate | {"contact": contact, "max_speed": 1.0}}))

    def pressed():
        world = World(scene)
        world.apply(ToolPose("plate", np.array([0.015, 0.015, height - 0.0015]), np.array([0.0, 0.0, 0.0, 1.0]), 0.01))
        world.step(333)
        assert len(world.tool_contacts("plate").overlap)
        return world

    same_state(*on_one_and_on_changing(with_device, pressed))
