"""Forces between grains for a core with vector registers: many contacts at once, by the same laws, to the same bits.

Contacts are taken in tiles. What a tile needs is brought together, number by number, in columns that a compiler can load as
vectors; then one loop over the columns applies the laws, and the compiler does as many contacts at once as the registers hold;
then the results go where they belong. Contacts that do not touch are computed along and thrown away, which costs less than a
branch that is guessed wrongly.

A compiler does that to a loop only while its branches choose between numbers. Laws that choose between vectors, or call what has
no vector form, make it a slow loop; a test watches over that.
"""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_response, memory_type
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.pair_contact import build_excess, build_pair_contact
from sand_sim.engine.prefetch import build_fetch_grain
from sand_sim.engine.recipe import Recipe

_TILE = 64  # contacts; their columns take 10 of the 32 or more KiB of the nearest cache


@cache
def build_pair_tiles(recipe: Recipe) -> wp.Kernel:
    """Kernel for the forces between grains, with the arguments of ``build_pair_forces``."""
    precision, rotation, materials, halves = recipe.precision, recipe.rotation, recipe.materials, recipe.halves
    history, couples, bonds = recipe.history, recipe.contact.couples, recipe.contact.bonds
    real, vec3, vec4, whole3, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole3, precision.whole4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    remembered, bond = len(recipe.contact.memory), recipe.contact.offset("cohesion")
    excess_of, pair_contact, response = (
        build_excess(precision),
        build_pair_contact(recipe),
        build_response(recipe.contact, precision),
    )
    fetch_grain = build_fetch_grain(recipe)
    whole_column, whole_columns = wp.types.vector(_TILE, precision.whole), wp.types.matrix((3, _TILE), precision.whole)
    column, columns3, columns4 = (
        wp.types.vector(_TILE, real),
        wp.types.matrix((3, _TILE), real),
        wp.types.matrix((4, _TILE), real),
    )
    kind_column, memory_columns = wp.types.vector(_TILE, int), wp.types.matrix((max(remembered, 1), _TILE), real)

    @kernel
    def pair_tiles(
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
        aparts = whole_columns()
        sizes_a = whole_column()
        sizes_b = whole_column()
        masses_a = column()
        masses_b = column()
        velocities = columns3()
        forces = columns3()
        depths = column()
        if wp.static(rotation):
            spins_a = columns3()
            spins_b = columns3()
            turns = columns4()
        if wp.static(halves):
            pasts = columns3()
            pasts_a = columns3()
            pasts_b = columns3()
        if wp.static(materials):
            kinds_of = kind_column()
        if wp.static(history):
            memories = memory_columns()
        if wp.static(couples):
            moments = columns3()
        depth = real(0.0)
        end = spans[lane + 1]
        for first in range(spans[lane] + wp.tid() * wp.static(_TILE), end, stride * wp.static(_TILE)):
            number = wp.min(wp.static(_TILE), end - first)
            for item in range(number):
                k = sure(item)
                contact = sure(first + item)
                a = sure(owner[contact])
                b = sure(partner[contact])
                fetch_grain(
                    sure(partner[sure(wp.min(contact + wp.static(2 * _TILE), end - 1))]),
                    place,
                    motion,
                    spin,
                    half_motion,
                    half_spin,
                )
                at_a = place[a]
                at_b = place[b]
                of_a = motion[a]
                of_b = motion[b]
                sizes_a[k] = at_a[3]
                sizes_b[k] = at_b[3]
                masses_a[k] = of_a[3]
                masses_b[k] = of_b[3]
                for i in range(3):
                    aparts[i, k] = at_a[i] - at_b[i]
                    velocities[i, k] = of_a[i] - of_b[i]
                if wp.static(rotation):
                    spin_a = spin[a]
                    spin_b = spin[b]
                    for i in range(3):
                        spins_a[i, k] = spin_a[i]
                        spins_b[i, k] = spin_b[i]
                if wp.static(halves):
                    past = half_motion[a] - half_motion[b]
                    past_a = half_spin[a]
                    past_b = half_spin[b]
                    for i in range(3):
                        pasts[i, k] = past[i]
                        pasts_a[i, k] = past_a[i]
                        pasts_b[i, k] = past_b[i]
                if wp.static(materials):
                    kinds_of[k] = material[a] * kinds + material[b]
                if wp.static(history):
                    kept = memory[contact]
                    for i in range(wp.static(remembered)):
                        memories[i, k] = kept[i]
            pair = table[0]
            at = int(0)
            while at < wp.static(_TILE):
                k = at
                at += 1
                apart = whole3(aparts[0, k], aparts[1, k], aparts[2, k])
                excess = excess_of(apart, sizes_a[k] + sizes_b[k])
                velocity = vec3(velocities[0, k], velocities[1, k], velocities[2, k])
                turning_a = vec3(real(0.0))
                turning_b = vec3(real(0.0))
                if wp.static(rotation):
                    turning_a = vec3(spins_a[0, k], spins_a[1, k], spins_a[2, k])
                    turning_b = vec3(spins_b[0, k], spins_b[1, k], spins_b[2, k])
                drift = vec3(real(0.0))
                turned_a = vec3(real(0.0))
                turned_b = vec3(real(0.0))
                if wp.static(halves):
                    drift = vec3(pasts[0, k], pasts[1, k], pasts[2, k])
                    turned_a = vec3(pasts_a[0, k], pasts_a[1, k], pasts_a[2, k])
                    turned_b = vec3(pasts_b[0, k], pasts_b[1, k], pasts_b[2, k])
                met, half = pair_contact(
                    excess,
                    apart,
                    sizes_a[k],
                    sizes_b[k],
                    velocity,
                    turning_a,
                    turning_b,
                    drift,
                    turned_a,
                    turned_b,
                    masses_a[k],
                    masses_b[k],
                    quantum,
                    dt,
                )
                if wp.static(materials):
                    pair = table[sure(kinds_of[k])]
                before = memory_vector()
                if wp.static(history):
                    for i in range(wp.static(remembered)):
                        before[i] = memories[i, k]
                acts = excess > real(0.0)
                if wp.static(bonds):
                    acts = acts or before[wp.static(bond)] > real(0.0)
                push, drag, resistance, after = response(met, pair, before, dt)
                pushed = met.normal * push + drag
                for i in range(3):
                    forces[i, k] = wp.where(acts, pushed[i], real(0.0))
                if wp.static(rotation):
                    turn = wp.cross(drag, met.normal)
                    for i in range(3):
                        turns[i, k] = wp.where(acts, turn[i], real(0.0))
                    turns[3, k] = wp.where(acts, half, real(0.0))
                if wp.static(couples):
                    for i in range(3):
                        moments[i, k] = wp.where(acts, resistance[i], real(0.0))
                if wp.static(history):
                    for i in range(wp.static(remembered)):
                        memories[i, k] = wp.where(acts, after[i], real(0.0))
                depths[k] = wp.where(acts, met.overlap / met.least, real(0.0))
            for item in range(number):
                k = sure(item)
                contact = sure(first + item)
                force[contact] = vec4(forces[0, k], forces[1, k], forces[2, k], real(0.0))
                if wp.static(rotation):
                    couple[contact] = vec4(turns[0, k], turns[1, k], turns[2, k], turns[3, k])
                if wp.static(couples):
                    moment[contact] = vec4(moments[0, k], moments[1, k], moments[2, k], real(0.0))
                if wp.static(history):
                    after = memory_vector()
                    for i in range(wp.static(remembered)):
                        after[i] = memories[i, k]
                    memory[contact] = after
                depth = wp.max(depth, depths[k])
        wp.atomic_max(deepest, lane, depth)

    return pair_tiles
