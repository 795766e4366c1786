"""Which spheres overlap which others, on the host."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

_MOST_PAIRS = 200_000_000  # that are looked at, some seconds
_PAIRS_AT_ONCE = 1_000_000


class TooManyPairsError(ValueError):
    """More pairs are near each other than anyone wants to wait for."""


def overlapping(
    position: np.ndarray, radius: np.ndarray, others: np.ndarray, their_radius: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """All pairs of a sphere and one of some others that overlap, by their rows; found in cells as wide as the widest pair.

    Yields:
        Some pairs at a time, so that memory stays small however many there are.

    Raises:
        TooManyPairsError: if far too many are near enough to be looked at.
    """
    if not (len(position) and len(others)):
        return
    cell = float(radius.max() + their_radius.max())
    low = position.min(axis=0) - cell
    near = np.flatnonzero(np.all((others > low) & (others < position.max(axis=0) + cell), axis=1))
    size = (np.floor((position.max(axis=0) - low) / cell) + 3).astype(np.int64)

    def key(cells):
        return (cells[:, 2] * size[1] + cells[:, 1]) * size[0] + cells[:, 0]

    keys = key(np.floor((others[near] - low) / cell).astype(np.int64))
    order = np.argsort(keys, kind="stable")
    keys, near = keys[order], near[order]
    home = np.floor((position - low) / cell).astype(np.int64)
    rows = []
    for row in np.ndindex(3, 3):  # the three cells along x follow one another
        left, right = (key(home + np.array([end, row[0] - 1, row[1] - 1])) for end in (-1, 1))
        begin = np.searchsorted(keys, left)
        rows.append((begin, np.searchsorted(keys, right, side="right") - begin))
    pairs = sum(int(number.sum()) for _, number in rows)
    if pairs > _MOST_PAIRS:
        raise TooManyPairsError(f"{pairs:.1e} pairs of grains are near each other; ask for fewer, smaller or farther apart")
    for begin, number in rows:
        for part in _parts(number):
            first = np.repeat(np.arange(part.start, part.stop), number[part])
            ends = np.cumsum(number[part])
            second = near[np.repeat(begin[part] - ends + number[part], number[part]) + np.arange(len(first))]
            apart = position[first] - others[second]
            meet = np.einsum("ij,ij->i", apart, apart) < (radius[first] + their_radius[second]) ** 2
            yield first[meet], second[meet]


def _parts(number: np.ndarray) -> Iterator[slice]:
    """Parts one after the other whose numbers add up to little more than ``_PAIRS_AT_ONCE`` each, or that are one long."""
    part = (np.cumsum(number) - 1) // _PAIRS_AT_ONCE
    ends = [*(np.flatnonzero(np.diff(part)) + 1).tolist(), len(number)]
    return (slice(begin, end) for begin, end in pairwise([0, *ends]))
