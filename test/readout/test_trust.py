"""When a run is doubted: each indicator alone, a little on either side of its limit."""

from dataclasses import replace

import numpy as np
import pytest

from sand_sim.border import Health
from sand_sim.readout.trust import find_doubts, gained_share

SOUND = Health(1e-5, 1.0, 0.02, 1.0, 2.0, 3.0, 4.0, 5.0, 1e-9, 0.5, 123, 4, ())


@pytest.mark.parametrize(
    ("field", "limit", "told"),
    [
        ("step_ratio", 1.0001, "times the safe one"),
        ("deepest", 0.1, "overlap reached 10.0 % of a radius"),  # what the automatic time step is stable up to
        ("gained", 0.01 * 10.0, "0.1 J appeared from nowhere"),  # one percent of the energies above
        ("momentum_residual", 1e-3, "0.1 % of the forces on grains have no counterpart"),
        ("time_step", 2.0 * 1e-5, "asks for a time step of 1e-05 s"),
    ],
)
def test_each_indicator_is_doubted_beyond_its_limit(field, limit, told):
    below, above = (find_doubts(replace(SOUND, **{field: share * limit}), 1e-5).doubts for share in (0.99995, 1.00005))
    assert below == ()
    assert len(above) == 1
    assert told in above[0]


def test_crushed_grains_may_be_between_a_tool_and_a_wall():
    (pressed,), (crushed,) = (find_doubts(replace(SOUND, deepest=deepest), 1e-5).doubts for deepest in (0.45, 0.55))
    assert "wall" not in pressed
    assert crushed.endswith("slow what presses on it; or does a tool crush grains against a wall, which it goes through?")


def test_a_run_no_faster_than_expected_is_not_too_fast():
    assert find_doubts(replace(SOUND, time_step=1.0), np.inf, ("thin walls",)).doubts == ("thin walls",)


@pytest.mark.parametrize("field", ["kinetic", "potential", "elastic", "tool_work"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_gained_is_compared_with_all_energy_handled(field, sign):
    still = replace(SOUND, kinetic=0.0, potential=0.0, elastic=0.0, tool_work=0.0, gained=0.03)
    assert gained_share(still) == 0.0
    if sign > 0.0 or field != "kinetic":  # of what sticks together more is stored below zero than there is above
        assert gained_share(replace(still, **{field: sign * 2.0})) == pytest.approx(0.015)
