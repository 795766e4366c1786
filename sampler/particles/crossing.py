"""Along which planes pieces of a surface must be cut, so that each is free or buried as a whole."""

import numpy as np
import warp as wp

from sampler.geometry.surface import Surface
from sampler.launching import launch_shares

_RIM = 1.0e-6  # of the diagonal: what only meets the rim of a piece, as its neighbours do, does not count
_PARALLEL = 0.99  # cosine of the angle between triangles from which one that does not split the other may still cover part of it

# The other triangle, clipped by the planes through the edges of the piece and by two along it: is anything left?
_REACHES = """
    using namespace wp;
    const vec3 piece[3] = {vec3(0.0f), b - a, c - a};
    const vec3 normal = normalize(cross(piece[1], piece[2]));
    vec3 polygon[8] = {p - a, q - a, r - a};
    int count = 3;
    for (int side = 0; side < 5 && count; ++side) {
        const vec3 along = piece[(side + 1) % 3] - piece[side % 3];
        const vec3 inward = side == 3 ? normal : (side == 4 ? -normal : normalize(cross(normal, along)));
        const float level = side < 3 ? dot(inward, piece[side]) + rim : (side == 3 ? least : -most);
        vec3 kept[8];
        int number = 0;
        for (int k = 0; k < count; ++k) {
            const vec3 from = polygon[k], to = polygon[(k + 1) % count];
            const float u = dot(inward, from) - level, v = dot(inward, to) - level;
            if (u >= 0.0f) kept[number++] = from;
            if ((u >= 0.0f) != (v >= 0.0f)) kept[number++] = from + (to - from) * (u / (u - v));
        }
        count = number;
        for (int k = 0; k < count; ++k) polygon[k] = kept[k];
    }
    return count > 0;
"""


@wp.func_native(_REACHES)
def reaches(
    a: wp.vec3, b: wp.vec3, c: wp.vec3, p: wp.vec3, q: wp.vec3, r: wp.vec3, rim: float, least: float, most: float
) -> bool:
    """Whether any of the triangle p, q, r lies over the inside of the triangle a, b, c, between two heights over its plane."""
    ...


@wp.func
def splits(normal: wp.vec3, p: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3) -> bool:
    """Whether the plane through p has corners of the triangle a, b, c on both sides."""
    x = wp.dot(normal, a - p)
    y = wp.dot(normal, b - p)
    z = wp.dot(normal, c - p)
    return wp.min(wp.min(x, y), z) < -_RIM and wp.max(wp.max(x, y), z) > _RIM


@wp.func
def splitting_plane(a: wp.vec3, b: wp.vec3, c: wp.vec3, p: wp.vec3, q: wp.vec3, r: wp.vec3, near: float) -> int:
    """Plane of the triangle p, q, r that splits the triangle a, b, c; -1 for none.

    0 is its own plane. Where both lie in about one plane it is 1 to 3, the upright one over its first to third edge.
    """
    normal = wp.normalize(wp.cross(q - p, r - p))
    away = wp.max(wp.max(wp.abs(wp.dot(normal, a - p)), wp.abs(wp.dot(normal, b - p))), wp.abs(wp.dot(normal, c - p)))
    if away > near and splits(normal, p, a, b, c):
        return 0
    if wp.abs(wp.dot(normal, wp.normalize(wp.cross(b - a, c - a)))) < _PARALLEL:
        return -1
    if splits(wp.normalize(wp.cross(normal, q - p)), p, a, b, c):
        return 1
    if splits(wp.normalize(wp.cross(normal, r - q)), q, a, b, c):
        return 2
    return wp.where(splits(wp.normalize(wp.cross(normal, p - r)), r, a, b, c), 3, -1)


@wp.kernel(enable_backward=False, module="sampler_crossing")
def find_crossing(mesh: wp.uint64, corners: wp.array(dtype=wp.vec3), near: float, first: int, found: wp.array(dtype=int)):
    """Four times a triangle of the mesh that comes through a piece, ends on it or covers part of it, and its plane; else -1."""
    i = first + wp.tid()
    a = corners[3 * i]
    b = corners[3 * i + 1]
    c = corners[3 * i + 2]
    margin = wp.vec3(near)
    low = wp.min(wp.min(a, b), c) - margin
    high = wp.max(wp.max(a, b), c) + margin
    points = wp.mesh_get(mesh).points
    best = int(-1)
    for face in wp.mesh_query_aabb(mesh, low, high):
        if best < 0:
            p = points[3 * face]
            q = points[3 * face + 1]
            r = points[3 * face + 2]
            plane = splitting_plane(a, b, c, p, q, r, near)
            if plane >= 0 and reaches(a, b, c, p, q, r, _RIM, -near, near):
                best = 4 * face + plane
    found[i] = best


@wp.kernel(enable_backward=False, module="sampler_crossing")
def find_before(
    mesh: wp.uint64, corners: wp.array(dtype=wp.vec3), least: float, most: float, first: int, found: wp.array(dtype=int)
):
    """Whether any of the mesh lies before each piece, between two heights over it."""
    i = first + wp.tid()
    a = corners[3 * i]
    b = corners[3 * i + 1]
    c = corners[3 * i + 2]
    up = most * wp.normalize(wp.cross(b - a, c - a))
    low = wp.min(wp.min(a, b), c)
    high = wp.max(wp.max(a, b), c)
    points = wp.mesh_get(mesh).points
    any = int(0)
    for face in wp.mesh_query_aabb(mesh, wp.min(low, low + up), wp.max(high, high + up)):
        if any == 0 and reaches(a, b, c, points[3 * face], points[3 * face + 1], points[3 * face + 2], _RIM, least, most):
            any = 1
    found[i] = any


@wp.kernel(enable_backward=False, module="sampler_crossing")
def find_layers(
    mesh: wp.uint64,
    places: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    near: float,
    first: int,
    layers: wp.array(dtype=int),
):
    """How many triangles of the mesh a place lies on that face as its normal does, less those that face the other way."""
    i = first + wp.tid()
    x = places[i]
    margin = wp.vec3(near)
    points = wp.mesh_get(mesh).points
    number = int(0)
    for face in wp.mesh_query_aabb(mesh, x - margin, x + margin):
        p = points[3 * face]
        q = points[3 * face + 1]
        r = points[3 * face + 2]
        normal = wp.normalize(wp.cross(q - p, r - p))
        facing = wp.dot(normal, normals[i])
        if (
            wp.abs(facing) > _PARALLEL
            and wp.abs(wp.dot(x - p, normal)) <= near
            and wp.dot(wp.cross(normal, q - p), x - p) >= 0.0
            and wp.dot(wp.cross(normal, r - q), x - q) >= 0.0
            and wp.dot(wp.cross(normal, p - r), x - r) >= 0.0
        ):
            number += int(wp.sign(facing))
    layers[i] = number


def count_layers(points: np.ndarray, normals: np.ndarray, around: Surface, near: float) -> np.ndarray:
    """By how much the winding number of a surface falls where one goes through it along normals.

    Args:
        points: shape (n, 3) [m].
        normals: shape (n, 3).
        around: the surface.
        near: how near to a point a triangle must come to count [m].

    Returns:
        Shape (n,) int.
    """
    layers = wp.empty(len(points), dtype=int, device=around.device)
    inputs = [around.mesh.id, around.shift(points), around.vectors(normals), near / around.unit]
    launch_shares(find_layers, len(points), inputs, [layers], around.device)
    return layers.numpy()


def have_before(pieces: np.ndarray, around: Surface, least: float, most: float) -> np.ndarray:
    """Whether any of a surface lies before parts of its triangles, shape (n, 3, 3) [m], between two heights [m]; shape (n,)."""
    found = wp.empty(len(pieces), dtype=int, device=around.device)
    inputs = [around.mesh.id, around.shift(pieces.reshape(-1, 3)), least / around.unit, most / around.unit]
    launch_shares(find_before, len(pieces), inputs, [found], around.device)
    return found.numpy() > 0


def crossing_planes(pieces: np.ndarray, around: Surface, near: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Planes along which what lies before or behind pieces of a surface changes, one for each piece that there is any for.

    Args:
        pieces: parts of its triangles, shape (n, 3, 3) [m].
        around: the surface.
        near: how near to a piece a triangle must come to count [m].

    Returns:
        Numbers of the pieces, shape (m,); unit normals of the planes, shape (m, 3), and a point on each, shape (m, 3) [m].
    """
    found = wp.empty(len(pieces), dtype=int, device=around.device)
    corners = around.shift(pieces.reshape(-1, 3))
    launch_shares(find_crossing, len(pieces), [around.mesh.id, corners, near / around.unit], [found], around.device)
    found = found.numpy()
    crossed = np.flatnonzero(found >= 0)
    face, plane = np.divmod(found[crossed], 4)
    corner, normal = around.triangles[face], around.normals[face]
    row, edge = np.arange(len(face)), np.maximum(plane - 1, 0)
    begin, end = corner[row, edge], corner[row, (edge + 1) % 3]
    upright = np.cross(normal, end - begin)
    upright /= np.maximum(np.linalg.norm(upright, axis=1, keepdims=True), np.finfo(float).tiny)
    normal = np.where(plane[:, None] > 0, upright, normal)
    height = np.einsum("nij,nj->ni", pieces[crossed] - begin[:, None], normal) / around.unit
    sure = (height.min(axis=1) < -_RIM) & (height.max(axis=1) > _RIM)  # in double precision, too
    return crossed[sure], normal[sure], begin[sure]


def cut_triangles(triangles: np.ndarray, normals: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut each triangle, shape (n, 3, 3) [m], along its plane, given by a normal and a place, shape (n, 3).

    Returns:
        Parts, shape (m, 3, 3) [m], and the triangle that each is from, shape (m,).
    """
    height = np.einsum("nij,nj->ni", triangles - places[:, None], normals)
    above = height > 0.0
    alone = np.argmax(above != (above.sum(axis=1, keepdims=True) > 1), axis=1)  # the corner that has its side for itself
    turn = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
    u, v, w = np.take_along_axis(height, turn, axis=1)[:, :, None].transpose(1, 0, 2)
    p, q = a + (b - a) * (u / (u - v)), a + (c - a) * (u / (u - w))
    parts = np.concatenate([np.stack(part, axis=1) for part in ((a, p, q), (p, b, c), (p, c, q))])
    parent = np.tile(np.arange(len(triangles)), 3)
    kept = Surface.areas_of(parts) > 0.0
    return parts[kept], parent[kept]
