"""Forces between grains, one thread per listed pair."""

from functools import cache

import warp as wp

from sand_sim.contact.contact import contact_types
from sand_sim.contact.response import build_meeting
from sand_sim.engine.act import build_act
from sand_sim.engine.kernel import kernel
from sand_sim.engine.precision import Precision
from sand_sim.engine.recipe import Recipe


@cache
def build_gap(precision: Precision) -> wp.Function:
    """Warp function ``(vector from b to a [m], sum of radii [m]) -> (normal, overlap [m])``; coinciding centres part upwards."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def gap(apart: vec3, reach: real):
        normal = vec3(real(0.0), real(0.0), real(1.0))
        distance = wp.length(apart)
        if distance > real(0.0):
            normal = apart / distance
        return normal, wp.max(reach - distance, real(0.0))

    return gap


@cache
def build_pair_forces(recipe: Recipe, measuring: bool = False) -> wp.Kernel:
    """Kernel for the forces between grains."""
    precision, rotation, materials = recipe.precision, recipe.rotation, recipe.materials
    real, vec3, vec4, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole4
    types = contact_types(precision)
    gap = build_gap(precision)
    meeting = build_meeting(precision)
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
        material: wp.array(dtype=int),
        table: wp.array(dtype=types.pair),
        kinds: int,
        quantum: real,
        dt: real,
        spring: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        for contact in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            a = owner[contact]
            b = partner[contact]
            at_a = place[a]
            at_b = place[b]
            apart = vec3(real(at_a[0] - at_b[0]), real(at_a[1] - at_b[1]), real(at_a[2] - at_b[2])) * quantum
            reach = real(at_a[3] + at_b[3]) * quantum
            if wp.dot(apart, apart) < reach * reach:
                normal, overlap = gap(apart, reach)
                radius_a = real(at_a[3]) * quantum
                radius_b = real(at_b[3]) * quantum
                half = real(0.5) * overlap
                of_a = motion[a]
                of_b = motion[b]
                velocity = vec3(of_a[0] - of_b[0], of_a[1] - of_b[1], of_a[2] - of_b[2])
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
                radius = radius_a * radius_b / reach
                mass = of_a[3] * of_b[3] / (of_a[3] + of_b[3])
                met = meeting(normal, overlap, velocity, radius, mass)
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
                    overlap / wp.min(radius_a, radius_b),
                    spring,
                    force,
                    couple,
                    deepest,
                    energy,
                )
            else:
                release(contact, spring, force, couple, energy)

    return pair_forces
