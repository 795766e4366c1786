"""Errors and run times of settings side by side: which are worth their time, and which is the cheapest that is good enough."""

from dataclasses import dataclass, field, replace

import numpy as np

SAVING = 0.05  # of the run time; less is not worth another setting


@dataclass(frozen=True)
class Spanned:
    """A value and the range around it.

    Attributes:
        middle, low, high: in the unit of what is measured.
    """

    middle: float
    low: float
    high: float

    @classmethod
    def of(cls, values: list[float]) -> "Spanned":
        """Median and range of some values."""
        return cls(float(np.median(values)), float(np.min(values)), float(np.max(values)))


@dataclass(frozen=True)
class Row:
    """A setting and what came of it.

    Attributes:
        group, name: of the variation.
        error: largest relative distance from the reference [1]; None if it was not run or there is nothing to compare it with.
        time: run time of the steps [s], over repeats; None if it was not run.
        parts: relative distances by what is compared [1].
        time_step: [s].
        steps: number of steps.
        runs: number of repeats.
        doubts: why its runs should not be trusted.
        refusal: why it was not run.
        front: whether no trusted setting is both faster and nearer to the reference.
    """

    group: str
    name: str
    error: Spanned | None = None
    time: Spanned | None = None
    parts: dict[str, Spanned] = field(default_factory=dict)
    time_step: float = 0.0
    steps: int = 0
    runs: int = 0
    doubts: tuple[str, ...] = ()
    refusal: str = ""
    front: bool = False

    @property
    def title(self) -> str:
        """Group and name."""
        return f"{self.group}: {self.name}" if self.group else self.name

    @property
    def trusted(self) -> bool:
        """Whether it was run and nothing speaks against it."""
        return self.error is not None and self.time is not None and not self.doubts and not self.refusal

    def within(self, tolerance: float) -> bool:
        """Whether it is trusted and even the upper end of its error is within a tolerance [1]."""
        return self.trusted and self.error.high <= tolerance


def find_front(time: list[float], error: list[float]) -> list[bool]:
    """The Pareto front: which settings have no other that is at least as good in both and better in one.

    Args:
        time: run times [s].
        error: errors [1], as many.
    """
    points = list(zip(time, error, strict=True))
    return [not any(a <= t and b <= e and (a < t or b < e) for a, b in points) for t, e in points]


def mark_front(rows: list[Row]) -> list[Row]:
    """The same rows, with those on the front marked; only trusted ones count."""
    trusted = [row for row in rows if row.trusted]
    front = find_front([row.time.middle for row in trusted], [row.error.middle for row in trusted])
    best = {row.title for row, on in zip(trusted, front, strict=True) if on}
    return [replace(row, front=row.trusted and row.title in best) for row in rows]


def recommend(rows: list[Row], written: Row, tolerance: float) -> Row | None:
    """The cheapest setting within a tolerance; ``written`` if it is within it and no other saves a noticeable share of its time.

    Returns:
        None if no setting is within the tolerance.
    """
    good = [row for row in rows if row.within(tolerance)]
    cheapest = min(good, key=lambda row: row.time.middle, default=None)
    if cheapest is not None and written.within(tolerance) and not saves(cheapest, written):
        return written
    return cheapest


def saves(row: Row, written: Row) -> bool:
    """Whether a setting is faster than another by more than what repeated timing explains."""
    return row.time.middle < (1.0 - SAVING) * written.time.middle and row.time.high < written.time.low


def best_of_groups(rows: list[Row], written: Row, tolerance: float) -> list[Row]:
    """For each choice the cheapest setting within the tolerance, where it saves time."""
    best: dict[str, Row] = {}
    for row in rows:
        if row.group and row.within(tolerance) and saves(row, written):
            known = best.get(row.group)
            if known is None or row.time.middle < known.time.middle:
                best[row.group] = row
    return list(best.values())


def convergence_orders(rows: list[Row]) -> dict[str, float]:
    """Measured order in the time step of each compared part: slope of the logarithm of its worst error, by least squares.

    Args:
        rows: settings that differ in nothing but the time step.
    """
    trusted = [row for row in rows if row.trusted]
    if len({row.time_step for row in trusted}) < 3:
        return {}
    step = np.log([row.time_step for row in trusted])
    errors = {name: np.array([row.parts[name].high for row in trusted]) for name in trusted[0].parts}
    return {name: float(np.polyfit(step, np.log(error), 1)[0]) for name, error in errors.items() if np.all(error > 0.0)}
