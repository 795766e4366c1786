"""Neighbour search: spheres kept in the order of their cells, and each pair within reach listed once."""

from functools import cache

import warp as wp

from sand_sim.contact.response import memory_type
from sand_sim.engine.act import build_swapped
from sand_sim.engine.cells import cell_functions, level_type
from sand_sim.engine.chunks import build_find_near, build_note_hits
from sand_sim.engine.contact_list import listed_at
from sand_sim.engine.count import count_of, share_out
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.recipe import Recipe

HITS = 6  # a sphere's partners that the counting search notes for the filling one, and one that is none; few have more


@wp.func
def of_other_bodies(near: int, base: int, member: wp.array(dtype=int), body_of: wp.array(dtype=int), i: int) -> int:
    """The bits of those spheres of a chunk that do not belong to the rigid body of sphere i."""
    own = int(-1)
    if member[i] >= 0:
        own = body_of[member[i]]
    kept = near
    k = int(0)
    while kept >> k != 0:
        if (kept >> k) & 1 != 0:
            j = sure(base + k)
            if own >= 0 and member[j] >= 0:
                if body_of[member[j]] == own:
                    kept -= 1 << k
        k += 1
    return kept


@cache
def build_list_pair(recipe: Recipe) -> wp.Function:
    """Warp function that writes a pair into the list, with what the last list remembers of it."""
    memory_vector, swapped = memory_type(recipe.contact, recipe.precision), build_swapped(recipe)
    history = recipe.history

    @wp.func
    def list_pair(
        at: int,
        i: int,
        j: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        memory: wp.array(dtype=memory_vector),
        came_from: wp.array(dtype=int),
        old_starts: wp.array(dtype=int),
        old_partner: wp.array(dtype=int),
        old_memory: wp.array(dtype=memory_vector),
    ):
        owner[at] = i
        partner[at] = j
        if wp.static(history):
            kept = memory_vector()
            came = sure(came_from[i])
            was = sure(came_from[j])
            old = listed_at(old_starts, old_partner, came, was)
            if old >= 0:
                kept = old_memory[sure(old)]
            else:
                old = listed_at(old_starts, old_partner, was, came)
                if old >= 0:
                    kept = swapped(old_memory[sure(old)])
            memory[at] = kept

    return list_pair


@cache
def build_search(recipe: Recipe, filling: bool, chunk: int) -> wp.Kernel:
    """Kernel that visits each pair of spheres closer than touch plus skin, once, from the sphere that comes first.

    Spheres are numbered in the order of their cells, level by level from fine to coarse. A sphere looks at what follows in its
    own level and at all cells around it in coarser levels. The first pass counts and notes what it finds; the second, the
    ``filling``, writes the list and searches again only for spheres of which not all was noted.

    A row of three cells holds a few spheres, one after the other. Their distances are measured ``chunk`` at a time, some in vain,
    so that a core can do them all at once and need not guess how many there are. There must be at least so many spheres, because
    no chunk reads beyond the last; and one thread must take the spheres of a lane in order, because notes spill over into the
    room of the next sphere. A chunk of one asks for neither.
    """
    precision, bodies = recipe.precision, recipe.bodies
    real, whole, whole3, whole4 = precision.real, precision.whole, precision.whole3, precision.whole4
    memory_vector, list_pair = memory_type(recipe.contact, precision), build_list_pair(recipe)
    level = level_type(precision)
    level_of, cell_of = cell_functions(precision)
    find_near, note_hits = build_find_near(precision, chunk), build_note_hits(chunk)

    @kernel
    def search(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        levels: wp.array(dtype=level),
        lowest: wp.array(dtype=whole3),
        cell_starts: wp.array(dtype=int),
        allowed: wp.array(dtype=whole),
        member: wp.array(dtype=int),
        body_of: wp.array(dtype=int),
        hits: wp.array(dtype=int),
        counts: wp.array(dtype=int),
        starts: wp.array(dtype=int),
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        memory: wp.array(dtype=memory_vector),
        came_from: wp.array(dtype=int),
        old_starts: wp.array(dtype=int),
        old_partner: wp.array(dtype=int),
        old_memory: wp.array(dtype=memory_vector),
    ):
        spheres = place.shape[0]
        for item in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = sure(item)
            here = place[i]
            low = lowest[0]
            noted = sure(wp.static(HITS) * i + lane * wp.static(chunk))
            found = int(0)
            if wp.static(filling):
                found = starts[i]
                number = starts[sure(i + 1)] - found
                if number < wp.static(HITS):
                    for k in range(number):
                        j = sure(hits[sure(noted + k)])
                        list_pair(sure(found + k), i, j, owner, partner, memory, came_from, old_starts, old_partner, old_memory)
                    continue
            own = level_of(levels, here[3])
            gap = real(here[3] + allowed[i]) + levels[own].across
            for tier in range(own, levels.shape[0]):
                one = levels[tier]
                cell = cell_of(one, low, here)
                left = wp.max(cell[0] - 1, 0)
                right = wp.min(cell[0] + 1, one.nx - 1)
                rows = 9  # in the counting search one loop each, whose branches are easier to guess
                if wp.static(filling):
                    rows = int(9)
                for row in range(rows):
                    y = cell[1] + row % 3 - 1
                    z = cell[2] + row // 3 - 1
                    behind = tier == own and row < 4
                    if behind or y < 0 or y >= one.ny or z < 0 or z >= one.nz:
                        continue
                    line = sure(one.first_key + (z * one.ny + y) * one.nx)
                    first = cell_starts[sure(line + left)]
                    if tier == own and row == 4:
                        first = i + 1
                    last = cell_starts[sure(line + right + 1)]
                    for begin in range(first, last, wp.static(chunk)):
                        base = wp.min(begin, spheres - wp.static(chunk))
                        near = find_near(place, allowed, base, begin, last, here, gap)
                        if wp.static(bodies):
                            near = of_other_bodies(near, base, member, body_of, i)
                        if wp.static(filling):
                            k = int(0)
                            while near >> k != 0:
                                if (near >> k) & 1 != 0:
                                    at = sure(found)
                                    j = sure(base + k)
                                    list_pair(at, i, j, owner, partner, memory, came_from, old_starts, old_partner, old_memory)
                                    found += 1
                                k += 1
                        else:
                            note_hits(hits, sure(noted + wp.min(found, wp.static(HITS - 1))), base, near)
                            found += wp.bit_count(near)
            if wp.static(not filling):
                counts[i] = found

    return search


@cache
def build_take_in_order(dtype: type) -> wp.Kernel:
    """Kernel ``taken[i] = values[order[i]]``."""

    @kernel
    def take_in_order(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        order: wp.array(dtype=int),
        values: wp.array(dtype=dtype),
        taken: wp.array(dtype=dtype),
    ):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            taken[i] = values[order[i]]

    return take_in_order


@cache
def build_put_back(dtype: type) -> wp.Kernel:
    """Kernel ``values[i] = taken[i]``."""

    @kernel
    def put_back(lane: int, spans: wp.array(dtype=int), stride: int, taken: wp.array(dtype=dtype), values: wp.array(dtype=dtype)):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            values[i] = taken[i]

    return put_back


@kernel
def count_active(cell_starts: wp.array(dtype=int), bins: wp.array(dtype=int), spans: wp.array(dtype=int)):
    """Grains sorted behind the last cell have retired."""
    active = cell_starts[count_of(bins) - 1]
    share_out(spans, active)


@kernel
def number_anew(lane: int, spans: wp.array(dtype=int), stride: int, came_from: wp.array(dtype=int)):
    """The lists now speak of the present numbering."""
    for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
        came_from[i] = i
