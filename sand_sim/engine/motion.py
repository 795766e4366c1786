"""Newton-Euler for single spheres: gather the forces of a grain's contacts, then move it."""

from functools import cache

import warp as wp

from sand_sim.engine.flags import FAULT_NOT_FINITE
from sand_sim.engine.kernel import kernel
from sand_sim.engine.recipe import Recipe


@cache
def build_gather_listed(recipe: Recipe) -> wp.Function:
    """Warp function that sums force and torque over the contacts a grain owns in one list."""
    real, vec3, vec4 = recipe.precision.real, recipe.precision.vec3, recipe.precision.vec4
    rotation = recipe.rotation

    @wp.func
    def gather_listed(
        grain: int,
        radius: real,
        starts: wp.array(dtype=int),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
    ):
        total = vec3(real(0.0))
        torque = vec3(real(0.0))
        for contact in range(starts[grain], starts[grain + 1]):
            total += force[contact]
            if wp.static(rotation):
                turn = couple[contact]
                torque += vec3(turn[0], turn[1], turn[2]) * (radius - turn[3])
        return total, torque

    return gather_listed


@cache
def build_move_grains(recipe: Recipe, walls: bool, tools: bool) -> wp.Kernel:
    """Kernel that advances all grains by one step of symplectic Euler.

    ``v += (F/m + g) dt``, then ``x += v dt``; the same for spin. Second order for elastic contacts, because velocities are
    those of the half step before (leapfrog). Grains that leave the domain get radius zero and are parked; the next search
    retires them.
    """
    precision, rotation = recipe.precision, recipe.rotation
    real, whole, vec3, vec4, whole3, whole4 = (
        precision.real,
        precision.whole,
        precision.vec3,
        precision.vec4,
        precision.whole3,
        precision.whole4,
    )
    gather_listed = build_gather_listed(recipe)

    @kernel
    def move_grains(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        remainder: wp.array(dtype=vec3),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        origin: wp.array(dtype=whole4),
        pair_starts: wp.array(dtype=int),
        pair_force: wp.array(dtype=vec3),
        pair_couple: wp.array(dtype=vec4),
        met_starts: wp.array(dtype=int),
        met_pairs: wp.array(dtype=int),
        wall_starts: wp.array(dtype=int),
        wall_force: wp.array(dtype=vec3),
        wall_couple: wp.array(dtype=vec4),
        tool_starts: wp.array(dtype=int),
        tool_force: wp.array(dtype=vec3),
        tool_couple: wp.array(dtype=vec4),
        gravity: vec3,
        dt: real,
        quantum: real,
        half_extent: whole3,
        parking: whole,
        half_skin: real,
        grains_moved: wp.array(dtype=int),
        fault: wp.array(dtype=int),
    ):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            here = place[i]
            if here[3] == whole(0):
                continue
            radius = real(here[3]) * quantum
            total, torque = gather_listed(i, radius, pair_starts, pair_force, pair_couple)
            for k in range(met_starts[i], met_starts[i + 1]):
                contact = met_pairs[k]
                total -= pair_force[contact]
                if wp.static(rotation):
                    turn = pair_couple[contact]
                    torque += vec3(turn[0], turn[1], turn[2]) * (radius - turn[3])
            if wp.static(walls):
                push, turned = gather_listed(i, radius, wall_starts, wall_force, wall_couple)
                total += push
                torque += turned
            if wp.static(tools):
                push, turned = gather_listed(i, radius, tool_starts, tool_force, tool_couple)
                total += push
                torque += turned

            old = motion[i]
            velocity = vec3(old[0], old[1], old[2]) + (total / old[3] + gravity) * dt
            motion[i] = vec4(velocity[0], velocity[1], velocity[2], old[3])
            if wp.static(rotation):
                turning = spin[i]
                gain = torque * (dt / turning[3])
                spin[i] = vec4(turning[0] + gain[0], turning[1] + gain[1], turning[2] + gain[2], turning[3])

            step = velocity * (dt / quantum) + remainder[i]
            jump = vec3(wp.rint(step[0]), wp.rint(step[1]), wp.rint(step[2]))
            far = wp.max(wp.max(wp.abs(jump[0]), wp.abs(jump[1])), wp.abs(jump[2]))
            if not (far < real(parking)):
                if not wp.isfinite(far):
                    fault[0] = fault[0] | wp.static(FAULT_NOT_FINITE)
                    continue
                place[i] = whole4(parking, parking, parking, whole(0))
                grains_moved[0] = 1
                continue
            remainder[i] = step - jump
            x = here[0] + whole(jump[0])
            y = here[1] + whole(jump[1])
            z = here[2] + whole(jump[2])
            if wp.abs(x) > half_extent[0] or wp.abs(y) > half_extent[1] or wp.abs(z) > half_extent[2]:
                place[i] = whole4(parking, parking, parking, whole(0))
                grains_moved[0] = 1
                continue
            place[i] = whole4(x, y, z, here[3])
            start = origin[i]
            moved = vec3(real(x - start[0]), real(y - start[1]), real(z - start[2]))
            if wp.dot(moved, moved) > half_skin * half_skin:
                grains_moved[0] = 1

    return move_grains
