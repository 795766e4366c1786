"""The surface that particles lie on: what can be touched from outside, without walls buried in other parts."""

import numpy as np

from sampler.surface import Surface

_STEP = 2e-5  # of the diagonal: how far before and behind a face is asked what is there
_TRIAL = 4000  # random places that show whether anything is buried at all
_DEEPEST = 20  # halvings of a triangle that is partly buried
_ISLAND, _FINEST = 1.5, 0.15  # triangles larger than this may hold islands; smaller ones are not cut further; in spacings
_SEARCHED = 12  # halvings in search of islands
_MOST = 8_000  # partly buried triangles after which none is cut further


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
    if _free(places, normals, around, two_sided)[0].all():
        return triangles, parent
    coincide = np.any(coincidence(places, normals, around) > 1)
    kept, parents, mixed = [], [], 0
    for depth in range(_DEEPEST + 1):
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        centre = triangles.mean(axis=1)
        free, before = _free(centre, normal, around, two_sided)
        edge = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
        open_ = (edge > _FINEST * spacing) & (depth < _DEEPEST) & (mixed < _MOST)
        large = triangles[open_]
        rim = np.concatenate([large, 0.5 * (large + np.roll(large, -1, axis=1))], axis=1)  # corners and midpoints
        rim = 0.98 * rim + 0.02 * centre[open_, None] + _STEP * around.unit * normal[open_, None]
        same = (np.abs(around.winding(rim.reshape(-1, 3))) < 0.5).reshape(-1, 6) == before[open_, None]
        if coincide and len(rim):  # where two surfaces part, pieces end, so that each is covered as often all over
            behind = rim - 2.0 * _STEP * around.unit * normal[open_, None]
            depths = np.rint(np.abs(around.winding(behind.reshape(-1, 3)))).reshape(-1, 6)
            middle = np.rint(np.abs(around.winding(centre[open_] - _STEP * around.unit * normal[open_])))
            same &= depths == middle[:, None]
        # A large triangle may hold an island; only small ones are believed by their rims.
        cut = np.zeros(len(triangles), bool)
        cut[open_] = ~same.all(axis=1) | ((edge[open_] > _ISLAND * spacing) & (depth < _SEARCHED))
        mixed += int((~same.all(axis=1)).sum())
        keep = free & ~cut
        kept.append(triangles[keep])
        parents.append(parent[keep])
        triangles, parent = _halve(triangles[cut]), np.tile(parent[cut], 2)
        if not len(triangles):
            break
    return np.concatenate(kept), np.concatenate(parents)


def coincidence(points: np.ndarray, normals: np.ndarray, around: Surface) -> np.ndarray:
    """How many faces of closed surfaces lie on one another at places of theirs, at least 1, shape (n,) int."""
    step = _STEP * around.unit * normals
    before, behind = (np.abs(around.winding(points + side * step)) for side in (1.0, -1.0))
    return np.maximum(np.rint(behind - before), 1).astype(int)


def _free(points: np.ndarray, normals: np.ndarray, around: Surface, two_sided: bool) -> tuple[np.ndarray, np.ndarray]:
    """Whether places of a surface are free, and whether the outside is before them."""
    step = _STEP * around.unit * normals
    before = np.abs(around.winding(points + step)) < 0.5
    behind = np.abs(around.winding(points - step)) < 0.5
    return (before | behind) if two_sided else (before != behind), before


def _halve(triangles: np.ndarray) -> np.ndarray:
    """Cut at the middle of the longest edge, so that thin triangles do not breed."""
    edge = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    turn = (edge.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
