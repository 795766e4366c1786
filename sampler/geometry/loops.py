"""Triangles over loops of corners: over holes of a surface, or for polygons that are not convex."""

from collections.abc import Sequence

import numpy as np

_LONGEST = 80  # corners of a loop that are spanned with least area; longer loops are first cut at their flattest corners
_TOGETHER = 1_000_000  # squared corners of the loops that are spanned together


def span_loops(vertices: np.ndarray, loops: Sequence) -> list[np.ndarray]:
    """Triangles of least total area over loops of vertices (dynamic programming, Barequet & Sharir 1995).

    Args:
        vertices: shape (k, 3) [m].
        loops: numbers of the vertices of each, shape (n,).

    Returns:
        For each loop of n corners, shape (n - 2, 3).
    """
    shortened = [_without_flat_corners(vertices, list(loop)) for loop in loops]
    sizes, found = np.array([len(loop) for loop, _ in shortened], int), [np.zeros((0, 3), np.int64)] * len(loops)
    for size in np.unique(sizes):  # those of as many corners together, as most of a mesh are alike
        alike = np.flatnonzero(sizes == size)
        for some in np.array_split(alike, 1 + len(alike) * size**2 // _TOGETHER):
            splits = _least_splits(vertices[np.array([shortened[k][0] for k in some])])
            for k, split in zip(some, splits, strict=True):
                loop, cut = shortened[k]
                found[k] = np.array(cut + _split_up(loop, split.tolist()), np.int64).reshape(-1, 3)
    return found


def _least_splits(corner: np.ndarray) -> np.ndarray:
    """For corners i and j of loops, shape (m, n, 3), the third one of the triangle on that side; shape (m, n, n)."""
    count, number = corner.shape[:2]
    cost = np.zeros((count, number, number))
    split = np.zeros((count, number, number), int)
    for width in range(2, number):
        i = np.arange(number - width)
        j = i + width
        k = i[:, None] + np.arange(1, width)
        spanned = np.cross(corner[:, k] - corner[:, i, None], (corner[:, j] - corner[:, i])[:, :, None])
        total = cost[:, i[:, None], k] + cost[:, k, j[:, None]] + 0.5 * np.linalg.norm(spanned, axis=3)
        split[:, i, j] = i + 1 + total.argmin(axis=2)
        cost[:, i, j] = total.min(axis=2)
    return split


def _split_up(loop: list[int], split: list[list[int]]) -> list[list[int]]:
    """The triangles of a loop, from the third corner on each side."""
    found, waiting = [], [(0, len(loop) - 1)]
    while waiting:
        i, j = waiting.pop()
        if j - i > 1:
            k = split[i][j]
            found.append([loop[i], loop[k], loop[j]])
            waiting += [(i, k), (k, j)]
    return found


def _without_flat_corners(vertices: np.ndarray, loop: list[int]) -> tuple[list[int], list[list[int]]]:
    """Cut a loop shorter: the flattest corners first of those that point outward and have no other corner within.

    Returns:
        The loop that is left, and the triangles that were cut off.
    """
    cut = []
    while len(loop) > _LONGEST:
        corner = vertices[loop]
        before, after = np.roll(corner, 1, axis=0), np.roll(corner, -1, axis=0)
        turn = np.cross(corner - before, after - corner)
        normal = np.cross(corner - corner[0], after - corner[0]).sum(axis=0)
        inward = turn @ normal < 0.0  # only such corners can lie within others
        order = np.lexsort([np.linalg.norm(turn, axis=1), inward])
        within = corner[inward]
        k = next((k for k in order if not _holds(np.array([before[k], corner[k], after[k]]), normal, within)), order[0])
        cut.append([loop[k - 1], loop[k], loop[(k + 1) % len(loop)]])
        del loop[k]
    return loop, cut


def _holds(corners: np.ndarray, normal: np.ndarray, points: np.ndarray) -> bool:
    """Whether any of the points, seen along a normal, lies within a triangle, shape (3, 3)."""
    along = corners[[1, 2, 0]] - corners
    return bool(np.all(np.cross(along[:, None], points - corners[:, None]) @ normal > 0.0, axis=0).any())
