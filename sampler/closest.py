"""Closest points of triangles: one in a kernel, and many in double precision."""

import numpy as np
import warp as wp


@wp.func
def closest_on_edge(a: wp.vec3, b: wp.vec3, p: wp.vec3) -> wp.vec3:
    """Closest point of a line between two ends."""
    along = b - a
    square = wp.dot(along, along)
    if square == 0.0:
        return a
    return a + along * wp.clamp(wp.dot(p - a, along) / square, 0.0, 1.0)


@wp.func
def closest_point(a: wp.vec3, b: wp.vec3, c: wp.vec3, p: wp.vec3) -> wp.vec3:
    """Closest point of a triangle."""
    n = wp.cross(b - a, c - a)
    area = wp.dot(n, n)
    inside = area > 0.0
    if wp.dot(wp.cross(b - a, p - a), n) < 0.0:
        inside = False
    if wp.dot(wp.cross(c - b, p - b), n) < 0.0:
        inside = False
    if wp.dot(wp.cross(a - c, p - c), n) < 0.0:
        inside = False
    if inside:
        return p - n * (wp.dot(p - a, n) / area)
    best = closest_on_edge(a, b, p)
    other = closest_on_edge(b, c, p)
    if wp.length_sq(other - p) < wp.length_sq(best - p):
        best = other
    other = closest_on_edge(c, a, p)
    if wp.length_sq(other - p) < wp.length_sq(best - p):
        best = other
    return best


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
    normal = np.cross(u, v)
    square = np.einsum("ij,ij->i", normal, normal)
    safe = np.where(square > 0.0, square, 1.0)
    out = points - a
    p = np.einsum("ij,ij->i", np.cross(out, v), normal) / safe
    q = np.einsum("ij,ij->i", np.cross(u, out), normal) / safe
    inside = (square > 0.0) & (p >= 0.0) & (q >= 0.0) & (p + q <= 1.0)
    foot = points - (np.einsum("ij,ij->i", out, normal) / safe)[:, None] * normal
    return np.where(inside[:, None], foot, best)


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Of vectors, shape (..., 3), several times as fast as NumPy's norm; shape (...)."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
