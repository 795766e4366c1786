"""Rods and strips so narrow that particles lie in them in one row: ribbons along their middle."""

import numpy as np

from sampler.geometry.surface import Surface, tangents

_WIDE = 1.5  # by how much wider than thick strips are at most that get one row, in spacings
_CHORDS = 6  # ways across that are tried
_FACING = 0.8  # least cosine between such a way and the normals at its ends; in walls of tubes it is less
_SKEW = 0.3  # sine between two normals of a rod from which they tell where it leads
ROW = 0.87  # what a row counts as wide, in spacings: of as many particles as on a surface
_DENSE = 1.33  # how many times as many there may be, so that they lie no nearer than elsewhere
_RIBBON = 0.005  # width of ribbons, per angle around the middle, in spacings
_BEHIND = 1e-5  # of the diagonal: how far behind the skin rays start
_STRIP = 1.5  # strips so many times as wide as thick look the way in which they are thin, as walls do
_BESIDE, _REACH = 0.2, 2  # width of cells in which rows side by side are counted, in spacings, and how many cells away
_TINY = np.finfo(float).tiny


def narrow_ribbons(
    skin: Surface, pieces: np.ndarray, most: float, spacing: float, toward: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pieces of the skin of rods and strips, unrolled about their middle: flat and narrow, all looking much the same way.

    So that there is one skin: particles whose normals part would not know of one another.

    Args:
        skin: of the solid.
        pieces: of it, shape (n, 3, 3) [m].
        most: how thick rods and strips may be [m].
        spacing: of the particles to come [m].
        toward: unit vector that they shall look along, shape (3,).

    Returns:
        Which pieces lie in rods or strips, shape (m,); what these become, shape (m, 3, 3) [m], and the layers that each counts
        as, see ``Skin``, so that together they are a row, shape (m,).
    """
    points, normals, limit = pieces.mean(axis=1), Surface.normals_of(pieces), most + _WIDE * spacing  # as wide as they can be
    through = _free_way(skin, points - _BEHIND * skin.unit * normals, -normals, limit)
    slender = np.flatnonzero(through < limit)
    centre = points[slender] - 0.5 * through[slender, None] * normals[slender]
    middle, along, flat, wide, thick = _sections(skin, centre, normals[slender], limit)
    narrow = (thick < most) & (wide < thick + _WIDE * spacing)
    slender, middle, along, flat, wide, thick = (values[narrow] for values in (slender, middle, along, flat, wide, thick))
    strip = (wide > _STRIP * thick)[:, None]
    up = np.where(strip, np.sign(flat @ toward)[:, None] * flat, toward)
    up = _units(up - np.einsum("ij,ij->i", up, along)[:, None] * along)
    side = np.cross(up, along)
    away = pieces[slender] - middle[:, None]
    forth, high, aside = (np.einsum("nij,nj->ni", away, way) for way in (along, up, side))
    angle = np.unwrap(np.arctan2(aside, high), axis=1)
    ahead, behind = (_free_way(skin, middle, way, limit) - 0.5 * thick for way in (along, -along))
    forth = np.clip(forth, -behind[:, None], np.maximum(ahead, -behind)[:, None])
    places = forth[:, :, None] * along[:, None] + _RIBBON * spacing * angle[:, :, None] * side[:, None]
    places += middle[:, None]
    dense = np.clip((wide - thick) / (ROW * spacing), 1.0, _DENSE)  # as many as on the surface of a wide strip
    return slender, places, 2.0 * np.pi * _RIBBON / ROW * _rows_beside(places, spacing) / dense


def _rows_beside(ribbons: np.ndarray, spacing: float) -> np.ndarray:
    """How many rows there are within reach of pieces of ribbons, which share what one would get; at least 1, shape (n,)."""
    if not len(ribbons):
        return np.ones(0)
    cell = np.floor(ribbons.mean(axis=1) / (_BESIDE * spacing)).astype(np.int64)
    cell -= cell.min(axis=0) - _REACH
    size = cell.max(axis=0) + _REACH + 1
    key, which = np.unique(np.ravel_multi_index(cell.T, size), return_inverse=True)
    length = np.bincount(which, Surface.areas_of(ribbons) / (2.0 * np.pi * _RIBBON * spacing))
    steps = np.indices((2 * _REACH + 1,) * 3).reshape(3, -1).T - _REACH
    steps = steps[np.linalg.norm(steps, axis=1) <= _REACH] @ [size[1] * size[2], size[2], 1]
    beside = key[:, None] + steps
    found = np.minimum(np.searchsorted(key, beside), len(key) - 1)
    near = np.where(key[found] == beside, length[found], 0.0).sum(axis=1)
    return np.maximum(1.0, near / ((2 * _REACH + 1) * _BESIDE * spacing))[which]


def _sections(skin: Surface, points: np.ndarray, normals: np.ndarray, limit: float) -> tuple[np.ndarray, ...]:
    """Sections of the solid around points in it, along the normals of a skin near by and where it is narrowest across them.

    Not sought farther away than ``limit`` [m].

    Returns:
        Their middles, shape (n, 3) [m]; where the solid leads, across both ways, shape (n, 3); the way in which it is thinnest,
        shape (n, 3); the longer and the shorter way through, shape (n,) [m], infinite where there is no end.
    """
    aside, beside = tangents(normals)
    middle, through = points.copy(), np.full(len(points), np.inf)
    width, across, along = through.copy(), aside.copy(), beside.copy()
    for angle in np.arange(_CHORDS) * np.pi / _CHORDS:
        way = np.cos(angle) * aside + np.sin(angle) * beside
        (ahead, forth), (behind, back) = skin.cast(middle, way, limit), skin.cast(middle, -way, limit)
        facing = [np.abs(np.einsum("ij,ij->i", skin.normals[face], way)) for face in (ahead, behind)]  # not so in tubes
        end = (ahead >= 0) & (behind >= 0) & (np.minimum(*facing) > _FACING)
        k = np.flatnonzero(end & (forth + back < width))
        width[k], across[k] = (forth + back)[k], way[k]
        lead = np.cross(normals[k], skin.normals[ahead[k]])  # as all faces of a rod do
        askew = np.linalg.norm(lead, axis=1, keepdims=True) < _SKEW
        along[k] = _units(np.where(askew, np.cross(normals[k], way[k]), lead))
    k = np.flatnonzero(np.isfinite(width))
    for values, way in ((width, across), (through, normals), (width, across)):  # what lies aside tends to the middle
        forth, back = (_free_way(skin, middle[k], sign * way[k], limit) for sign in (1.0, -1.0))
        values[k] = forth + back
        end = np.isfinite(values[k])
        k, off = k[end], 0.5 * (forth[end] - back[end])
        middle[k] += off[:, None] * way[k]
    flat = np.where((through < width)[:, None], normals, across)
    return middle, along, flat, np.maximum(through, width), np.minimum(through, width)


def _free_way(skin: Surface, points: np.ndarray, ways: np.ndarray, limit: float) -> np.ndarray:
    """How far it is from points to the skin along unit vectors, shape (n,) [m], infinite where there is none within a limit."""
    face, length = skin.cast(points, ways, limit)
    return np.where(face >= 0, length, np.inf)


def _units(ways: np.ndarray) -> np.ndarray:
    return ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), _TINY)
