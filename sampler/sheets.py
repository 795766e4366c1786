"""Sheets: surfaces modelled without thickness, turned into closed solids."""

import numpy as np

from sampler.geometry.surface import Surface
from sampler.geometry.topology import edges_of, halves_around, link_items
from sampler.mass import inertia_of, joined
from sampler.mending.caps import close_holes
from sampler.mending.repair import SHEET, RepairedMesh
from sampler.particles.skin import Skin

_PAIRS = 10_000  # of places in plates, of which is asked whether they lie in a solid


def closed_triangles(repaired: RepairedMesh, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """Solids, caps and sheets of a thickness [m]; sheets without any get a front and a back in one place.

    Returns:
        Triangles, shape (n, 3, 3) [m], and the kind of the faces they come from, shape (n,).
    """
    triangles, sheet = repaired.triangles, repaired.kind == SHEET
    if not sheet.any():
        return triangles, repaired.kind
    sound = sheet & (Surface.areas_of(triangles) > 0.0)
    if thickness > 0.0:
        place, faces = thicken(repaired.vertices, repaired.faces[sound], thickness)
        skins = place[faces]
    else:
        skins = np.concatenate([triangles[sound], triangles[sound][:, ::-1]])
    kind = np.concatenate([repaired.kind[~sheet], np.full(len(skins), SHEET)])
    return np.concatenate([triangles[~sheet], skins]), kind


def thick_plates(triangles: np.ndarray, thickness: float) -> np.ndarray:
    """Closed prisms, so thick [m], around triangles, shape (n, 3, 3) [m]; shape (8 n, 3, 3)."""
    aside = 0.5 * thickness * Surface.normals_of(triangles)[:, None]
    front, back = triangles + aside, triangles - aside
    parts = [front, back[:, ::-1]]
    for k in range(3):
        a, b, c, d = front[:, k], front[:, (k + 1) % 3], back[:, (k + 1) % 3], back[:, k]
        parts += [np.stack([b, a, d], axis=1), np.stack([b, d, c], axis=1)]
    return np.concatenate(parts)


def plates_outside(triangles: np.ndarray, thickness: float, solid: Surface) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Volume, centre and inertia per unit density, as ``integrate`` tells them, of what plates have outside of a solid.

    From places at random, in pairs on both sides of the plates; None if all are outside.

    Args:
        triangles: middles of the plates, shape (n, 3, 3) [m].
        thickness: of the plates [m].
        solid: a closed surface.
    """
    skin, random = Skin(triangles), np.random.default_rng(0)
    middle, normals = skin.sample(_PAIRS, random)
    aside = thickness * random.uniform(0.0, 0.5, (_PAIRS, 1)) * normals
    places = np.concatenate([middle - aside, middle + aside])
    outside = np.abs(solid.winding(places)) < 0.5
    if outside.all():
        return None
    one, places = thickness * float(skin.areas.sum()) / len(places), places[outside]
    if not len(places):
        return joined([])
    centre = places.mean(axis=0)
    spread = one * (places - centre).T @ (places - centre)
    return one * len(places), centre, inertia_of(spread)


def thicken(vertices: np.ndarray, faces: np.ndarray, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """Closed surface at half a thickness from both sides of a sheet, with flat rims.

    Each triangle gets a front and a back. Around an edge each side goes over into the side of the next triangle that it faces;
    at a rim, front and back are joined. So sheets may branch and need not be orientable. A corner moves so that it keeps its
    distance from all planes it belongs to, at most to twice that distance; that of a fold sharper than 11 degrees stays.

    Args:
        vertices: shape (n, 3) [m].
        faces: without faces of no area, shape (m, 3).
        thickness: of the wall [m].

    Returns:
        Vertices, shape (k, 3) [m], and outward faces, shape (2 m + rim, 3).
    """
    number = len(faces)
    a, b, rim = _continued_sides(vertices, faces)
    corner = {side: side * 3 * number + np.arange(3 * number).reshape(-1, 3) for side in (0, 1)}
    corners = np.concatenate([corner[0], corner[1]])  # of front sides, then of back sides, in the order of the sheet's faces
    first, second = _common_corners(faces, a, b)
    joined, _, _ = link_items(6 * number, corners[a][first], corners[b][second])
    normal = Surface.normals_of(vertices[faces])
    normal = np.repeat(np.concatenate([normal, -normal]), 3, axis=0)
    offset = _corner_offsets(normal, joined)
    place = np.zeros((int(joined.max()) + 1, 3))
    place[joined] = vertices[np.tile(faces.ravel(), 2)]
    front, back = joined[corner[0]], joined[corner[1]]
    tail = rim % 3
    face, head = rim // 3, (tail + 1) % 3
    strip = [
        np.stack([front[face, head], front[face, tail], back[face, tail]], axis=1),
        np.stack([front[face, head], back[face, tail], back[face, head]], axis=1),
    ]
    faces = np.concatenate([front, back[:, ::-1], *strip])
    ends = close_holes(place, faces, np.zeros(len(faces), np.int64))  # where several rims meet
    return place + 0.5 * thickness * offset, np.concatenate([faces, ends.faces])


def _continued_sides(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sides (face, or face + number for its back) that go over into one another at an edge, and the half-edges of rims."""
    edges, number = edges_of(faces), len(faces)
    a, b = [], []
    pair = edges.of(2)
    p, q = edges.face[pair].T
    same = edges.forward[pair[:, 0]] == edges.forward[pair[:, 1]]
    a += [p, p + number]
    b += [np.where(same, q + number, q), np.where(same, q, q + number)]
    for k in np.flatnonzero(edges.degree > 2):
        half = halves_around(vertices, faces, edges, k)
        face, forward = edges.face[half], edges.forward[half]
        # The front of a face that runs forward looks the way in which the angle grows.
        a.append(np.where(forward, face, face + number))
        b.append(np.roll(np.where(forward, face + number, face), -1))
    rim = edges.half[edges.of(1)[:, 0]]
    return np.concatenate(a), np.concatenate(b), rim


def _common_corners(faces: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[tuple, tuple]:
    """Row and corner of the vertices that two sides share, for both of them."""
    p, q = faces[a % len(faces)], faces[b % len(faces)]
    row, i, j = np.nonzero(p[:, :, None] == q[:, None, :])
    return (row, i), (row, j)


def _corner_offsets(normal: np.ndarray, joined: np.ndarray) -> np.ndarray:
    """Move of each joined corner that takes it one unit away from all its planes, least squares, shape (k, 3)."""
    number = int(joined.max()) + 1
    x, y, z = normal.T
    sums = [np.bincount(joined, values, number) for values in (x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)]
    right = np.stack(sums[:3], axis=1)
    matrix = np.stack([sums[k] for k in (3, 4, 5, 4, 6, 7, 5, 7, 8)], axis=1).reshape(-1, 3, 3)
    value, vector = np.linalg.eigh(matrix)
    sound = value > 1e-2 * value[:, -1:]
    share = np.einsum("kji,kj->ki", vector, right) * np.where(sound, 1.0 / np.where(sound, value, 1.0), 0.0)
    offset = np.einsum("kij,kj->ki", vector, share)
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    return offset * np.minimum(1.0, 2.0 / np.maximum(length, 1e-300))
