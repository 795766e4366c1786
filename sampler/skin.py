"""The surface that particles lie on: what can be touched from outside, without walls buried in other parts."""

import numpy as np

from sampler.surface import Surface

_STEP = 2e-5  # of the diagonal: how far before and behind a face is asked what is there
_TRIAL = 4000  # random places that show whether anything is buried at all
_DEEPEST = 9  # halvings of a triangle that is partly buried
_ISLAND, _FINEST = 2.0, 0.04  # triangles larger than this may hold islands; smaller ones are not cut further; in spacings
_MOST = 150_000  # questions after which no triangle is cut further


class Skin(Surface):
    """Triangles with what random sampling and Warp kernels need."""

    def sample(self, number: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Random places, stratified over the area.

        Returns:
            Points, shape (number, 3) [m], and the normals of their triangles, shape (number, 3).
        """
        share = np.cumsum(self.areas)
        at = (np.arange(number) + random.random(number)) / number * share[-1]
        face = np.minimum(np.searchsorted(share, at), len(share) - 1)
        u = random.random((number, 2))
        u = np.where(u.sum(axis=1, keepdims=True) > 1.0, 1.0 - u, u)
        corner = self.triangles[face]
        points = corner[:, 0] + u[:, :1] * (corner[:, 1] - corner[:, 0]) + u[:, 1:] * (corner[:, 2] - corner[:, 0])
        return points, self.normals[face]


def free_triangles(
    triangles: np.ndarray, around: Surface, spacing: float, two_sided: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles, or parts of them, that have an outside before them and an inside behind them.

    Args:
        triangles: shape (n, 3, 3) [m].
        around: all closed surfaces, these among them.
        spacing: of the particles to come [m].
        two_sided: the triangles are sheets, free where any of their sides is.

    Returns:
        Shape (m, 3, 3) [m], and the given triangle that each is part of, shape (m,).
    """
    parent = np.flatnonzero(Surface.areas_of(triangles) > 0.0)
    triangles = triangles[parent]
    places, normals = Skin(triangles).sample(_TRIAL, np.random.default_rng(0))
    if _free(places, normals, around, two_sided).all():
        return triangles, parent
    kept, parents, asked_all = [], [], 0
    for depth in range(_DEEPEST + 1):
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        centre = triangles.mean(axis=1)
        asked = np.concatenate([centre[:, None], 0.98 * triangles + 0.02 * centre[:, None]], axis=1)
        asked_all += 4 * len(triangles)
        free = _free(asked.reshape(-1, 3), np.repeat(normal, 4, axis=0), around, two_sided).reshape(-1, 4)
        edge = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
        final = (edge <= _FINEST * spacing) | (depth == _DEEPEST) | (asked_all > _MOST)
        # A large triangle may hold an island; only small ones are believed by their corners.
        whole = (free.all(axis=1) | ~free.any(axis=1)) & ((edge <= _ISLAND * spacing) | (depth > 2))
        keep, cut = (whole | final) & free[:, 0], ~whole & ~final
        kept.append(triangles[keep])
        parents.append(parent[keep])
        triangles, parent = _quarter(triangles[cut]), np.tile(parent[cut], 4)
        if not len(triangles):
            break
    return np.concatenate(kept), np.concatenate(parents)


def _free(points: np.ndarray, normals: np.ndarray, around: Surface, two_sided: bool) -> np.ndarray:
    step = _STEP * around.unit * normals
    before = np.abs(around.winding(points + step)) < 0.5
    behind = np.abs(around.winding(points - step)) < 0.5
    return (before | behind) if two_sided else (before != behind)


def _quarter(triangles: np.ndarray) -> np.ndarray:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])
