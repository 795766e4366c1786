"""The Pareto front, the recommendation and the measured order, on figures made up for it."""

import numpy as np
import pytest

from sand_sim.study.comparison import (
    Row,
    Spanned,
    best_of_groups,
    convergence_orders,
    find_front,
    mark_front,
    recommend,
)


def row(name, time, error, group="choice", **further):
    span = [Spanned(value, 0.99 * value, 1.01 * value) for value in (error, time)]
    return Row(group, name, error=span[0], time=span[1], **further)


def test_front_keeps_what_nothing_else_beats():
    time = [1.0, 2.0, 2.0, 3.0, 4.0, 5.0]
    error = [0.5, 0.2, 0.3, 0.2, 0.1, 0.4]
    assert find_front(time, error) == [True, True, False, False, True, False]


def test_front_against_its_definition():
    random = np.random.default_rng(1)
    time, error = random.uniform(size=(2, 200)).round(2)
    front = find_front(list(time), list(error))
    for k, on in enumerate(front):
        beaten = (time <= time[k]) & (error <= error[k]) & ((time < time[k]) | (error < error[k]))
        assert on == (not beaten.any())


def test_equal_settings_are_both_on_the_front():
    assert find_front([1.0, 1.0], [0.1, 0.1]) == [True, True]


def test_doubtful_settings_neither_are_nor_hide_the_front():
    rows = mark_front([row("a", 1.0, 0.1, doubts=("because",)), row("b", 2.0, 0.2), Row("choice", "c", refusal="no such law")])
    assert [one.front for one in rows] == [False, True, False]


def test_recommendation_is_the_cheapest_within_tolerance():
    written = row("", 10.0, 0.01, group="")
    rows = [written, row("fast", 1.0, 0.2), row("good", 4.0, 0.05), row("better", 6.0, 0.02)]
    assert recommend(rows, written, 0.06).name == "good"
    assert recommend(rows, written, 0.3).name == "fast"
    assert recommend(rows, written, 0.03).name == "better"
    assert recommend(rows, written, 0.001) is None


def test_doubtful_settings_are_never_recommended():
    written = row("", 10.0, 0.01, group="")
    assert recommend([written, row("fast", 1.0, 0.01, doubts=("because",))], written, 0.1) is written


def test_worst_repeat_must_be_within_tolerance():
    written = row("", 10.0, 0.01, group="")
    lucky = Row("choice", "lucky", error=Spanned(0.05, 0.01, 0.2), time=Spanned(1.0, 1.0, 1.0))
    assert recommend([written, lucky], written, 0.1) is written


def test_small_savings_and_those_within_the_scatter_of_timing_are_left_alone():
    written = Row("", "as written", error=Spanned(0.01, 0.01, 0.01), time=Spanned(10.0, 8.0, 12.0))
    assert recommend([written, row("little", 9.7, 0.01)], written, 0.1) is written
    assert recommend([written, row("unsure", 8.5, 0.01)], written, 0.1) is written
    assert recommend([written, row("sure", 7.0, 0.01)], written, 0.1).name == "sure"


def test_best_of_each_choice():
    written = row("", 10.0, 0.01, group="")
    rows = [
        written,
        row("a", 5.0, 0.02, group="one"),
        row("b", 4.0, 0.02, group="one"),
        row("c", 3.0, 0.5, group="one"),
        row("d", 7.0, 0.02, group="two"),
        row("e", 12.0, 0.001, group="three"),
    ]
    assert [one.name for one in best_of_groups(rows, written, 0.1)] == ["b", "d"]


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_order_in_the_time_step(order):
    parts = {step: {"peak": Spanned.of([3.0 * step**order])} for step in (0.1, 0.05, 0.025, 0.0125)}
    rows = [row(str(step), 1.0, 0.1, time_step=step, parts=part) for step, part in parts.items()]
    assert convergence_orders(rows)["peak"] == pytest.approx(order)
    assert convergence_orders(rows[:2]) == {}
