"""Newton-Euler for rigid bodies of many spheres: gather what their spheres feel, move them, and move the spheres with them."""

from functools import cache

import warp as wp

from sand_sim.engine.adding import build_add
from sand_sim.engine.flags import FAULT_NOT_FINITE, FAULT_TOO_FAST
from sand_sim.engine.free_rotation import ease_of, mean_spin, rotate_freely, spin_of
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.prefetch import build_fetch_grain, build_prefetch
from sand_sim.engine.pushes import Push, begin_push, end_push, mean_force, torque_about_centre
from sand_sim.engine.recipe import Recipe
from sand_sim.integrator import VERLET
from sand_sim.precision import Precision

_AHEAD = 3  # bodies; they keep their numbers, so that their spheres lie anywhere


@kernel
def find_members(lane: int, spans: wp.array(dtype=int), stride: int, member: wp.array(dtype=int), sphere_at: wp.array(dtype=int)):
    """The spheres have been renumbered: note where each member is now."""
    for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
        if member[i] >= 0:
            sphere_at[member[i]] = i


@cache
def build_gather_body(precision: Precision) -> wp.Function:
    """Warp function that sums force [N] and torque about the centre of mass [N m] over the spheres of a body."""
    real, vec3, whole4 = precision.real, precision.vec3, precision.whole4

    @wp.func
    def gather_body(
        first: int,
        last: int,
        at: whole4,
        quantum: real,
        sphere_at: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        felt_force: wp.array(dtype=vec3),
        felt_torque: wp.array(dtype=vec3),
    ):
        force = vec3(real(0.0))
        torque = vec3(real(0.0))
        for m in range(first, last):
            i = sure(sphere_at[sure(m)])
            here = place[i]
            arm = vec3(real(here[0] - at[0]), real(here[1] - at[1]), real(here[2] - at[2])) * quantum
            push = felt_force[i]
            force += push
            torque += felt_torque[i] + wp.cross(arm, push)
        return force, torque

    return gather_body


@cache
def build_move_bodies(recipe: Recipe) -> wp.Kernel:
    """Kernel that advances all bodies by one step, as ``motion.build_move_grains`` does single spheres.

    The angular momentum is advanced like the velocity, the orientation by ``free_rotation.rotate_freely``. A body whose centre
    leaves the domain is retired with all its spheres.
    """
    precision, verlet, pushed = recipe.precision, recipe.integrator == VERLET, recipe.pushed
    real, whole, vec3, vec4 = precision.real, precision.whole, precision.vec3, precision.vec4
    whole3, whole4, mat33 = precision.whole3, precision.whole4, precision.mat33
    gather_body, fetch_grain = build_gather_body(precision), build_fetch_grain(recipe)
    add = build_add(recipe)
    fetch_felt, fetch_place = build_prefetch(vec3), build_prefetch(whole4)

    @kernel
    def move_bodies(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        starts: wp.array(dtype=int),
        sphere_at: wp.array(dtype=int),
        offset: wp.array(dtype=vec3),
        body_place: wp.array(dtype=whole4),
        remainder: wp.array(dtype=vec3),
        body_motion: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        motion_carry: wp.array(dtype=vec3),
        turn: wp.array(dtype=wp.quatd),
        momentum: wp.array(dtype=wp.vec3d),
        inertia: wp.array(dtype=wp.vec3d),
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        sphere_half_motion: wp.array(dtype=vec3),
        sphere_half_spin: wp.array(dtype=vec3),
        origin: wp.array(dtype=whole4),
        felt_force: wp.array(dtype=vec3),
        felt_torque: wp.array(dtype=vec3),
        pushes: wp.array(dtype=Push),
        unpushed: int,
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
        end = spans[lane + 1]
        per_quantum = real(1.0) / quantum
        for k in range(spans[lane] + wp.tid(), end, stride):
            b = sure(k)
            soon = sure(wp.min(k + wp.static(_AHEAD), end - 1))
            for m in range(starts[soon], starts[soon + 1]):
                i = sure(sphere_at[sure(m)])
                fetch_grain(i, place, motion, spin, sphere_half_motion, sphere_half_spin)
                fetch_felt(felt_force, i)
                fetch_felt(felt_torque, i)
                fetch_place(origin, i)
            at = body_place[b]
            if at[3] == whole(0):
                continue
            first = starts[b]
            last = starts[b + 1]
            force, torque = gather_body(first, last, at, quantum, sphere_at, place, felt_force, felt_torque)
            outer = Push()
            if wp.static(pushed):
                if b >= unpushed:
                    outer = begin_push(pushes[b - unpushed], wp.static(not verlet) or starting[0] != 0)
                    of_outer = mean_force(outer)
                    force += vec3(of_outer)
                    mean = wp.float64(0.5) * (outer.acted_torque + outer.torque)
                    torque += vec3(torque_about_centre(outer, mean, of_outer, turn[b]))
            old = body_motion[b]
            gain = (force / old[3] + gravity) * dt
            push = wp.vec3d(wp.float64(torque[0]), wp.float64(torque[1]), wp.float64(torque[2])) * wp.float64(dt)
            half = gain * real(0.5)
            half_push = push * wp.float64(0.5)
            velocity = vec3(old[0], old[1], old[2])
            turning = momentum[b] + push
            if wp.static(verlet):
                velocity = half_motion[b]
                if starting[0] != 0:
                    gain = half
                    turning -= half_push
            velocity = add(velocity, gain, motion_carry, b)
            now = velocity
            turning_now = turning
            if wp.static(verlet):
                half_motion[b] = velocity
                now = velocity + half
                turning_now = turning + half_push
            body_motion[b] = vec4(now[0], now[1], now[2], old[3])
            momentum[b] = turning

            step = velocity * (dt / quantum) + remainder[b]
            jump = vec3(wp.rint(step[0]), wp.rint(step[1]), wp.rint(step[2]))
            # Squares, because a maximum loses what is not a number.
            square = wp.dot(jump, jump)
            if not (square < real(parking) * real(parking)) or not wp.isfinite(wp.dot(turning_now, turning_now)):
                bit = int(wp.static(FAULT_NOT_FINITE))
                if wp.isfinite(square):
                    bit = int(wp.static(FAULT_TOO_FAST))
                wp.atomic_or(fault, 0, bit)
                continue
            ease = ease_of(inertia[b])
            before = turn[b]
            turned = rotate_freely(before, turning, ease, wp.float64(dt))
            turn[b] = turned
            axes = wp.quat_to_matrix(turned)
            past_d = mean_spin(before, turned, wp.float64(dt))
            if wp.static(pushed):
                if b >= unpushed:
                    pushes[b - unpushed] = end_push(outer, before, wp.vec3d(velocity * dt), past_d * wp.float64(dt))
            x = at[0] + whole(jump[0])
            y = at[1] + whole(jump[1])
            z = at[2] + whole(jump[2])
            if wp.abs(x) > half_extent[0] or wp.abs(y) > half_extent[1] or wp.abs(z) > half_extent[2]:
                height = -wp.dot(gravity, vec3(real(x), real(y), real(z)) * quantum)
                spinning = spin_of(axes, turning_now, ease)
                energy = wp.float64(old[3] * (real(0.5) * wp.dot(now, now) + height))
                wp.atomic_add(carried_off, lane, energy + wp.float64(0.5) * wp.dot(spinning, turning_now))
                body_place[b] = whole4(parking, parking, parking, whole(0))
                for m in range(first, last):
                    place[sphere_at[m]] = whole4(parking, parking, parking, whole(0))
                grains_moved[0] = 1
                continue
            left = step - jump
            remainder[b] = left
            body_place[b] = whole4(x, y, z, at[3])
            past = vec3(real(past_d[0]), real(past_d[1]), real(past_d[2]))
            omega = past
            if wp.static(verlet):
                omega_d = spin_of(axes, turning_now, ease)
                omega = vec3(real(omega_d[0]), real(omega_d[1]), real(omega_d[2]))
            rotation = mat33(axes)
            for m in range(first, last):
                i = sure(sphere_at[sure(m)])
                arm = rotation * offset[sure(m)]
                spot = arm * per_quantum + left
                u = x + whole(wp.rint(spot[0]))
                v = y + whole(wp.rint(spot[1]))
                w = z + whole(wp.rint(spot[2]))
                was = place[i]
                leap = vec3(real(u - was[0]), real(v - was[1]), real(w - was[2]))
                if wp.dot(leap, leap) > real(0.25) * real(was[3]) * real(was[3]):
                    wp.atomic_or(fault, 0, wp.static(FAULT_TOO_FAST))
                place[i] = whole4(u, v, w, was[3])
                # With the arm that it had in the middle of the step.
                carried = velocity + wp.cross(past, arm - wp.cross(past, arm) * (real(0.5) * dt))
                if wp.static(verlet):
                    sphere_half_motion[i] = carried
                    sphere_half_spin[i] = past
                    carried = now + wp.cross(omega, arm)
                motion[i] = vec4(carried[0], carried[1], carried[2], motion[i][3])
                spin[i] = vec4(omega[0], omega[1], omega[2], spin[i][3])
                began = origin[i]
                moved = vec3(real(u - began[0]), real(v - began[1]), real(w - began[2]))
                if wp.dot(moved, moved) > real(began[3]) * real(began[3]):
                    grains_moved[0] = 1

    return move_bodies


@cache
def build_see_bodies(recipe: Recipe) -> wp.Kernel:
    """Kernel that completes the step of all bodies with the forces of now for lookers, as ``motion.build_complete_step``."""
    precision, verlet, pushed = recipe.precision, recipe.integrator == VERLET, recipe.pushed
    real, whole, vec3, vec4, whole4 = precision.real, precision.whole, precision.vec3, precision.vec4, precision.whole4
    mat33 = precision.mat33
    gather_body = build_gather_body(precision)

    @kernel
    def see_bodies(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        starts: wp.array(dtype=int),
        sphere_at: wp.array(dtype=int),
        offset: wp.array(dtype=vec3),
        body_place: wp.array(dtype=whole4),
        body_motion: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        turn: wp.array(dtype=wp.quatd),
        momentum: wp.array(dtype=wp.vec3d),
        inertia: wp.array(dtype=wp.vec3d),
        place: wp.array(dtype=whole4),
        felt_force: wp.array(dtype=vec3),
        felt_torque: wp.array(dtype=vec3),
        pushes: wp.array(dtype=Push),
        unpushed: int,
        gravity: vec3,
        dt: real,
        quantum: real,
        starting: wp.array(dtype=int),
        seen_motion: wp.array(dtype=vec4),
        seen_spin: wp.array(dtype=vec3),
        seen_body_velocity: wp.array(dtype=wp.vec3d),
        seen_body_spin: wp.array(dtype=wp.vec3d),
    ):
        for k in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            b = sure(k)
            at = body_place[b]
            if at[3] == whole(0):
                continue
            first = starts[b]
            last = starts[b + 1]
            of_b = body_motion[b]
            velocity = vec3(of_b[0], of_b[1], of_b[2])
            turning = momentum[b]
            if wp.static(verlet) and starting[0] == 0:
                force, torque = gather_body(first, last, at, quantum, sphere_at, place, felt_force, felt_torque)
                if wp.static(pushed):
                    if b >= unpushed:
                        outer = pushes[b - unpushed]
                        force += vec3(outer.acted_force)
                        torque += vec3(torque_about_centre(outer, outer.acted_torque, outer.acted_force, turn[b]))
                velocity = half_motion[b] + (force / of_b[3] + gravity) * (real(0.5) * dt)
                push = wp.vec3d(wp.float64(torque[0]), wp.float64(torque[1]), wp.float64(torque[2]))
                turning += push * (wp.float64(0.5) * wp.float64(dt))
            axes = wp.quat_to_matrix(turn[b])
            omega = spin_of(axes, turning, ease_of(inertia[b]))
            seen_body_velocity[b] = wp.vec3d(wp.float64(velocity[0]), wp.float64(velocity[1]), wp.float64(velocity[2]))
            seen_body_spin[b] = omega
            if wp.static(verlet):
                spinning = vec3(real(omega[0]), real(omega[1]), real(omega[2]))
                rotation = mat33(axes)
                for m in range(first, last):
                    i = sure(sphere_at[sure(m)])
                    carried = velocity + wp.cross(spinning, rotation * offset[sure(m)])
                    seen_motion[i] = vec4(carried[0], carried[1], carried[2], real(0.0))
                    seen_spin[i] = spinning

    return see_bodies
