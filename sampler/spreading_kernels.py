"""Kernels that move particles over a surface; lengths in units of the mesh's diagonal."""

import warp as wp

from sampler.gap_kernels import MODULE, SAME
from sampler.surface import ASIDE, nearest_face

_OTHER = wp.constant(-0.7)  # between normals below which two places lie on different skins
_THROWN = wp.constant(0.85)  # how near to each other particles of different skins may be thrown, of those on one skin
_CORE, _HARD = wp.constant(8.0), wp.constant(1.25)  # what holds particles apart: strength, and range, of how far they were thrown
_SIDE = wp.constant(0.6)  # by how much weaker particles push on the other skin of a wall, so that neighbours change sides
FREE, HELD, BEYOND = wp.constant(0), wp.constant(1), wp.constant(2)
_BACK = wp.constant(0.33)  # strength of points beyond a rim
_LEVEL = wp.constant(0.3)  # how far out of the plane of another they may lie to push it, in spacings
_FARTHEST = wp.constant(0.3)  # of a step, in spacings


@wp.func
def same_skin(a: wp.vec3, b: wp.vec3) -> float:
    """1 for places on one skin, 0 for the two skins of a wall, smooth between."""
    share = wp.clamp((wp.dot(a, b) - _OTHER) / (SAME - _OTHER), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


@wp.func
def repulsion(distance: float, spacing: float) -> float:
    """Gaussian that has faded at two spacings (source document A)."""
    share = distance / spacing
    return wp.max(wp.exp(-2.0 * share * share) - wp.exp(-8.0), 0.0)


@wp.kernel(enable_backward=False, module=MODULE)
def push_apart(
    grid: wp.uint64,
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    corners: wp.array(dtype=wp.vec3),
    face_normals: wp.array(dtype=wp.vec3),
    held: wp.array(dtype=int),
    spacing: float,
    apart: float,
    strength: float,
    first: int,
    moved: wp.array(dtype=wp.vec3),
    moved_normals: wp.array(dtype=wp.vec3),
):
    """Push each point away from its neighbours, also through a wall, and bring it back to the surface.

    Points that are held stay; those beyond the rim of a sheet push those that lie in about one plane with them.
    """
    i = first + wp.tid()
    here = points[i]
    up = normals[i]
    moved[i] = here
    moved_normals[i] = up
    if held[i] != FREE:
        return
    push = wp.vec3(0.0)
    for j in wp.hash_grid_query(grid, here, 2.0 * spacing):
        if j != i:
            away = here - points[j]
            distance = wp.length(away)
            beyond = held[j] == BEYOND
            if distance < 2.0 * spacing and not (beyond and wp.abs(wp.dot(away, up)) > _LEVEL * spacing):
                weight = repulsion(distance, spacing) * (1.0 + _SIDE * (same_skin(up, normals[j]) - 1.0))
                if beyond:
                    weight *= _BACK
                else:
                    weight += _CORE * wp.max(_HARD * apart - distance, 0.0) / spacing
                push += away * (weight / wp.max(distance, 1.0e-3 * spacing))
    step = push * strength
    step *= wp.min(1.0, _FARTHEST * spacing / wp.max(wp.length(step), 1.0e-12))
    there = here + step
    face = nearest_face(mesh, there, 1.01 * wp.length(step) + 1.0e-3 * spacing, up, ASIDE)
    if face >= 0:
        moved[i] = closest_point(corners[3 * face], corners[3 * face + 1], corners[3 * face + 2], there)
        moved_normals[i] = face_normals[face]


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


@wp.kernel(enable_backward=False, module=MODULE)
def throw_darts(
    grid: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    apart: float,
    wanted: int,
    kept: wp.array(dtype=int),
):
    """Keep points one after another if none kept lies nearer than ``apart`` on the same skin; one thread."""
    number = int(0)
    for i in range(points.shape[0]):
        if number < wanted:
            here = points[i]
            free = int(1)
            for j in wp.hash_grid_query(grid, here, apart):
                if kept[j] == 1:
                    distance = wp.length(points[j] - here)
                    same = same_skin(normals[i], normals[j])
                    if distance < apart * (_THROWN + (1.0 - _THROWN) * same):
                        free = 0
            if free == 1:
                kept[i] = 1
                number += 1
