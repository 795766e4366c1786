"""The surface that particles lie on: what can be touched from outside, without walls buried in other parts."""

import numpy as np

from sampler.crossing import crossed_pieces
from sampler.surface import Surface

_STEP = 2e-5  # of the diagonal: how far before and behind a face is asked what is there
_TRIAL = 4000  # random places that show whether anything is buried at all
_DEEPEST = 20  # halvings of a triangle that is partly buried
_ISLAND, _FINEST = 1.5, 0.15  # triangles larger than this may hold islands; smaller ones are not cut further; in spacings
_MOST = 10  # partly buried triangles per particle to come, after which only large ones are cut


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
    coincide = np.any(coincidence(places, normals, around) > 1)
    most = _MOST * float(Surface.areas_of(triangles).sum()) / spacing**2
    pieces, parents, mixed = [], [], 0
    for depth in range(_DEEPEST + 1):
        edge = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
        cut = (edge > (_FINEST if mixed < most else _ISLAND) * spacing) & (depth < _DEEPEST)
        cut[cut] = crossed_pieces(triangles[cut], around, _STEP * around.unit)
        small = np.flatnonzero(cut & (edge <= _ISLAND * spacing))
        cut[small] = _is_mixed(triangles[small], around, coincide)
        mixed += int(cut[small].sum())
        pieces.append(triangles[~cut])
        parents.append(parent[~cut])
        triangles, parent = _halve(triangles[cut]), np.tile(parent[cut], 2)
        if not len(triangles):
            break
    pieces, parents = np.concatenate(pieces), np.concatenate(parents)
    free = _free(pieces.mean(axis=1), _normals(pieces), around, two_sided)
    return pieces[free], parents[free]


def _is_mixed(pieces: np.ndarray, around: Surface, coincide: bool) -> np.ndarray:
    """Whether what lies before a piece at its rim differs from what lies before its middle; behind it, too, if asked for.

    Where two surfaces that coincide part, pieces must end, so that each is covered as often all over.
    """
    centre, normal = pieces.mean(axis=1, keepdims=True), _normals(pieces)[:, None]
    rim = np.concatenate([pieces, 0.5 * (pieces + np.roll(pieces, -1, axis=1))], axis=1)  # corners and midpoints
    places = np.concatenate([centre, 0.98 * rim + 0.02 * centre], axis=1)
    mixed = np.zeros(len(pieces), bool)
    for side in (1.0, -1.0) if coincide else (1.0,):
        number = np.abs(around.winding((places + side * _STEP * around.unit * normal).reshape(-1, 3))).reshape(-1, 7)
        state = number < 0.5 if side > 0.0 else np.rint(number)
        mixed |= np.any(state != state[:, :1], axis=1)
    return mixed


def _normals(triangles: np.ndarray) -> np.ndarray:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)


def coincidence(points: np.ndarray, normals: np.ndarray, around: Surface) -> np.ndarray:
    """How many faces of closed surfaces lie on one another at places of theirs, at least 1, shape (n,) int."""
    step = _STEP * around.unit * normals
    before, behind = (np.abs(around.winding(points + side * step)) for side in (1.0, -1.0))
    return np.maximum(np.rint(behind - before), 1).astype(int)


def _free(points: np.ndarray, normals: np.ndarray, around: Surface, two_sided: bool) -> np.ndarray:
    """Whether places of a surface are free."""
    step = _STEP * around.unit * normals
    before = np.abs(around.winding(points + step)) < 0.5
    behind = np.abs(around.winding(points - step)) < 0.5
    return (before | behind) if two_sided else (before != behind)


def _halve(triangles: np.ndarray) -> np.ndarray:
    """Cut at the middle of the longest edge, so that thin triangles do not breed."""
    edge = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    turn = (edge.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
