"""Newton-Euler for single spheres."""

from functools import cache

import warp as wp

from sand_sim.engine.adding import build_add
from sand_sim.engine.count import count_of
from sand_sim.engine.flags import FAULT_NOT_FINITE, FAULT_TOO_FAST
from sand_sim.engine.gather import build_gather
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.recipe import Recipe
from sand_sim.integrator import VERLET


@cache
def build_move_grains(recipe: Recipe, walls: bool, tools: bool) -> wp.Kernel:
    """Kernel that advances all grains by one step.

    Symplectic Euler: ``v += a dt``, then ``x += v dt``; the same for spin. Second order where forces do not depend on velocity,
    because v is then that of the half step before; first order with damping.

    Velocity Verlet: ``w += a dt``, then ``x += w dt``, with w the velocity at half steps, and ``v = w + a dt/2`` the velocity
    predicted for the end of the step, which damping and friction see: second order with both. The first step takes
    ``w += a dt/2``.

    What spheres of rigid bodies feel is put aside for ``body_motion``. Grains that leave the domain get radius zero and are
    parked; the next search retires them, and the energy of their motion and height is noted.

    Source: Swope et al. 1982, https://doi.org/10.1063/1.442716; prediction as Groot & Warren 1997,
    https://doi.org/10.1063/1.474784, with lambda = 1/2 for the half-step velocity.
    """
    precision, rotation, bodies = recipe.precision, recipe.rotation, recipe.bodies
    verlet = recipe.integrator == VERLET
    real, whole, vec3, vec4, whole3, whole4 = (
        precision.real,
        precision.whole,
        precision.vec3,
        precision.vec4,
        precision.whole3,
        precision.whole4,
    )
    gather, add = build_gather(recipe, walls, tools), build_add(recipe)

    @kernel
    def move_grains(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        remainder: wp.array(dtype=vec3),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        half_spin: wp.array(dtype=vec3),
        motion_carry: wp.array(dtype=vec3),
        spin_carry: wp.array(dtype=vec3),
        origin: wp.array(dtype=whole4),
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
        member: wp.array(dtype=int),
        felt_force: wp.array(dtype=vec3),
        felt_torque: wp.array(dtype=vec3),
        gravity: vec3,
        dt: real,
        quantum: real,
        half_extent: whole3,
        parking: whole,
        starting: wp.array(dtype=int),
        carried_off: wp.array(dtype=wp.float64),
        grains_moved: wp.array(dtype=int),
        fault: wp.array(dtype=int),
    ):
        at_tools = False
        if wp.static(tools):
            at_tools = tool_starts[count_of(spans)] > 0
        for k in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = sure(k)
            here = place[i]
            if here[3] == whole(0):
                continue
            radius = real(here[3]) * quantum
            total, torque = gather(
                i,
                radius,
                pair_starts,
                pair_force,
                pair_couple,
                pair_moment,
                met_starts,
                met_pairs,
                wall_starts,
                wall_force,
                wall_couple,
                wall_moment,
                tool_starts,
                tool_force,
                tool_couple,
                tool_moment,
                at_tools,
            )
            part = int(-1)
            if wp.static(bodies):
                part = member[i]
            if part >= 0:
                felt_force[i] = total
                felt_torque[i] = torque
                continue
            old = motion[i]
            gain = (total / old[3] + gravity) * dt
            half = gain * real(0.5)
            velocity = vec3(old[0], old[1], old[2])
            if wp.static(verlet):
                velocity = half_motion[i]
                if starting[0] != 0:
                    gain = half
            velocity = add(velocity, gain, motion_carry, i)
            if wp.static(verlet):
                half_motion[i] = velocity
                motion[i] = vec4(velocity[0] + half[0], velocity[1] + half[1], velocity[2] + half[2], old[3])
            else:
                motion[i] = vec4(velocity[0], velocity[1], velocity[2], old[3])
            if wp.static(rotation):
                turning = spin[i]
                gained = torque * (dt / turning[3])
                half_gained = gained * real(0.5)
                spun = vec3(turning[0], turning[1], turning[2])
                if wp.static(verlet):
                    spun = half_spin[i]
                    if starting[0] != 0:
                        gained = half_gained
                spun = add(spun, gained, spin_carry, i)
                if wp.static(verlet):
                    half_spin[i] = spun
                    spun += half_gained
                spin[i] = vec4(spun[0], spun[1], spun[2], turning[3])

            step = velocity * (dt / quantum) + remainder[i]
            jump = vec3(wp.rint(step[0]), wp.rint(step[1]), wp.rint(step[2]))
            # A square, because a maximum loses what is not a number.
            square = wp.dot(jump, jump)
            if not (square <= real(0.25) * real(here[3]) * real(here[3])):
                bit = int(wp.static(FAULT_NOT_FINITE))
                if wp.isfinite(square):
                    bit = int(wp.static(FAULT_TOO_FAST))
                wp.atomic_or(fault, 0, bit)
                continue
            remainder[i] = step - jump
            x = here[0] + whole(jump[0])
            y = here[1] + whole(jump[1])
            z = here[2] + whole(jump[2])
            if wp.abs(x) > half_extent[0] or wp.abs(y) > half_extent[1] or wp.abs(z) > half_extent[2]:
                now = motion[i]
                height = -wp.dot(gravity, vec3(real(x), real(y), real(z)) * quantum)
                energy = now[3] * (real(0.5) * (now[0] * now[0] + now[1] * now[1] + now[2] * now[2]) + height)
                if wp.static(rotation):
                    now = spin[i]
                    energy += real(0.5) * now[3] * (now[0] * now[0] + now[1] * now[1] + now[2] * now[2])
                wp.atomic_add(carried_off, lane, wp.float64(energy))
                place[i] = whole4(parking, parking, parking, whole(0))
                grains_moved[0] = 1
                continue
            place[i] = whole4(x, y, z, here[3])
            start = origin[i]
            moved = vec3(real(x - start[0]), real(y - start[1]), real(z - start[2]))
            if wp.dot(moved, moved) > real(start[3]) * real(start[3]):
                grains_moved[0] = 1

    return move_grains


@cache
def build_complete_step(recipe: Recipe, walls: bool, tools: bool) -> wp.Kernel:
    """Kernel for the second half of velocity Verlet, ``v = w + a dt/2`` with the forces of now, for those who look.

    Nobody steps on with what it writes, so looking changes nothing.
    """
    precision, rotation, bodies = recipe.precision, recipe.rotation, recipe.bodies
    real, whole, vec3, vec4, whole4 = precision.real, precision.whole, precision.vec3, precision.vec4, precision.whole4
    gather = build_gather(recipe, walls, tools)

    @kernel
    def complete_step(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        half_spin: wp.array(dtype=vec3),
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
        member: wp.array(dtype=int),
        felt_force: wp.array(dtype=vec3),
        felt_torque: wp.array(dtype=vec3),
        gravity: vec3,
        dt: real,
        quantum: real,
        starting: wp.array(dtype=int),
        seen_motion: wp.array(dtype=vec4),
        seen_spin: wp.array(dtype=vec3),
    ):
        for k in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = sure(k)
            here = place[i]
            seen = motion[i]
            turning = vec3(real(0.0))
            if wp.static(rotation):
                turning = vec3(spin[i][0], spin[i][1], spin[i][2])
            if here[3] > whole(0) and starting[0] == 0:
                radius = real(here[3]) * quantum
                total, torque = gather(
                    i,
                    radius,
                    pair_starts,
                    pair_force,
                    pair_couple,
                    pair_moment,
                    met_starts,
                    met_pairs,
                    wall_starts,
                    wall_force,
                    wall_couple,
                    wall_moment,
                    tool_starts,
                    tool_force,
                    tool_couple,
                    tool_moment,
                    True,
                )
                part = int(-1)
                if wp.static(bodies):
                    part = member[i]
                if part >= 0:
                    felt_force[i] = total
                    felt_torque[i] = torque
                    continue
                velocity = half_motion[i] + (total / seen[3] + gravity) * (real(0.5) * dt)
                seen = vec4(velocity[0], velocity[1], velocity[2], seen[3])
                if wp.static(rotation):
                    turning = half_spin[i] + torque * (real(0.5) * dt / spin[i][3])
            seen_motion[i] = seen
            if wp.static(rotation):
                seen_spin[i] = turning

    return complete_step
