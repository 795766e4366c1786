"""Forces between grains, one thread per listed pair."""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_drifting, build_meeting, memory_type
from sand_sim.engine.act import build_act, build_acts
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.recipe import Recipe
from sand_sim.precision import Precision


@cache
def build_direction(precision: Precision) -> wp.Function:
    """Warp function ``vector from b to a -> (normal, distance)``; coinciding centres part upwards."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def direction(apart: vec3):
        normal = vec3(real(0.0), real(0.0), real(1.0))
        distance = wp.length(apart)
        if distance > real(0.0):
            normal = apart / distance
        return normal, distance

    return direction


@cache
def build_excess(precision: Precision) -> wp.Function:
    """Warp function ``(r_a + r_b)^2 - |x_a - x_b|^2`` [quantum^2], positive where spheres touch.

    In single precision the lattice allows it to be computed exactly in 64-bit whole numbers, so that an overlap of a millionth of
    the radius still has seven digits; the difference of two rounded distances would have one.
    """
    real, whole4, exact = precision.real, precision.whole4, precision.whole is wp.int32

    @wp.func
    def excess(at_a: whole4, at_b: whole4) -> real:
        result = real(0.0)
        if wp.static(exact):
            x = wp.int64(at_a[0] - at_b[0])
            y = wp.int64(at_a[1] - at_b[1])
            z = wp.int64(at_a[2] - at_b[2])
            reach = wp.int64(at_a[3] + at_b[3])
            result = real(reach * reach - x * x - y * y - z * z)
        else:
            u = real(at_a[0] - at_b[0])
            v = real(at_a[1] - at_b[1])
            w = real(at_a[2] - at_b[2])
            span = real(at_a[3] + at_b[3])
            result = span * span - u * u - v * v - w * w
        return result

    return excess


@cache
def build_pair_forces(recipe: Recipe, measuring: bool = False) -> wp.Kernel:
    """Kernel for the forces between grains."""
    precision, rotation, materials = recipe.precision, recipe.rotation, recipe.materials
    real, vec3, vec4, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    excess_of, direction = build_excess(precision), build_direction(precision)
    meeting, acts = build_meeting(precision), build_acts(recipe)
    drifting, halves = build_drifting(precision), recipe.halves
    act, release = build_act(recipe, measuring)

    @kernel
    def pair_forces(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        half_spin: wp.array(dtype=vec3),
        material: wp.array(dtype=int),
        table: wp.array(dtype=types.pair),
        kinds: int,
        quantum: real,
        dt: real,
        memory: wp.array(dtype=memory_vector),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec3),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        for listed in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            contact = sure(listed)
            a = sure(owner[contact])
            b = sure(partner[contact])
            at_a = place[a]
            at_b = place[b]
            excess = excess_of(at_a, at_b)
            if acts(contact, excess > real(0.0), memory):
                apart = vec3(real(at_a[0] - at_b[0]), real(at_a[1] - at_b[1]), real(at_a[2] - at_b[2]))
                span = real(at_a[3] + at_b[3])
                normal, distance = direction(apart)
                overlap = excess / (span + distance) * quantum
                reach = span * quantum
                radius_a = real(at_a[3]) * quantum
                radius_b = real(at_b[3]) * quantum
                half = real(0.5) * overlap
                of_a = motion[a]
                of_b = motion[b]
                velocity = vec3(of_a[0] - of_b[0], of_a[1] - of_b[1], of_a[2] - of_b[2])
                relative_spin = vec3(real(0.0))
                if wp.static(rotation):
                    spin_a = spin[a]
                    spin_b = spin[b]
                    arm_a = radius_a - half
                    arm_b = radius_b - half
                    turning = vec3(
                        spin_a[0] * arm_a + spin_b[0] * arm_b,
                        spin_a[1] * arm_a + spin_b[1] * arm_b,
                        spin_a[2] * arm_a + spin_b[2] * arm_b,
                    )
                    velocity -= wp.cross(turning, normal)
                    relative_spin = vec3(spin_a[0] - spin_b[0], spin_a[1] - spin_b[1], spin_a[2] - spin_b[2])
                least = wp.min(radius_a, radius_b)
                radius = radius_a * radius_b / reach
                mass = of_a[3] * of_b[3] / (of_a[3] + of_b[3])
                met = meeting(normal, overlap, velocity, relative_spin, radius, least, mass)
                if wp.static(halves):
                    past_a = half_spin[a]
                    past_b = half_spin[b]
                    past = half_motion[a] - half_motion[b]
                    past -= wp.cross(past_a * (radius_a - half) + past_b * (radius_b - half), normal)
                    met = drifting(met, past, past_a - past_b)
                pair = table[0]
                if wp.static(materials):
                    pair = table[material[a] * kinds + material[b]]
                act(
                    contact,
                    met,
                    pair,
                    dt,
                    half,
                    lane,
                    overlap / least,
                    memory,
                    force,
                    couple,
                    moment,
                    deepest,
                    energy,
                )
            else:
                release(contact, memory, force, couple, moment, energy)

    return pair_forces
