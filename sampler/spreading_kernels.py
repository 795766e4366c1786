"""Kernels that move particles over a surface and measure the gaps between them; lengths in units of the mesh's diagonal."""

import warp as wp

from sampler.surface import ASIDE, nearest_face

MODULE = "sampler_spreading"

_SAME = wp.constant(-0.2)  # cosine between normals from which two places lie on one skin
_OTHER = wp.constant(-0.7)  # and below which they lie on different skins
_SEEN = wp.constant(5.0e-5)  # least width of a gap
_NARROW = wp.constant(0.05)  # gaps narrower than this count as closed, so that either skin's particles cover both; in spacings
_THROWN = wp.constant(0.85)  # how near to each other particles of different skins may be thrown, of those on one skin
_CORE, _HARD = wp.constant(8.0), wp.constant(1.25)  # what holds particles apart: strength, and range, of how far they were thrown
_FARTHEST = wp.constant(0.3)  # of a step, in spacings


@wp.func
def facing(between: wp.vec3, up: wp.vec3, other: wp.vec3, gap: float) -> bool:
    """Whether two places, given the way from the first to the second, look at each other across a gap at most so wide."""
    forth = wp.dot(between, up)
    back = -wp.dot(between, other)
    return wp.min(forth, back) > _SEEN and wp.max(forth, back) < gap


@wp.func
def same_skin(a: wp.vec3, b: wp.vec3) -> float:
    """1 for places on one skin, 0 for the two skins of a wall, smooth between."""
    share = wp.clamp((wp.dot(a, b) - _OTHER) / (_SAME - _OTHER), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


@wp.func
def way_along(p: wp.vec3, up: wp.vec3, q: wp.vec3, other: wp.vec3, gap: float) -> float:
    """Distance between places of a surface: straight on one skin or across a narrow gap, else around the edge of their planes."""
    between = q - p
    if wp.dot(up, other) >= _SAME or facing(between, up, other, gap):
        return wp.length(between)
    edge = wp.cross(up, other)
    square = wp.length_sq(edge)
    if square < 1.0e-4:  # the two skins of a wall
        return 1.0e6
    # The line's foot f from p: f lies in both planes and (f - p) has no part along the edge.
    to_edge = wp.cross(edge, up) * (wp.dot(between, other) / square)
    from_edge = wp.cross(edge, other) * (wp.dot(between, up) / square)
    along = wp.dot(between, edge)
    across = wp.length(to_edge) + wp.length(from_edge)
    return wp.sqrt(across * across + along * along / square)


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
    """Push each point away from its neighbours, also through a wall, and bring it back to the surface."""
    i = first + wp.tid()
    here = points[i]
    up = normals[i]
    moved[i] = here
    moved_normals[i] = up
    if held[i] != 0:
        return
    push = wp.vec3(0.0)
    for j in wp.hash_grid_query(grid, here, 2.0 * spacing):
        if j != i:
            away = here - points[j]
            distance = wp.length(away)
            if distance < 2.0 * spacing:
                weight = repulsion(distance, spacing) + _CORE * wp.max(_HARD * apart - distance, 0.0) / spacing
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


@wp.struct
class Nearest:
    """A particle, how far it is, and how far the next one."""

    which: int
    way: float
    next: float


@wp.func
def nearer(nearest: Nearest, which: int, way: float) -> Nearest:
    """The nearest of those met before and this one."""
    if way < nearest.way:
        nearest.next = wp.min(nearest.next, nearest.way)
        nearest.which = which
        nearest.way = way
    else:
        nearest.next = wp.min(nearest.next, way)
    return nearest


@wp.kernel(enable_backward=False, module=MODULE)
def find_gaps(
    grid: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    samples: wp.array(dtype=wp.vec3),
    sample_normals: wp.array(dtype=wp.vec3),
    reach: float,
    first: int,
    distance: wp.array(dtype=float),
    own_distance: wp.array(dtype=float),
    without: wp.array(dtype=float),
    own_without: wp.array(dtype=float),
):
    """Distance of samples from the nearest particle, and from the nearest one on their own skin; at most ``reach``.

    For each particle also the largest such distance if it were not there, hardly more than half the reach.
    """
    i = first + wp.tid()
    here = samples[i]
    near = 0.5 * reach
    narrow = _NARROW * near  # the reach is two spacings
    closest = Nearest(int(-1), reach, near)
    own = Nearest(int(-1), reach, near)
    for j in wp.hash_grid_query(grid, here, near):
        way = wp.length(points[j] - here)
        if way < wp.max(own.way, own.next):  # the way along the skin is no shorter
            closest = nearer(closest, j, way)
            own = nearer(own, j, way_along(here, sample_normals[i], points[j], normals[j], narrow))
    if own.way > near:  # next to never
        closest = Nearest(int(-1), reach, near)
        own = Nearest(int(-1), reach, near)
        for j in wp.hash_grid_query(grid, here, reach):
            way = wp.length(points[j] - here)
            if way < wp.max(own.way, own.next):
                closest = nearer(closest, j, way)
                own = nearer(own, j, way_along(here, sample_normals[i], points[j], normals[j], narrow))
    distance[i] = closest.way
    own_distance[i] = own.way
    if closest.which >= 0:
        wp.atomic_max(without, closest.which, closest.next)
    if own.which >= 0:
        wp.atomic_max(own_without, own.which, own.next)


@wp.kernel(enable_backward=False, module=MODULE)
def find_nearest(grid: wp.uint64, points: wp.array(dtype=wp.vec3), reach: float, first: int, distance: wp.array(dtype=float)):
    """Distance of each particle from its nearest neighbour, at most ``reach``."""
    i = first + wp.tid()
    best = reach
    for j in wp.hash_grid_query(grid, points[i], reach):
        if j != i:
            best = wp.min(best, wp.length(points[j] - points[i]))
    distance[i] = best
