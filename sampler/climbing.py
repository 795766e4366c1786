"""From places that are far from all particles to the farthest ones near by."""

from collections.abc import Callable

import numpy as np

from sampler.topology import merge_points

_STARTS = 150  # places to climb from
_CELL = 0.5  # of those with the same particle nearest one in each cell of so many spacings, so that they lie in many gaps
_KNOWN = 20  # the worst places among which they are chosen, per start
_FIRST, _SHORTER = 0.12, 0.7  # length of the first step, in spacings, and of each following one, of that before
_TRIALS = 4  # places tried in each step


def climb(
    points: np.ndarray,
    normals: np.ndarray,
    found: np.ndarray,
    beside: Callable[[np.ndarray, np.ndarray, tuple[float, ...]], tuple[np.ndarray, np.ndarray]],
    ways: Callable[[np.ndarray, np.ndarray], np.ndarray],
    steps: int,
    spacing: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Climb from the worst places to the worst ones near by: random places miss these by some percent.

    Args:
        points: places to begin with, shape (n, 3) [m].
        normals: of the surface there, shape (n, 3).
        found: the particles nearest to them, shape (n,) of ``Nearest``.
        beside: places a little aside of others, as ``Gaps.beside``.
        ways: distances of places from the nearest particle, shape (n,), in spacings.
        steps: how many, each shorter than that before.
        spacing: of the particles [m].

    Returns:
        The worst places, shape (m, 3) [m], the normals there, shape (m, 3), and their distances, shape (m,), in spacings.
    """
    which, way = found["which"], found["way"]
    known = min(_KNOWN * _STARTS, len(points))
    order = np.argpartition(-way, known - 1)[:known]
    order = order[np.argsort(-way[order], kind="stable")]
    cell = merge_points(np.floor(points[order] / (_CELL * spacing)))
    first = np.unique(which[order].astype(np.int64) * known + cell, return_index=True)[1]
    chosen = order[np.sort(first)[:_STARTS]]
    points, normals, way = points[chosen], normals[chosen], way[chosen]
    for step in _FIRST * _SHORTER ** np.arange(steps):
        places = beside(points, normals, (step,) * _TRIALS)
        trial = ways(*places).reshape(_TRIALS, -1)
        best, each = trial.argmax(axis=0), np.arange(len(points))
        better = np.flatnonzero(trial[best, each] > way)
        k = best[better] * len(points) + better
        points[better], normals[better], way[better] = places[0][k], places[1][k], trial[best, each][better]
    return points, normals, way
