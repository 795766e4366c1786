"""Times that are compared with one another, so that a slow or busy machine fails no test."""

import time

import numpy as np


def quickest(work, times: int = 5) -> float:
    """Least processor time of some calls [s]."""
    spent = []
    for _ in range(times):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return min(spent)


def sorting(number: int) -> float:
    """What this machine needs to sort so many numbers [s]: some 20 ns each."""
    values = np.random.default_rng(0).random(number)
    return quickest(lambda: np.argsort(values))
