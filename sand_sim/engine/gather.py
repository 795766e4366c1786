"""What a grain feels: the sum over its contacts in all lists."""

from functools import cache

import warp as wp

from sand_sim.engine.kernel import sure
from sand_sim.engine.recipe import Recipe


@cache
def build_gather_listed(recipe: Recipe) -> wp.Function:
    """Warp function that sums force and torque over the contacts a grain owns in one list."""
    real, vec3, vec4 = recipe.precision.real, recipe.precision.vec3, recipe.precision.vec4
    rotation, couples = recipe.rotation, recipe.contact.couples

    @wp.func
    def gather_listed(
        grain: int,
        radius: real,
        starts: wp.array(dtype=int),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec3),
    ):
        total = vec3(real(0.0))
        torque = vec3(real(0.0))
        for listed in range(starts[grain], starts[grain + 1]):
            contact = sure(listed)
            total += force[contact]
            if wp.static(rotation):
                turn = couple[contact]
                torque += vec3(turn[0], turn[1], turn[2]) * (radius - turn[3])
            if wp.static(couples):
                torque += moment[contact]
        return total, torque

    return gather_listed


@cache
def build_gather(recipe: Recipe, walls: bool, tools: bool) -> wp.Function:
    """Warp function that sums force [N] and torque [N m] over all contacts of a grain, in the order of the lists."""
    vec3, vec4, real = recipe.precision.vec3, recipe.precision.vec4, recipe.precision.real
    rotation, couples = recipe.rotation, recipe.contact.couples
    gather_listed = build_gather_listed(recipe)

    @wp.func
    def gather(
        i: int,
        radius: real,
        pair_starts: wp.array(dtype=int),
        pair_force: wp.array(dtype=vec3),
        pair_couple: wp.array(dtype=vec4),
        pair_moment: wp.array(dtype=vec3),
        met_starts: wp.array(dtype=int),
        met_pairs: wp.array(dtype=int),
        wall_starts: wp.array(dtype=int),
        wall_force: wp.array(dtype=vec3),
        wall_couple: wp.array(dtype=vec4),
        wall_moment: wp.array(dtype=vec3),
        tool_starts: wp.array(dtype=int),
        tool_force: wp.array(dtype=vec3),
        tool_couple: wp.array(dtype=vec4),
        tool_moment: wp.array(dtype=vec3),
    ):
        total, torque = gather_listed(i, radius, pair_starts, pair_force, pair_couple, pair_moment)
        for k in range(met_starts[i], met_starts[i + 1]):
            contact = sure(met_pairs[sure(k)])
            total -= pair_force[contact]
            if wp.static(rotation):
                turn = pair_couple[contact]
                torque += vec3(turn[0], turn[1], turn[2]) * (radius - turn[3])
            if wp.static(couples):
                torque -= pair_moment[contact]
        if wp.static(walls):
            push, turned = gather_listed(i, radius, wall_starts, wall_force, wall_couple, wall_moment)
            total += push
            torque += turned
        if wp.static(tools):
            push, turned = gather_listed(i, radius, tool_starts, tool_force, tool_couple, tool_moment)
            total += push
            torque += turned
        return total, torque

    return gather
