"""Closest points of triangles: one in a kernel, and many in double precision."""

import numpy as np
import warp as wp

from sampler.geometry.vectors import cross


@wp.func
def closest_on_edge(a: wp.vec3d, b: wp.vec3d) -> wp.vec3d:
    """Closest point of a line between two ends to the origin."""
    along = b - a
    square = wp.dot(along, along)
    if square == wp.float64(0.0):
        return a
    return a + along * wp.clamp(-wp.dot(a, along) / square, wp.float64(0.0), wp.float64(1.0))


@wp.func
def closest_point(x: wp.vec3, y: wp.vec3, z: wp.vec3, p: wp.vec3) -> wp.vec3:
    """Closest point of a triangle; in single precision it would lie off the plane of long thin ones."""
    here = wp.vec3d(p)
    a = wp.vec3d(x) - here
    b = wp.vec3d(y) - here
    c = wp.vec3d(z) - here
    n = wp.cross(b - a, c - a)
    area = wp.dot(n, n)
    inside = area > wp.float64(0.0)
    if wp.dot(wp.cross(a, b - a), n) < wp.float64(0.0):
        inside = False
    if wp.dot(wp.cross(b, c - b), n) < wp.float64(0.0):
        inside = False
    if wp.dot(wp.cross(c, a - c), n) < wp.float64(0.0):
        inside = False
    if inside:
        return wp.vec3(here + n * (wp.dot(a, n) / area))
    best = closest_on_edge(a, b)
    other = closest_on_edge(b, c)
    if wp.length_sq(other) < wp.length_sq(best):
        best = other
    other = closest_on_edge(c, a)
    if wp.length_sq(other) < wp.length_sq(best):
        best = other
    return wp.vec3(here + best)


def closest_on_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Closest point of one triangle to one point each, in double precision, also on triangles without area.

    Args:
        points: shape (n, 3) [m].
        triangles: shape (n, 3, 3) [m].
    """
    best = None
    for k in range(3):  # the three edges
        a, along = triangles[:, k], triangles[:, (k + 1) % 3] - triangles[:, k]
        square = np.einsum("ij,ij->i", along, along)
        share = np.einsum("ij,ij->i", points - a, along) / np.where(square > 0.0, square, 1.0)
        near = a + np.clip(share, 0.0, 1.0)[:, None] * along
        far = np.einsum("ij,ij->i", points - near, points - near)
        if best is None:
            best, least = near, far
        else:
            better = far < least
            best, least = np.where(better[:, None], near, best), np.where(better, far, least)
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = cross(u, v)
    square = np.einsum("ij,ij->i", normal, normal)
    safe = np.where(square > 0.0, square, 1.0)
    out = points - a
    p = np.einsum("ij,ij->i", cross(out, v), normal) / safe
    q = np.einsum("ij,ij->i", cross(u, out), normal) / safe
    inside = (square > 0.0) & (p >= 0.0) & (q >= 0.0) & (p + q <= 1.0)
    foot = points - (np.einsum("ij,ij->i", out, normal) / safe)[:, None] * normal
    return np.where(inside[:, None], foot, best)
