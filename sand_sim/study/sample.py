"""What one run leaves for a study."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sample:
    """One run, or the mean of several.

    Attributes:
        time: of the rows of histories, shape (n,) [s].
        values: histories and plain numbers by name.
        wall: run time of the steps [s].
        steps: number of steps.
        time_step: [s].
        doubts: why the run should not be trusted.
    """

    time: np.ndarray
    values: dict[str, np.ndarray]
    wall: float = 0.0
    steps: int = 0
    time_step: float = 0.0
    doubts: tuple[str, ...] = ()


def mean_sample(samples: list[Sample]) -> Sample:
    """The mean of several runs' values."""
    values = {name: np.mean([one.values[name] for one in samples], axis=0) for name in samples[0].values}
    return Sample(samples[0].time, values)
