"""How many threads step: as many as there are lanes, or fewer while other programs keep the cores busy."""

from itertools import cycle

_WINDOW = 0.03  # [s] over which a pace is taken
_FEWEST = 10  # steps for that, and those after which a trial may be given up
_FASTER, _HOPELESS = 0.9, 1.5  # of the pace before, for another number of threads to be taken, or given up at once
_CHANGED = 1.3  # times faster or slower than when it was last decided; then trials are frequent again
_SOONEST, _LATEST = 1.0, 30.0  # [s] between two trials; after each in vain twice as long
_RARE = 50.0  # times as long as a trial took there is none


class Crew:
    """Finds the number of threads with which steps are quickest, by trying.

    Lanes meet after each stage. One whose thread does not run, as another program has its core, keeps all others waiting, so
    that on busy cores few threads that play several lanes each are quicker than many. What is computed is the same.

    Args:
        lanes: most threads, and how many there are at first.

    Attributes:
        size: threads now.
    """

    def __init__(self, lanes: int):
        self.size = lanes
        self._others = cycle(sorted({-(-lanes // 2**k) for k in range(1, lanes.bit_length() + 1)} | {lanes}, reverse=True))
        next(self._others)
        self._before: int | None = None  # threads before a trial, while there is one
        self._pace = self._decided = 0.0  # [s] a step, in the last window, and when it was last decided
        self._worked, self._wait, self._least = 0.0, _SOONEST, _SOONEST  # [s] since then; until the next trial, and at least
        self._steps, self._seconds = 0, 0.0

    @property
    def portion(self) -> int:
        """Steps to take before their pace is looked at."""
        unknown = not self._pace or (self._before is not None and not self._steps)
        return _FEWEST if unknown else max(_FEWEST, int(_WINDOW / self._pace))

    def note(self, steps: int, seconds: float) -> None:
        """Take note of how long some steps took, and choose the number of threads for the next ones."""
        self._steps += steps
        self._seconds += seconds
        pace, took = self._seconds / self._steps, self._seconds
        hopeless = self._before is not None and self._steps >= _FEWEST and pace > _HOPELESS * self._pace
        if took < _WINDOW and not hopeless:
            return
        self._steps, self._seconds = 0, 0.0
        if self._before is None:
            self._work(pace, took)
        else:
            self._judge(pace, took)

    def _work(self, pace: float, took: float) -> None:
        self._pace, self._decided = pace, self._decided or pace
        self._worked += took
        if not self._decided / _CHANGED < pace < self._decided * _CHANGED:
            self._wait = self._least
        other = self.size
        if self._worked > self._wait:
            other = next(self._others)
            other = next(self._others) if other == self.size else other
        if other != self.size:
            self._before, self.size = self.size, other

    def _judge(self, pace: float, took: float) -> None:
        better = pace < _FASTER * self._pace
        self._least = max(_SOONEST, _RARE * took)
        self._wait = self._least if better else max(min(2.0 * self._wait, _LATEST), self._least)
        if better:
            self._pace = pace
        else:
            self.size = self._before
        self._before, self._decided, self._worked = None, self._pace, 0.0
