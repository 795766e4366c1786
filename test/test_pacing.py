"""How simulated time follows the wall clock, on a clock and a machine of the test's own."""

from types import SimpleNamespace

import pytest

from sand_sim import simulation
from sand_sim.simulation import Simulation

FRAME = 0.02  # [s] of simulated time
PERIOD = 0.001  # [s] of wall time, after which it is looked again


class Paced:
    """A simulation in real time of a world without content, whose steps take no time unless told."""

    def __init__(self, monkeypatch, factor):
        self.wall, self.cost = 1000.0, 0.0  # the time and that of a step [s]
        clock = SimpleNamespace(monotonic=lambda: self.wall, perf_counter=lambda: self.wall)
        monkeypatch.setattr(simulation, "time", clock)
        self.world = SimpleNamespace(scene=SimpleNamespace(tools=[]), time=0.0, steps=0, time_step=1e-3, frame_steps=20)
        self.world.step, self.world.reset, self.world.observe = self._step, lambda: setattr(self.world, "time", 0.0), lambda: None
        self.simulation = Simulation(self.world, "realtime", factor)

    def _step(self, steps):
        self.world.time += steps * self.world.time_step
        self.wall += steps * self.cost

    def pass_time(self, duration):
        """Let wall time go on [s], and the world as far as it is allowed to."""
        end = self.wall + duration
        while self.wall < end:
            allowed = self.simulation._allowed_until()
            if allowed > self.world.time + 0.5 * self.world.time_step:
                self.simulation._advance(min(allowed, self.simulation._frame_end))
            else:
                self.wall += PERIOD

    def hitch(self, duration):
        """Let wall time go on during which nothing is done [s]."""
        self.wall += duration


@pytest.fixture(params=[0.25, 1.0, 4.0])
def paced(request, monkeypatch):
    return Paced(monkeypatch, request.param)


def kept(paced, wall):
    """Whether simulated time is that of a wall time [s], but for the frame that is shown ahead."""
    expected = wall * paced.simulation.real_time_factor
    return paced.world.time == pytest.approx(expected + 0.5 * FRAME, abs=0.5 * FRAME + 3.0 * PERIOD * 4.0)


def test_simulated_time_is_wall_time_times_the_factor(paced):
    for second in range(1, 6):
        paced.pass_time(1.0)
        assert kept(paced, second)


@pytest.mark.parametrize(("hitch", "caught_up"), [(0.15, True), (0.25, False), (3.0, False)])
def test_arrears_of_up_to_a_fifth_of_a_second_of_wall_time_are_caught_up(paced, hitch, caught_up):
    """The first frame is shown ahead at once, so that a frame may be missing of longer hitches but not more."""
    paced.pass_time(1.0)
    paced.hitch(hitch)
    paced.pass_time(2.0)
    assert kept(paced, 3.0 + (hitch if caught_up else 0.0))


def test_a_machine_that_is_too_slow_owes_nothing_once_it_is_fast_again(paced):
    """It keeps half of what is asked; what is forgotten is not asked for all at once later."""
    paced.cost = 2.0 * paced.world.time_step / paced.simulation.real_time_factor
    paced.pass_time(5.0)
    assert paced.world.time == pytest.approx(2.5 * paced.simulation.real_time_factor, rel=0.01, abs=FRAME)
    assert paced.simulation.step_time == pytest.approx(paced.cost, rel=1e-6)
    paced.cost = 0.0
    paced.pass_time(1.0)
    before = paced.world.time
    paced.pass_time(2.0)
    assert paced.world.time - before == pytest.approx(2.0 * paced.simulation.real_time_factor, abs=FRAME + 1e-9)


@pytest.mark.parametrize("act", ["pause", "pacing", "reset"])
def test_the_clock_begins_anew_after_a_pause_a_change_and_a_reset(paced, act):
    """A hitch so short that it would be caught up otherwise."""
    paced.pass_time(0.1)
    begin, factor = (0.0 if act == "reset" else paced.world.time), paced.simulation.real_time_factor
    if act == "pause":
        paced.simulation.pause(True)
        paced.pass_time(0.19)
        assert paced.world.time == begin
        paced.simulation.pause(False)
    elif act == "pacing":
        paced.hitch(0.19)
        paced.simulation.set_pacing("realtime", factor)
    else:
        paced.hitch(0.09)
        paced.simulation._reset()
    paced.pass_time(1.0)
    assert paced.world.time - begin == pytest.approx(factor + 0.5 * FRAME, abs=0.5 * FRAME + 2.0 * PERIOD * factor)
