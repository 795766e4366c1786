"""Particles below the surface, so that a body keeps its outer size."""

import numpy as np

from sampler.surface import Surface

_STEPS, _TURNS = 12, 12
_ON = 1e-9  # particles nearer than this to the surface lie on it, of the diagonal
_AROUND = 2.0  # neighbours of a particle are nearer than this, so that a corner has some on each face; in spacings
_APART = 0.5  # particles nearer than this after the move are dropped, in spacings


def inset_particles(
    points: np.ndarray, normals: np.ndarray, around: Surface, radius: float, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Move particles inward until they are one radius below the surface, or as deep as a thin wall allows.

    Args:
        points: on the surface, shape (n, 3) [m].
        normals: shape (n, 3).
        around: closed surface of the solid.
        radius: of the particles [m].
        spacing: of the particles [m].

    Returns:
        Points, shape (m, 3) [m], and which of the given ones they were, shape (m,); where edges bring particles together, some
        are left out.
    """
    place, depth = points.copy(), np.zeros(len(points))
    inward = -_mean_normals(points, normals, spacing)
    for share in np.linspace(1.0 / _STEPS, 1.0, _STEPS):
        place, depth = _deeper(place, depth, points + share * radius * inward, around, radius)
    slack = _ON * around.unit
    for _ in range(_TURNS):
        closest, face = around.closest(place)
        away = place - closest
        length = np.linalg.norm(away, axis=1)
        away[length <= slack] = -around.normals[face[length <= slack]]
        reach = np.maximum(length, radius / _STEPS)
        step = np.clip(radius - length, -reach, reach) / np.linalg.norm(away, axis=1)
        place, depth = _deeper(place, depth, place + step[:, None] * away, around, radius, slack)
    shallow = depth < 0.98 * radius
    useless = shallow & _beside(place, ~shallow, spacing)  # stuck at an edge, beside one that came down
    kept = _apart(place, _APART * spacing)
    kept = kept[~useless[kept]]
    return place[kept], kept


def _deeper(place, depth, trial, around, radius, slack=0.0):
    """The trial where it is nearer to the wanted depth, or within the slack: where faces meet it takes several moves."""
    closest, _ = around.closest(trial)
    found = np.linalg.norm(trial - closest, axis=1) * np.where(np.abs(around.winding(trial)) > 0.5, 1.0, -1.0)
    better = np.abs(found - radius) < np.abs(depth - radius) + slack
    return np.where(better[:, None], trial, place), np.where(better, found, depth)


def _mean_normals(points: np.ndarray, normals: np.ndarray, spacing: float) -> np.ndarray:
    """Mean over neighbours that do not face the other way, so that particles on an edge move into the solid."""
    mean = normals.copy()
    for k in _blocks(points, _AROUND * spacing):
        for i in k[0]:
            near = np.linalg.norm(points[k[1]] - points[i], axis=1) < _AROUND * spacing
            same = near & (normals[k[1]] @ normals[i] > -0.5)
            mean[i] = normals[k[1]][same].sum(axis=0)
    return mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)


def _beside(points: np.ndarray, those: np.ndarray, reach: float) -> np.ndarray:
    """Whether one of those lies within reach of each point."""
    found = np.zeros(len(points), bool)
    for inside, around in _blocks(points, reach):
        others = points[around[those[around]]]
        for i in inside:
            found[i] = np.any(np.linalg.norm(others - points[i], axis=1) < reach)
    return found


def _blocks(points: np.ndarray, width: float):
    """Cells of a grid: numbers of the points in each, and in it and the cells around."""
    cell = np.floor((points - points.min(axis=0)) / width).astype(int)
    members: dict[tuple, list[int]] = {}
    for i, key in enumerate(map(tuple, cell)):
        members.setdefault(key, []).append(i)
    for (x, y, z), inside in members.items():
        around = [i for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) for i in members.get((x + a, y + b, z + c), ())]
        yield inside, np.array(around)


def _apart(points: np.ndarray, least: float) -> np.ndarray:
    """Numbers of points, the first of those nearer than ``least`` to one another."""
    keep = np.ones(len(points), bool)
    for inside, around in _blocks(points, least):
        for i in inside:
            near = around[around < i]
            keep[i] = not np.any(keep[near] & (np.linalg.norm(points[near] - points[i], axis=1) < least))
    return np.flatnonzero(keep)
