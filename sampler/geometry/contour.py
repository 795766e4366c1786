"""The surface on which a function of space has one value, with its sharp edges, by dual contouring (Ju et al. 2002)."""

from collections.abc import Callable

import numpy as np

_COARSE = 16  # cells along the longest side to begin with
_REACH = 0.9  # half the diagonal of a cell, and a little
_SECANTS = 2  # steps in which the place between two corners is found
_FLAT = 0.05  # of the largest: smaller eigenvalues are those of directions in which nothing is known
_ROOM = 0.1  # how far out of its cell a corner may lie, in cells

Depth = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def contour_triangles(depth: Depth, low: np.ndarray, high: np.ndarray, level: float, cell: float) -> np.ndarray:
    """Triangles of the surface at one depth.

    Args:
        depth: tells for points, shape (n, 3) [m], how deep they lie, shape (n,) [m], never steeper than 1, and the unit vector
            in which the depth decreases, shape (n, 3).
        low: lowest corner of the box that holds it, shape (3,) [m].
        high: highest corner.
        level: depth [m].
        cell: edge of the cells, of which each gets one corner [m].

    Returns:
        Shape (n, 3, 3) [m], their normals towards smaller depth.
    """
    cells = _cells(depth, low, high, level, cell)
    size = cells.max(axis=0, initial=0) + 3
    stride = np.array([size[1] * size[2], size[2], 1])
    corners = (cells[:, None] + np.indices((2, 2, 2)).reshape(3, -1).T).reshape(-1, 3)
    keys, first = np.unique(corners @ stride, return_index=True)
    places = low + cell * corners[first]
    value = depth(places)[0] - level if len(places) else np.zeros(0)
    points, normals, around = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 4), np.int64)]
    for axis in range(3):
        there = np.minimum(np.searchsorted(keys, keys + stride[axis]), max(len(keys) - 1, 0))
        here = np.flatnonzero((keys[there] == keys + stride[axis]) & ((value > 0.0) != (value[there] > 0.0)))
        at, out = _between(depth, level, places[here], places[there[here]], value[here], value[there[here]])
        b, c = stride[axis - 2], stride[axis - 1]
        points.append(at)
        normals.append(out)
        around.append(keys[here, None] - [0, b, b + c, c])
    points, normals, around = map(np.concatenate, (points, normals, around))
    owner, index = np.unique(around, return_inverse=True)
    index = index.reshape(around.shape)
    whole = np.isin(around, cells @ stride).all(axis=1)
    lowest = low + cell * np.stack([owner // stride[0], owner // stride[1] % size[1], owner % size[2]], axis=1)
    middle = _corners(points, normals, index, lowest, cell)
    return _halves(middle[index[whole]], normals[whole])


def _cells(depth: Depth, low: np.ndarray, high: np.ndarray, level: float, cell: float) -> np.ndarray:
    """Cells that the surface may come through, shape (n, 3) int, found by halving."""
    number = np.maximum(np.ceil((high - low) / cell), 1.0)
    size = 2 ** max(0, int(np.ceil(np.log2(number.max() / _COARSE))))
    index = (
        np.stack(np.meshgrid(*(np.arange(0, n, size) for n in number), indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int64)
    )
    while True:
        found = depth(low + cell * (index + 0.5 * size))[0] if len(index) else np.zeros(0)
        index = index[np.abs(found - level) <= _REACH * size * cell]
        if size == 1:
            return index
        size //= 2
        index = (index[:, None] + size * np.indices((2, 2, 2)).reshape(3, -1).T).reshape(-1, 3)


def _between(depth, level, begin, end, first, last) -> tuple[np.ndarray, np.ndarray]:
    """Where the depth is the level on ways between points, and which way it decreases there."""
    for _ in range(_SECANTS):
        share = np.clip(first / np.where(first == last, 1.0, first - last), 0.02, 0.98)[:, None]
        middle = begin + share * (end - begin)
        value, out = depth(middle) if len(middle) else (first, middle)
        value = value - level
        same = (value > 0.0) == (first > 0.0)
        begin, first = np.where(same[:, None], middle, begin), np.where(same, value, first)
        end, last = np.where(same[:, None], end, middle), np.where(same, last, value)
    return middle + value[:, None] * out, out


def _corners(points: np.ndarray, normals: np.ndarray, index: np.ndarray, lowest: np.ndarray, cell: float) -> np.ndarray:
    """A corner in each cell, as near as can be to the planes through the places on its edges, so that sharp edges stay."""
    number = len(lowest)
    matrix, right, middle = np.zeros((number, 3, 3)), np.zeros((number, 3)), np.zeros((number, 3))
    for k in range(4):
        np.add.at(matrix, index[:, k], normals[:, :, None] * normals[:, None, :])
        np.add.at(right, index[:, k], normals * np.einsum("ij,ij->i", normals, points)[:, None])
        np.add.at(middle, index[:, k], points)
    middle /= np.maximum(np.bincount(index.ravel(), minlength=number), 1)[:, None]
    value, vector = np.linalg.eigh(matrix)
    sound = value > _FLAT * value[:, -1:]
    rest = right - np.einsum("kij,kj->ki", matrix, middle)
    share = np.einsum("kji,kj->ki", vector, rest) * np.where(sound, 1.0 / np.where(sound, value, 1.0), 0.0)
    best = middle + np.einsum("kij,kj->ki", vector, share)
    return np.clip(best, lowest - _ROOM * cell, lowest + (1.0 + _ROOM) * cell)


def _halves(quad: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Triangles, cut along the shorter diagonal, that look along normals."""
    other = np.linalg.norm(quad[:, 0] - quad[:, 2], axis=1) > np.linalg.norm(quad[:, 1] - quad[:, 3], axis=1)
    quad = np.where(other[:, None, None], np.roll(quad, -1, axis=1), quad)
    triangles, normals = np.concatenate([quad[:, :3], quad[:, [0, 2, 3]]]), np.tile(normals, (2, 1))
    turned = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    turned = np.einsum("ij,ij->i", turned, normals) < 0.0
    return np.where(turned[:, None, None], triangles[:, ::-1], triangles)
