"""Which pieces of a surface other triangles come through or end on; all others are free or buried as a whole."""

import numpy as np
import warp as wp

from sampler.surface import Surface, launch_shares

_SHRUNK = 0.98  # of a piece: what only meets its rim, as its neighbours do, does not count

# The other triangle, clipped by the planes through the edges of the piece and by one before and one behind it: is anything left?
_REACHES = """
    using namespace wp;
    const vec3 piece[3] = {vec3(0.0f), b - a, c - a};
    const vec3 normal = normalize(cross(piece[1], piece[2]));
    vec3 polygon[8] = {p - a, q - a, r - a};
    int count = 3;
    for (int side = 0; side < 5 && count; ++side) {
        const vec3 along = piece[(side + 1) % 3] - piece[side % 3];
        const vec3 inward = side == 3 ? normal : (side == 4 ? -normal : cross(normal, along));
        const float level = side < 3 ? dot(inward, piece[side]) : -near;
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
def reaches(a: wp.vec3, b: wp.vec3, c: wp.vec3, p: wp.vec3, q: wp.vec3, r: wp.vec3, near: float) -> bool:
    """Whether any of the triangle p, q, r lies over the triangle a, b, c, nearer to its plane than ``near``."""
    ...


@wp.func
def lies_on(x: wp.vec3, p: wp.vec3, q: wp.vec3, r: wp.vec3, near: float) -> bool:
    """Whether a point lies over a triangle, nearer to its plane than ``near``."""
    normal = wp.normalize(wp.cross(q - p, r - p))
    return (
        wp.abs(wp.dot(x - p, normal)) <= near
        and wp.dot(wp.cross(normal, q - p), x - p) >= 0.0
        and wp.dot(wp.cross(normal, r - q), x - q) >= 0.0
        and wp.dot(wp.cross(normal, p - r), x - r) >= 0.0
    )


@wp.kernel(enable_backward=False, module="sampler_crossing")
def find_crossed(mesh: wp.uint64, corners: wp.array(dtype=wp.vec3), near: float, first: int, crossed: wp.array(dtype=int)):
    """1 where a triangle of the mesh reaches a piece without lying on all of it, as its own triangle does; else 0."""
    i = first + wp.tid()
    a = corners[3 * i]
    b = corners[3 * i + 1]
    c = corners[3 * i + 2]
    margin = wp.vec3(near)
    low = wp.min(wp.min(a, b), c) - margin
    high = wp.max(wp.max(a, b), c) + margin
    points = wp.mesh_get(mesh).points
    found = int(0)
    for face in wp.mesh_query_aabb(mesh, low, high):
        if found == 0:
            p = points[3 * face]
            q = points[3 * face + 1]
            r = points[3 * face + 2]
            covers = lies_on(a, p, q, r, near) and lies_on(b, p, q, r, near) and lies_on(c, p, q, r, near)
            if not covers and reaches(a, b, c, p, q, r, near):
                found = 1
    crossed[i] = found


def crossed_pieces(pieces: np.ndarray, around: Surface, near: float) -> np.ndarray:
    """Whether what lies before or behind a piece of a surface may change within it.

    Args:
        pieces: parts of its triangles, shape (n, 3, 3) [m].
        around: the surface.
        near: how near to a piece a triangle must come to count [m].

    Returns:
        Shape (n,).
    """
    centre = pieces.mean(axis=1, keepdims=True)
    corners = around.shift((centre + _SHRUNK * (pieces - centre)).reshape(-1, 3))
    crossed = wp.empty(len(pieces), dtype=int, device=around.device)
    launch_shares(find_crossed, len(pieces), [around.mesh.id, corners, near / around.unit], [crossed], around.device)
    return crossed.numpy() == 1
