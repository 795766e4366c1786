"""Triangles over a loop of corners: over a hole of a surface, or for a polygon that is not convex."""

import numpy as np

_LONGEST = 80  # corners of a loop that are spanned with least area; longer loops are first cut at their flattest corners


def span_loop(vertices: np.ndarray, loop: np.ndarray) -> np.ndarray:
    """Triangles of least total area over a loop of vertices, shape (n - 2, 3) (dynamic programming, Barequet & Sharir 1995)."""
    loop, cut = _without_flat_corners(vertices, list(loop))
    corner, number = vertices[loop], len(loop)
    cost = np.zeros((number, number))
    split = np.zeros((number, number), int)
    for width in range(2, number):
        i = np.arange(number - width)
        j = i + width
        k = i[:, None] + np.arange(1, width)
        spanned = np.cross(corner[k] - corner[i, None], (corner[j] - corner[i])[:, None])
        total = cost[i[:, None], k] + cost[k, j[:, None]] + 0.5 * np.linalg.norm(spanned, axis=2)
        split[i, j] = i + 1 + total.argmin(axis=1)
        cost[i, j] = total.min(axis=1)
    waiting = [(0, number - 1)]
    while waiting:
        i, j = waiting.pop()
        if j - i > 1:
            k = split[i, j]
            cut.append([loop[i], loop[k], loop[j]])
            waiting += [(i, k), (k, j)]
    return np.array(cut, np.int64)


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
        k = next((k for k in order if not _holds(before[k], corner[k], after[k], normal, corner[inward])), order[0])
        cut.append([loop[k - 1], loop[k], loop[(k + 1) % len(loop)]])
        del loop[k]
    return loop, cut


def _holds(a: np.ndarray, b: np.ndarray, c: np.ndarray, normal: np.ndarray, points: np.ndarray) -> bool:
    """Whether any of the points, seen along a normal, lies within a triangle."""
    sides = [np.cross(end - begin, points - begin) @ normal > 0.0 for begin, end in ((a, b), (b, c), (c, a))]
    return bool(np.all(sides, axis=0).any())
