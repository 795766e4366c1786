"""Kernels that measure gaps between particles on a surface; lengths in units of the mesh's diagonal unless told otherwise."""

import warp as wp

MODULE = "sampler_spreading"

SAME = wp.constant(-0.2)  # cosine between normals from which two places lie on one skin
_SEEN = wp.constant(5.0e-5)  # least width of a gap
_NARROW = wp.constant(0.05)  # gaps narrower than this count as closed, so that either skin's particles cover both; in spacings


@wp.func
def facing(between: wp.vec3, up: wp.vec3, other: wp.vec3, gap: float) -> bool:
    """Whether two places, given the way from the first to the second, look at each other across a gap at most so wide."""
    forth = wp.dot(between, up)
    back = -wp.dot(between, other)
    return wp.min(forth, back) > _SEEN and wp.max(forth, back) < gap


@wp.func
def way_along(p: wp.vec3, up: wp.vec3, q: wp.vec3, other: wp.vec3, gap: float) -> float:
    """Distance between places of a surface: straight on one skin or across a narrow gap, else around the edge of their planes."""
    between = q - p
    if wp.dot(up, other) >= SAME or facing(between, up, other, gap):
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
    places: wp.array(dtype=wp.vec3),
    place_normals: wp.array(dtype=wp.vec3),
    spacing: float,
    enough: float,
    most: float,
    first: int,
    found: wp.array(dtype=Nearest),
    found_along: wp.array(dtype=Nearest),
):
    """Particle nearest to each place, and the nearest one along the surface, in spacings; at most ``most``, the next at most 1.

    Where one along the surface is nearer than ``enough``, at most 1, the next is looked for as near as that only.
    """
    i = first + wp.tid()
    here = places[i]
    closest = Nearest(int(-1), most * spacing, spacing)
    own = Nearest(int(-1), most * spacing, spacing)
    reach = enough * spacing
    while reach < 1.5 * most * spacing:
        closest = Nearest(int(-1), most * spacing, spacing)
        own = Nearest(int(-1), most * spacing, spacing)
        for j in wp.hash_grid_query(grid, here, reach):
            between = points[j] - here
            square = wp.dot(between, between)
            farthest = wp.max(own.way, own.next)
            if square < farthest * farthest:  # the way along the surface is no shorter
                way = wp.sqrt(square)
                closest = nearer(closest, j, way)
                own = nearer(own, j, way_along(here, place_normals[i], points[j], normals[j], _NARROW * spacing))
        if own.way <= reach:
            reach = 2.0 * most * spacing
        else:  # beyond 1 next to never
            reach = wp.where(reach < spacing, spacing, 2.0 * reach)
    found[i] = Nearest(closest.which, closest.way / spacing, closest.next / spacing)
    found_along[i] = Nearest(own.which, own.way / spacing, own.next / spacing)


@wp.kernel(enable_backward=False, module=MODULE)
def find_nearest(grid: wp.uint64, points: wp.array(dtype=wp.vec3), reach: float, first: int, distance: wp.array(dtype=float)):
    """Distance of each particle from its nearest neighbour, at most ``reach``."""
    i = first + wp.tid()
    best = reach
    for j in wp.hash_grid_query(grid, points[i], reach):
        if j != i:
            best = wp.min(best, wp.length(points[j] - points[i]))
    distance[i] = best
