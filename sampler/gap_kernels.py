"""Kernels that measure gaps between particles on a surface; lengths in units of the mesh's diagonal unless told otherwise."""

import warp as wp

from sampler.cells import Cells, cell_at, row_of

MODULE = "sampler_spreading"

SAME = wp.constant(-0.2)  # cosine between normals from which two places lie on one skin
_SEEN = wp.constant(5.0e-5)  # least width of a gap
_NARROW = wp.constant(0.05)  # gaps narrower than this count as closed, so that either skin's particles cover both; in spacings


@wp.func
def square_along(between: wp.vec3, up: wp.vec3, other: wp.vec3, gap: float) -> float:
    """Square of the way between places of a surface, given that from the first to the second, and their normals.

    Straight on one skin, and where they look at each other across a gap at most so wide; else around the edge where their planes
    meet: unfolded, that is ``|between|^2 + 2 (|p| + p c) / (1 - c^2)`` with ``p = (between . up) (between . other)`` and
    ``c = up . other``; and very far between the two skins of a wall. Without branches, which would be guessed wrong.
    """
    forth = wp.dot(between, up)
    back = -wp.dot(between, other)
    cosine = wp.dot(up, other)
    facing = wp.min(wp.min(forth, back) - _SEEN, gap - wp.max(forth, back))
    straight = wp.dot(between, between)
    turn = 1.0 - cosine * cosine
    p = -forth * back
    around = straight + wp.where(turn < 1.0e-4, 1.0e6, 2.0 * (wp.abs(p) + p * cosine) / turn)
    return wp.where(wp.max(cosine - SAME, facing) > 0.0, straight, around)


@wp.struct
class Nearest:
    """A particle, how far it is, and how far the next one."""

    which: int
    way: float
    next: float


@wp.func
def nearer(nearest: Nearest, which: int, way: float) -> Nearest:
    """The nearest of those met before and this one."""
    first = wp.where(way < nearest.way, which, nearest.which)
    return Nearest(first, wp.min(way, nearest.way), wp.min(nearest.next, wp.max(way, nearest.way)))


@wp.func
def nearest_particles(cells: Cells, here: wp.vec3, up: wp.vec3, spacing: float, most: float):
    """Particle nearest to a place, and the nearest one along the surface, in spacings; at most ``most``, the next at most 1."""
    none = Nearest(int(-1), most * most * spacing * spacing, spacing * spacing)
    closest = none
    own = none
    reach = spacing  # squares of ways in what follows
    cell = cell_at(cells, here)
    number = row_of(cells, cell[1], cell[2]) + cell[0]
    for at in range(cells.near_begin[number], cells.near_begin[number + 1]):
        k = cells.near[at]
        between = cells.points[k] - here
        square = wp.dot(between, between)
        if square < wp.max(own.way, own.next):  # the way along the surface is no shorter
            closest = nearer(closest, k, square)
            own = nearer(own, k, square_along(between, up, cells.normals[k], _NARROW * spacing))
    while own.way > reach * reach and reach < most * spacing:  # next to never
        reach = wp.min(2.0 * reach, most * spacing)
        closest = none
        own = none
        low = cell_at(cells, here - wp.vec3(reach))
        high = cell_at(cells, here + wp.vec3(reach))
        for z in range(low[2], high[2] + 1):
            for y in range(low[1], high[1] + 1):
                row = row_of(cells, y, z)
                for k in range(cells.begin[row + low[0]], cells.begin[row + high[0] + 1]):
                    between = cells.points[k] - here
                    square = wp.dot(between, between)
                    if square < wp.max(own.way, own.next):
                        closest = nearer(closest, k, square)
                        own = nearer(own, k, square_along(between, up, cells.normals[k], _NARROW * spacing))
    return in_spacings(cells, closest, spacing), in_spacings(cells, own, spacing)


@wp.func
def in_spacings(cells: Cells, nearest: Nearest, spacing: float) -> Nearest:
    """The number of a particle in place of its rank, and ways in spacings in place of their squares."""
    which = nearest.which
    if which >= 0:
        which = cells.which[which]
    return Nearest(which, wp.sqrt(nearest.way) / spacing, wp.sqrt(nearest.next) / spacing)


@wp.kernel(enable_backward=False, module=MODULE)
def find_gaps(
    cells: Cells,
    places: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    spacing: float,
    most: float,
    first: int,
    found: wp.array(dtype=Nearest),
    found_along: wp.array(dtype=Nearest),
):
    """Particle nearest to each place, and the nearest one along the surface."""
    i = first + wp.tid()
    closest, own = nearest_particles(cells, places[i], normals[i], spacing, most)
    found[i] = closest
    found_along[i] = own


@wp.kernel(enable_backward=False, module=MODULE)
def find_neighbours(cells: Cells, spacing: float, most: float, first: int, distance: wp.array(dtype=float)):
    """Distance of each particle from the nearest other one, in spacings; at most ``most``."""
    i = first + wp.tid()
    here = cells.points[i]
    farthest = most * spacing
    best = farthest
    reach = float(0.0)
    while best > reach and reach < farthest:
        reach = wp.min(wp.max(2.0 * reach, spacing), farthest)
        low = cell_at(cells, here - wp.vec3(reach))
        high = cell_at(cells, here + wp.vec3(reach))
        for z in range(low[2], high[2] + 1):
            for y in range(low[1], high[1] + 1):
                row = row_of(cells, y, z)
                for k in range(cells.begin[row + low[0]], cells.begin[row + high[0] + 1]):
                    if k != i:
                        best = wp.min(best, wp.length(cells.points[k] - here))
    distance[cells.which[i]] = best / spacing
