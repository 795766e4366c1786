"""Bridging holes: where a section of a thin ring is missing, both of its ends belong to one hole."""

from dataclasses import dataclass

import numpy as np

_APART = 0.25  # of its length by which a triangle is farther along one rim than along the other, at most
_AREA = 0.02, 0.1  # of a component's area: a bridge takes so much at least and at most
_ALONG = 0.5  # cosine between the way across and what either rim goes around, at least
_AHEAD = 0.2  # of a rim, by length, which is the end of walls that run towards the other one; of zigzags it is half
_TORN = 1.6 * np.pi, 0.3 * np.pi  # a rim turns within its walls in all, and at a corner; the mouth of a tube does not


def facing_rims(
    vertices: np.ndarray, faces: np.ndarray, owner: np.ndarray, loops: list[np.ndarray], turn: np.ndarray, area: np.ndarray
) -> list[list[int]]:
    """Pairs of torn rims, no others in their component, at which its walls run towards one another.

    Args:
        vertices: shape (n, 3) [m].
        faces: oriented, shape (m, 3).
        owner: component of each rim, shape (k,).
        loops: corners of each rim, in the direction in which a cap runs along it.
        turn: by how much each turns at its corners in all, within the surface it bounds [rad], shape (k,).
        area: of each component [m^2].
    """
    torn = (turn > _TORN[0]) & (turn > _TORN[1] * np.array([len(loop) for loop in loops]))
    pairs = [np.flatnonzero(torn & (owner == k)).tolist() for k in np.flatnonzero(np.bincount(owner[torn]) == 2)]
    return [pair for pair in pairs if _face(vertices, faces, [loops[k] for k in pair], area[owner[pair[0]]])]


def _face(vertices: np.ndarray, faces: np.ndarray, rims: list[np.ndarray], area: float) -> bool:
    """Whether two rims of a component with some area [m^2] are the ends of a gap in something thin."""
    first, second = (_looks(vertices, faces, rim) for rim in rims)
    across = second.middle - first.middle
    far = np.linalg.norm(across)
    for rim, way in ((first, across), (second, -across)):
        if abs(rim.area @ way) <= _ALONG * far * np.linalg.norm(rim.area) or rim.ahead @ way <= _AHEAD * far:
            return False
    round_ = np.sqrt(np.pi * np.linalg.norm([first.area, second.area], axis=1)).sum()  # at least, and without the zigzags
    return bool(first.area @ second.area < 0.0 and _AREA[0] * area < round_ * far < _AREA[1] * area)


def bridge(vertices: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of least area from one rim to another, each with corners of both (Fuchs, Kedem & Uselton 1977).

    They begin at the shortest way across, which is not always where the least of all would, and advance on both rims alike: two
    cones that meet in a corner have hardly more area than a tube.

    Args:
        vertices: shape (k, 3) [m].
        first: corners of a rim, in the direction in which a cap runs along it, shape (n,).
        second: those of the other, shape (m,).

    Returns:
        One loop around both, along a cut across and back, shape (n + m + 2,), and the triangles, shape (n + m, 3).
    """
    far = np.linalg.norm(vertices[first][:, None] - vertices[second], axis=2)
    i, j = np.unravel_index(far.argmin(), far.shape)
    a, b = (np.append(np.roll(rim, -k), rim[k]) for rim, k in ((first, i), (second, j)))
    back = b[::-1]  # the rims run opposite ways
    place, other = vertices[a], vertices[back]
    on_first = 0.5 * np.linalg.norm(np.cross((place[1:] - place[:-1])[:, None], other - place[:-1, None]), axis=2)
    on_second = 0.5 * np.linalg.norm(np.cross(other[1:] - other[:-1], place[:, None] - other[:-1]), axis=2)
    shares = _shares(place), _shares(other)
    most = max(_APART, *(np.diff(share).max() for share in shares))
    apart = np.abs(shares[0][:, None] - shares[1]) > most
    least = np.empty((len(a), len(back)))
    for k in range(len(a)):  # come from the corner before on the first rim, then go on along the second where that is less
        along = np.append(0.0, np.cumsum(on_second[k]))
        come = least[k - 1] + on_first[k - 1] if k else np.append(0.0, np.full(len(back) - 1, np.inf))
        least[k] = along + np.minimum.accumulate(np.where(apart[k], np.inf, come) - along)
        least[k, apart[k]] = np.inf
    k, m, triangles = len(a) - 1, len(back) - 1, []
    while k or m:
        if not m or (k and least[k - 1, m] + on_first[k - 1, m] <= least[k, m - 1] + on_second[k, m - 1]):
            triangles.append([a[k - 1], a[k], back[m]])
            k -= 1
        else:
            triangles.append([a[k], back[m], back[m - 1]])
            m -= 1
    return np.concatenate([a, b]), np.array(triangles, np.int64)


def _shares(path: np.ndarray) -> np.ndarray:
    """How far along a path its corners lie, 0 to 1."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    return along / max(along[-1], 1e-300)


@dataclass(frozen=True)
class _Rim:
    """What a rim looks like.

    Attributes:
        middle: shape (3,) [m].
        area: that it goes around, as a vector, shape (3,) [m^2].
        ahead: mean along it of unit vectors in the walls, across it and away from them, shape (3,). At the end of a bar all are
            much the same, around a hole in a plate they cancel.
    """

    middle: np.ndarray
    area: np.ndarray
    ahead: np.ndarray


def _looks(vertices: np.ndarray, faces: np.ndarray, rim: np.ndarray) -> _Rim:
    here, after = vertices[rim], vertices[np.roll(rim, -1)]
    along = after - here
    step = np.linalg.norm(along, axis=1)
    number = len(vertices)
    side = faces * number + np.roll(faces, -1, axis=1)
    face, corner = np.nonzero(np.isin(side, np.roll(rim, -1) * number + rim))  # the face beyond runs the other way
    _, edge = np.nonzero(rim[None] == faces[face, (corner + 1) % 3][:, None])
    out = here[edge] - vertices[faces[face, (corner + 2) % 3]]
    unit = along[edge] / np.maximum(step[edge], 1e-300)[:, None]
    out -= np.einsum("ij,ij->i", out, unit)[:, None] * unit
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
    middle = step @ (here + after) / (2.0 * step.sum())
    area = 0.5 * np.cross(here - middle, after - middle).sum(axis=0)
    return _Rim(middle, area, step[edge] @ out / step.sum())
