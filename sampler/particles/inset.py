"""The surface one radius below the skin, so that a body of particles on it keeps its outer size."""

from dataclasses import dataclass

import numpy as np

from sampler.geometry.contour import contour_triangles
from sampler.geometry.surface import Surface
from sampler.geometry.vectors import extremes
from sampler.particles.rows import ROW, narrow_ribbons
from sampler.particles.skin import halve_triangles, longest_edges

_CELL = 0.25  # cells in which the surface is sought, in spacings; walls as thick as two of them have two skins
_PIECE, _WIDE = 0.5, 4.0  # longest edge of pieces of walls, in spacings or radii, and of needles, in roots of their area
_SHRINKS = 12  # of balls
_TURNS, _SLOW, _SHORTEST = 40, 12.0, 0.06  # moves inward, and the least of them, in parts of the depth, and that when they fail
_SLACK = 1e-6  # of the diagonal: a move that costs no more depth is none the worse, in single precision
_OPPOSED = -0.8  # cosine between the normals of the two skins of a wall
_FULL = 0.99  # share of a depth at which it counts as reached
_ONE_LAYER = 0.05  # skins of a wall nearer than this to each other become one, in spacings
_ASIDE = 0.02  # of the way to its middle: how far from its corners a piece is asked, so that no other face is there
_FALLEN = 0.3  # share of their area that pieces of walls keep at least
_LINE = 0.02  # radius of the lines that what is neither wall nor rod becomes, in spacings
_THREAD = 0.3  # what lies one radius deep nearer to the middle of a rod than this is left out for it, in spacings
_OWN = 0.45  # pieces nearer than this to the surface found so far belong to it, in spacings


@dataclass(frozen=True)
class Inside:
    """What lies in a solid, seen from its skin.

    Attributes:
        skin: free faces of the solid.
        solid: closed surface.
    """

    skin: Surface
    solid: Surface

    def depth(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Depth of points, shape (n,) [m], negative outside, and the unit vector in which it decreases, shape (n, 3)."""
        closest, face = self.skin.closest(points)
        way = closest - points
        length = np.linalg.norm(way, axis=1)
        sign = np.where(np.abs(self.solid.winding(points)) > 0.5, 1.0, -1.0)
        out = np.where(length[:, None] > 1e-9 * self.skin.unit, way * sign[:, None], self.skin.normals[face])
        return sign * length, out / np.linalg.norm(out, axis=1, keepdims=True)

    def balls(self, points: np.ndarray, normals: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
        """Radii of the largest balls inside that touch the skin in places, and its normals where else they do.

        Args:
            points: on the skin, shape (n, 3) [m].
            normals: there, shape (n, 3).
            most: radius [m].

        Returns:
            Shape (n,) [m]; shape (n, 3), the given normals where the ball is as large as can be.
        """
        radius, other = np.full(len(points), float(most)), normals.copy()
        left = np.arange(len(points))
        for _ in range(_SHRINKS):
            centre = points[left] - radius[left, None] * normals[left]
            touched, face = self.skin.closest(centre)
            smaller = np.linalg.norm(touched - centre, axis=1) < radius[left] * (1.0 - 1e-5)
            left, way = left[smaller], points[left[smaller]] - touched[smaller]
            along = np.einsum("ij,ij->i", way, normals[left])
            sound = along > 1e-12 * self.skin.unit
            left, way, along, face = left[sound], way[sound], along[sound], face[smaller][sound]
            if not len(left):
                break
            radius[left] = np.minimum(radius[left], 0.5 * np.einsum("ij,ij->i", way, way) / along)
            other[left] = self.skin.normals[face]
        return radius, other

    def sink(self, points: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Points moved to a depth [m], or as near to it as is possible in the solid around them, and how deep they then lie."""
        place, share = points.copy(), np.ones(len(points))
        depth, out = self.depth(place)
        slack = _SLACK * self.skin.unit
        left = np.arange(len(place))
        for _ in range(_TURNS):
            left = left[(np.abs(depth[left] - level) > 1e-6 * level) & (share[left] > _SHORTEST)]
            if not len(left):
                break
            reach = share[left] * np.maximum(np.abs(depth[left]), level / _SLOW)
            trial = place[left] - np.clip(level - depth[left], -reach, reach)[:, None] * out[left]
            found, way = self.depth(trial)
            nearer = np.abs(found - level) < np.abs(depth[left] - level) + slack  # where faces meet it takes several moves
            share[left[~nearer]] *= 0.4
            k = left[nearer]
            place[k], depth[k], out[k] = trial[nearer], found[nearer], way[nearer]
        return place, depth

    def settle(self, points: np.ndarray, level: float, most: float) -> np.ndarray:
        """Points in the solid moved to a depth [m], those that have not so far to go [m]; shape (n, 3) [m]."""
        place, within = points.copy(), np.flatnonzero(self.depth(points)[0] > -_SLACK * self.skin.unit)
        place[within] = self.sink(points[within], level)[0]
        near = np.linalg.norm(place - points, axis=1) < most
        return np.where(near[:, None], place, points)


def inset_triangles(inside: Inside, radius: float, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The surface one radius below the skin: where walls are thinner, the middle between their skins, in one layer.

    Rods and narrow strips become lines: slender ones that count as wide as a row of particles.

    Args:
        inside: of the solid; its skin must consist of what particles are to cover.
        radius: [m].
        spacing: of the particles to come [m].

    Returns:
        Triangles, shape (n, 3, 3) [m]; the layers that each counts as, see ``Skin``, shape (n,); which are the middle of walls,
        shape (n,).
    """
    cell = _CELL * spacing
    deep = radius + cell  # thinner walls may slip through between the cells
    triangles = inside.skin.triangles
    low, high = extremes(triangles)
    found = contour_triangles(inside.depth, low - 0.37 * cell, high + 0.37 * cell, radius, cell)
    pieces = _pieces(triangles, _PIECE * max(spacing, radius))
    middle, normals = pieces.mean(axis=1), Surface.normals_of(pieces)
    ball, other = inside.balls(middle, normals, deep)
    toward = np.random.default_rng(0).standard_normal(3)
    toward /= np.linalg.norm(toward)
    thin = ball < _FULL * deep
    which, ribbons, share = narrow_ribbons(inside.skin, pieces[thin], 2.0 * deep, spacing, toward)
    thin[np.flatnonzero(thin)[which]] = False
    wall = thin & _is_opposed(normals, other)
    sheets, single = np.zeros((0, 3, 3)), np.zeros(0, bool)
    if wall.any():
        found = found[~_in_walls(inside, found, deep)]
        least = radius + 0.5 * _ONE_LAYER * spacing
        k = np.flatnonzero(wall)
        sheets, single, fallen = _layers(inside, pieces[k], normals[k], ball[k], other[k], radius, least, toward)
        wall[k[fallen]] = False
        # Once more with finer ones, so that layers end where they should.
        rim, up = halve_triangles(halve_triangles(pieces[k[fallen]])), np.tile(normals[k[fallen]], (4, 1))
        deepest, beyond = inside.balls(rim.mean(axis=1), up, deep)
        n = np.flatnonzero((deepest < _FULL * deep) & _is_opposed(up, beyond))
        more, also, _ = _layers(inside, rim[n], up[n], deepest[n], beyond[n], radius, least, toward)
        sheets, single = np.concatenate([sheets, more]), np.concatenate([single, also])
    if len(ribbons):
        found = found[_farther(found.mean(axis=1), ribbons, _THREAD * spacing)]
    layers = np.concatenate([np.ones(len(found) + len(sheets)), share])
    single = np.concatenate([np.zeros(len(found), bool), single, np.zeros(len(ribbons), bool)])
    found = np.concatenate([found, sheets, ribbons])
    rest = np.flatnonzero(thin & ~wall & (normals @ toward > 0.0))
    place, depth = inside.sink(middle[rest] - ball[rest, None] * normals[rest], deep)
    rest, place, depth = (values[depth < _FULL * deep] for values in (rest, place, depth))
    rest = rest[_farther(place, found, np.maximum(0.0, depth - radius) + _OWN * spacing)]
    if len(rest):
        lines = _images(inside, pieces[rest], normals[rest], radius)
        way = pieces[rest] - lines
        length = np.maximum(np.linalg.norm(way, axis=(1, 2)) / np.sqrt(3.0), np.finfo(float).tiny)
        lines += way * np.minimum(0.5, _LINE * spacing / length)[:, None, None]
        row = Surface.areas_of(pieces[rest]) * ROW * spacing / (np.pi * length)  # half of a rod looks one way
        found, layers = np.concatenate([found, lines]), np.append(layers, Surface.areas_of(lines) / row)
        single = np.append(single, np.zeros(len(rest), bool))
    sound = Surface.areas_of(found) > 0.0
    return found[sound], layers[sound], single[sound]


def _is_opposed(normals: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ij->i", normals, other) < _OPPOSED


def _layers(inside, pieces, normals, ball, other, radius, least, toward) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What lies one radius below pieces of walls, or in the middle of them.

    Where the skins meet in the middle, with balls smaller than ``least``, only pieces that look ``toward`` one way are taken.

    Returns:
        Triangles, shape (n, 3, 3) [m]; which of them are the only layer, shape (n,); numbers of the pieces of which hardly
        anything is left, as at rims.
    """
    taken = np.flatnonzero((ball > least) | ((normals - other) @ toward > 0.0))
    sheets = _images(inside, pieces[taken], normals[taken], radius)
    broad = Surface.areas_of(sheets) > _FALLEN * Surface.areas_of(pieces[taken])
    return sheets[broad], ball[taken[broad]] < radius, taken[~broad]


def _farther(points: np.ndarray, triangles: np.ndarray, least: np.ndarray | float) -> np.ndarray:
    """Whether points, shape (n, 3) [m], lie farther from triangles than so far [m]; shape (n,)."""
    if len(points) == 0 or len(triangles) == 0:
        return np.ones(len(points), bool)
    return np.linalg.norm(Surface(triangles).closest(points)[0] - points, axis=1) > least


def _pieces(triangles: np.ndarray, longest: float) -> np.ndarray:
    """Triangles cut until they are so small [m]."""
    parts = []
    while len(triangles):
        large = np.minimum(longest_edges(triangles), _WIDE * np.sqrt(Surface.areas_of(triangles))) > longest
        parts.append(triangles[~large])
        triangles = halve_triangles(triangles[large])
    return np.concatenate(parts)


def _in_walls(inside: Inside, triangles: np.ndarray, deep: float) -> np.ndarray:
    """Whether triangles one radius below the skin lie in walls too thin for the cells, shape (n,)."""
    middle = triangles.mean(axis=1)
    touched, _ = inside.skin.closest(middle)
    up = touched - middle
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), np.finfo(float).tiny)
    ball, other = inside.balls(touched, up, deep)
    return (ball < _FULL * deep) & _is_opposed(up, other)


def _images(inside: Inside, pieces: np.ndarray, normals: np.ndarray, radius: float) -> np.ndarray:
    """Where the corners of pieces of the skin come to lie."""
    corners = pieces + _ASIDE * (pieces.mean(axis=1, keepdims=True) - pieces)
    corners, up = corners.reshape(-1, 3), np.repeat(normals, 3, axis=0)
    ball, other = inside.balls(corners, up, radius)
    place = corners - ball[:, None] * up
    stuck = np.flatnonzero((ball < _FULL * radius) & ~_is_opposed(up, other))  # at another face
    place[stuck] = inside.sink(place[stuck], radius)[0]
    place = place.reshape(-1, 3, 3)
    middle = place.mean(axis=1, keepdims=True)
    return middle + (place - middle) / (1.0 - _ASIDE)
