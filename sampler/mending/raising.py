"""Raising caps: over a hole in a curved surface, at an edge or a corner, they go on as the faces around it do, instead of flat.

A rim that lies in a plane is taken for a cut, a wide hole for the mouth of a vessel; their caps stay flat. Others are split once,
and each new place is where the planes of the faces along the rim meet best (quadric error, Garland & Heckbert 1997), near ones
above all. Places that would move through faces stay.
"""

import numpy as np

from sampler.geometry.surface import Surface
from sampler.geometry.topology import edges_of
from sampler.mending.caps import Caps

_HOLD = 0.02  # weight of the flat cap beside the planes, which otherwise may not meet at all
_STEEP = 1.5  # times its distance from the rim a place moves at most: the corner of a box is 1.4 times as high
_PLANE = 1e-3  # of its own length a rim leaves a plane at most that it lies in
_PAIRS = 1_000_000  # places times rim edges, as many as are held at once
_COMPARED = 500  # faces along a rim are compared each with each


def raise_caps(
    vertices: np.ndarray, faces: np.ndarray, caps: Caps, taken: np.ndarray, most: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Raise caps after the faces around them.

    Args:
        vertices: shape (n, 3) [m].
        faces: those around the holes, oriented, shape (m, 3).
        caps: flat.
        taken: faces of the caps that are asked for, whole loops, shape (k,).
        most: area that the cap of a hole has at most to be raised, of each component [m^2].

    Returns:
        Vertices with new ones at the end, shape (n + more, 3) [m]; faces of the caps and their components, shapes (j, 3), (j,).
    """
    if not taken.any():
        return vertices, caps.faces[:0], caps.owner[:0]
    number = len(vertices)
    side = (faces * number + np.roll(faces, -1, axis=1)).ravel()
    order = np.argsort(side)
    side = side[order]
    around, points, count = None, [vertices], number
    raised, owner = [], []
    for group in np.split(np.flatnonzero(taken), np.flatnonzero(np.diff(caps.loop[taken])) + 1):
        cap, loop, component = caps.faces[group], caps.loops[caps.loop[group[0]]], caps.owner[group[0]]
        sought = np.roll(loop, -1) * number + loop  # the face beyond runs the other way
        beyond = np.searchsorted(side, sought).clip(max=len(side) - 1)
        narrow = Surface.areas_of(vertices[cap]).sum() < most[component]
        if narrow and np.all(side[beyond] == sought) and not _plane(vertices[loop]):
            around = around or Surface(vertices[faces])
            middles, cap = _split(vertices, cap, count)
            points.append(_moved(around, middles, _meeting(middles, vertices[loop], vertices[faces[order[beyond] // 3]])))
            count += len(middles)
        raised.append(cap)
        owner.append(np.full(len(cap), component))
    return np.concatenate(points), np.concatenate(raised), np.concatenate(owner)


def _moved(around: Surface, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Places, shape (n, 3) [m], moved, but for those with a face on their way, as of the other skin of a thin wall."""
    way = end - begin
    length = np.linalg.norm(way, axis=1)
    far = np.flatnonzero(length > 1e-9 * around.unit)
    face, free = around.cast(begin[far], way[far] / length[far, None])
    place = end.copy()
    stay = far[(face >= 0) & (free < length[far])]
    place[stay] = begin[stay]
    return place


def _plane(rim: np.ndarray) -> bool:
    """Whether the corners of a rim, shape (n, 3) [m], lie in a plane."""
    off = rim - rim.mean(axis=0)
    return bool(np.linalg.svd(off, compute_uv=False)[-1] <= _PLANE * np.ptp(off, axis=0).max() * np.sqrt(len(rim)))


def _split(vertices: np.ndarray, cap: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Split a cap at the middle of all its edges but those of the rim.

    Returns:
        These middles, shape (k, 3) [m]; faces, in which they have the numbers from ``first`` on, shape (j, 3).
    """
    edges = edges_of(cap)
    inner = edges.degree == 2
    middle = np.empty(3 * len(cap), np.int64)
    middle[edges.half] = np.where(inner, first - 1 + np.cumsum(inner), -1)[edges.edge]
    faces = []
    for corners, middles in zip(cap.tolist(), middle.reshape(-1, 3).tolist(), strict=True):
        ring = [number for pair in zip(corners, middles, strict=True) for number in pair if number >= 0]
        start = next(k for k, number in enumerate(ring) if number >= first)  # from a middle no triangle of the fan is flat
        ring = ring[start:] + ring[:start]
        faces += [[ring[0], *ring[k : k + 2]] for k in range(1, len(ring) - 1)]
    return vertices[edges.ends[inner]].mean(axis=1), np.array(faces, np.int64)


def _meeting(places: np.ndarray, rim: np.ndarray, beyond: np.ndarray) -> np.ndarray:
    """Where, near places of a flat cap, the planes beyond its rim meet.

    Around a smooth surface these meet twice as high as it is, at an edge or a corner just there. How much of the way is right is
    told by the sharpest turn from one face to the next, beside the widest between any two.

    Args:
        places: shape (k, 3) [m].
        rim: corners, shape (n, 3) [m].
        beyond: face at each of its edges, corners, shape (n, 3, 3) [m].
    """
    normal = np.cross(beyond[:, 1] - beyond[:, 0], beyond[:, 2] - beyond[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    some = normal[:: 1 + len(normal) // _COMPARED]
    cosines = np.einsum("ij,ij->i", normal, np.roll(normal, 1, axis=0)), some @ some.T
    sharpest, widest = (np.arccos(np.clip(values.min(), -1.0, 1.0)) for values in cosines)
    share = 0.5 + 0.5 * sharpest / max(widest, sharpest, 1e-9)
    along = np.roll(rim, -1, axis=0) - rim
    length = np.linalg.norm(along, axis=1)
    planes = np.einsum("ij,il->ijl", normal, normal).reshape(-1, 9)
    found = []
    for place in np.array_split(places, 1 + len(places) * len(rim) // _PAIRS):
        t = np.einsum("kij,ij->ki", place[:, None] - rim, along) / np.maximum(length**2, 1e-300)
        from_rim = place[:, None] - rim - np.clip(t, 0.0, 1.0)[..., None] * along
        distance = np.maximum(np.linalg.norm(from_rim, axis=2), 1e-9 * length.sum())
        weight = length / distance**2
        weight /= weight.sum(axis=1, keepdims=True)
        square = (weight @ planes).reshape(-1, 3, 3) + _HOLD * np.eye(3)
        pull = (weight * np.einsum("kij,ij->ki", from_rim, normal)) @ normal
        move = -share * np.linalg.solve(square, pull[..., None])[..., 0]
        most = _STEEP * distance.min(axis=1) / np.maximum(np.linalg.norm(move, axis=1), 1e-300)
        found.append(place + np.minimum(1.0, most)[:, None] * move)
    return np.concatenate(found)
