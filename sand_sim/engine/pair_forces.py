"""Forces between grains, one thread per listed pair."""

from functools import cache

import warp as wp

from sand_sim.contact.response import memory_type
from sand_sim.engine.act import build_act, build_acts
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.pair_contact import build_excess, build_pair_contact
from sand_sim.engine.recipe import Recipe


@cache
def build_pair_forces(recipe: Recipe, measuring: bool = False) -> wp.Kernel:
    """Kernel for the forces between grains."""
    precision, rotation, materials, halves = recipe.precision, recipe.rotation, recipe.materials, recipe.halves
    real, vec3, vec4, whole3, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole3, precision.whole4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    excess_of, pair_contact, acts = build_excess(precision), build_pair_contact(recipe), build_acts(recipe)
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
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        for listed in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            contact = sure(listed)
            a = sure(owner[contact])
            b = sure(partner[contact])
            at_a = place[a]
            at_b = place[b]
            apart = whole3(at_a[0] - at_b[0], at_a[1] - at_b[1], at_a[2] - at_b[2])
            excess = excess_of(apart, at_a[3] + at_b[3])
            if acts(contact, excess > real(0.0), memory):
                of_a = motion[a]
                of_b = motion[b]
                velocity = vec3(of_a[0] - of_b[0], of_a[1] - of_b[1], of_a[2] - of_b[2])
                turning_a = vec3(real(0.0))
                turning_b = vec3(real(0.0))
                if wp.static(rotation):
                    spin_a = spin[a]
                    spin_b = spin[b]
                    turning_a = vec3(spin_a[0], spin_a[1], spin_a[2])
                    turning_b = vec3(spin_b[0], spin_b[1], spin_b[2])
                past = vec3(real(0.0))
                past_a = vec3(real(0.0))
                past_b = vec3(real(0.0))
                if wp.static(halves):
                    past = half_motion[a] - half_motion[b]
                    past_a = half_spin[a]
                    past_b = half_spin[b]
                met, half = pair_contact(
                    excess,
                    apart,
                    at_a[3],
                    at_b[3],
                    velocity,
                    turning_a,
                    turning_b,
                    past,
                    past_a,
                    past_b,
                    of_a[3],
                    of_b[3],
                    quantum,
                    dt,
                )
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
                    met.overlap / met.least,
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
