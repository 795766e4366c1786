"""How often clouds and maps are told."""

import pytest

from sand_sim.node.rate import Rate


@pytest.mark.parametrize("frame_rate", [50.0, 60.0, 1000.0])
@pytest.mark.parametrize("rate", [0.0, 3.0, 20.0, 25.0, 30.0, 47.0, 200.0])
def test_on_the_mean_it_is_due_as_often_as_asked_for_whatever_the_frames(frame_rate, rate):
    due, number = Rate(), round(4.0 * frame_rate)
    told = [due.due(frame / frame_rate, rate) for frame in range(number)]
    assert sum(told) == pytest.approx(min(4.0 * rate, number), abs=1)


def test_after_a_reset_it_is_due_at_once_and_goes_on():
    due = Rate()
    assert [due.due(0.02 * frame, 10.0) for frame in range(7)] == [True, *[False] * 4, True, False]
    assert [due.due(0.02 * frame, 10.0) for frame in range(7)] == [True, *[False] * 4, True, False]
