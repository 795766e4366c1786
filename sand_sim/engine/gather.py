"""What a grain feels: the sum over its contacts in all lists."""

from functools import cache

import warp as wp

from sand_sim.engine.kernel import sure
from sand_sim.engine.recipe import Recipe

_USUAL = 4  # contacts of a grain in each half of the list; one grain in twelve has more


@cache
def build_add_contact(recipe: Recipe) -> wp.Function:
    """Warp function that adds to a grain's force and torque those of a contact, ``side`` 1 for its owner, -1 for the partner.

    Four numbers each, which a core adds at once; the last are idle.
    """
    real, vec4 = recipe.precision.real, recipe.precision.vec4
    rotation, couples = recipe.rotation, recipe.contact.couples

    @wp.func
    def add_contact(
        total: vec4,
        torque: vec4,
        contact: int,
        side: real,
        radius: real,
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
    ):
        total_now = total + force[contact] * side
        torque_now = torque
        if wp.static(rotation):
            turn = couple[contact]
            torque_now += turn * (radius - turn[3])
        if wp.static(couples):
            torque_now += moment[contact] * side
        return total_now, torque_now

    return add_contact


@cache
def build_gather_listed(recipe: Recipe) -> wp.Function:
    """Warp function that adds up the contacts a grain owns in one list."""
    real, vec4, add_contact = recipe.precision.real, recipe.precision.vec4, build_add_contact(recipe)

    @wp.func
    def gather_listed(
        total: vec4,
        torque: vec4,
        grain: int,
        radius: real,
        starts: wp.array(dtype=int),
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
    ):
        for listed in range(starts[grain], starts[grain + 1]):
            total, torque = add_contact(total, torque, sure(listed), real(1.0), radius, force, couple, moment)
        return total, torque

    return gather_listed


@cache
def build_gather_pairs(recipe: Recipe) -> wp.Function:
    """Warp function that adds up a grain's contacts with others: those it owns, then those it is partner in.

    How many there are nobody can guess, and a loop left too early or too late costs a core more than a few sums. So the usual
    number is always added: where a contact is missing, the one behind the last of the list, which is nothing.
    """
    real, vec4, add_contact = recipe.precision.real, recipe.precision.vec4, build_add_contact(recipe)

    @wp.func
    def gather_pairs(
        grain: int,
        radius: real,
        starts: wp.array(dtype=int),
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        met_starts: wp.array(dtype=int),
        met_pairs: wp.array(dtype=int),
    ):
        total = vec4(real(0.0))
        torque = vec4(real(0.0))
        nothing = force.shape[0] - 1
        first = starts[grain]
        number = starts[grain + 1] - first
        for k in range(wp.static(_USUAL)):
            contact = sure(wp.where(k < number, first + k, nothing))
            total, torque = add_contact(total, torque, contact, real(1.0), radius, force, couple, moment)
        for k in range(wp.static(_USUAL), number):
            total, torque = add_contact(total, torque, sure(first + k), real(1.0), radius, force, couple, moment)
        first = met_starts[grain]
        number = met_starts[grain + 1] - first
        for k in range(wp.static(_USUAL)):
            there = k < number
            met = met_pairs[sure(wp.where(there, first + k, 0))]
            contact = sure(wp.where(there, met, nothing))
            total, torque = add_contact(total, torque, contact, real(-1.0), radius, force, couple, moment)
        for k in range(wp.static(_USUAL), number):
            contact = sure(met_pairs[sure(first + k)])
            total, torque = add_contact(total, torque, contact, real(-1.0), radius, force, couple, moment)
        return total, torque

    return gather_pairs


@cache
def build_gather(recipe: Recipe, walls: bool, tools: bool) -> wp.Function:
    """Warp function that sums force [N] and torque [N m] over all contacts of a grain, in the order of the lists.

    Tools that touch nothing, ``at_tools`` false, cost nothing.
    """
    vec3, vec4, real = recipe.precision.vec3, recipe.precision.vec4, recipe.precision.real
    gather_pairs, gather_listed = build_gather_pairs(recipe), build_gather_listed(recipe)

    @wp.func
    def gather(
        i: int,
        radius: real,
        pair_starts: wp.array(dtype=int),
        pair_force: wp.array(dtype=vec4),
        pair_couple: wp.array(dtype=vec4),
        pair_moment: wp.array(dtype=vec4),
        met_starts: wp.array(dtype=int),
        met_pairs: wp.array(dtype=int),
        wall_starts: wp.array(dtype=int),
        wall_force: wp.array(dtype=vec4),
        wall_couple: wp.array(dtype=vec4),
        wall_moment: wp.array(dtype=vec4),
        tool_starts: wp.array(dtype=int),
        tool_force: wp.array(dtype=vec4),
        tool_couple: wp.array(dtype=vec4),
        tool_moment: wp.array(dtype=vec4),
        at_tools: bool,
    ):
        total, torque = gather_pairs(i, radius, pair_starts, pair_force, pair_couple, pair_moment, met_starts, met_pairs)
        if wp.static(walls):
            total, torque = gather_listed(total, torque, i, radius, wall_starts, wall_force, wall_couple, wall_moment)
        if wp.static(tools):
            if at_tools:
                total, torque = gather_listed(total, torque, i, radius, tool_starts, tool_force, tool_couple, tool_moment)
        return vec3(total[0], total[1], total[2]), vec3(torque[0], torque[1], torque[2])

    return gather
