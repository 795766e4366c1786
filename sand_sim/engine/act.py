"""The one line in which every contact ends: apply the law and store what it gives, or let the contact go."""

from functools import cache

import warp as wp

from sand_sim.contact.contact import contact_types
from sand_sim.contact.response import build_response, build_stored_energy
from sand_sim.engine.recipe import Recipe


@cache
def build_act(recipe: Recipe, measuring: bool) -> tuple[wp.Function, wp.Function]:
    """Warp functions ``act`` for a touching and ``release`` for a parted contact.

    Args:
        recipe: static choices.
        measuring: write the energy stored in the contact and change nothing else.
    """
    precision, rotation, history = recipe.precision, recipe.rotation, recipe.history
    real, vec3, vec4 = precision.real, precision.vec3, precision.vec4
    types = contact_types(precision)
    response, stored_energy = build_response(recipe.contact, precision), build_stored_energy(recipe.contact, precision)

    @wp.func
    def act(
        contact: int,
        met: types.contact,
        pair: types.pair,
        dt: real,
        arm_loss: real,
        lane: int,
        depth: real,
        spring: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        before = vec3(real(0.0))
        if wp.static(history):
            before = spring[contact]
        if wp.static(measuring):
            energy[contact] = stored_energy(met, pair, before)
        else:
            push, drag, after = response(met, pair, before, dt)
            force[contact] = met.normal * push + drag
            if wp.static(rotation):
                turn = wp.cross(drag, met.normal)
                couple[contact] = vec4(turn[0], turn[1], turn[2], arm_loss)
            if wp.static(history):
                spring[contact] = after
            if depth > deepest[lane]:
                wp.atomic_max(deepest, lane, depth)

    @wp.func
    def release(
        contact: int,
        spring: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
        energy: wp.array(dtype=real),
    ):
        if wp.static(measuring):
            energy[contact] = real(0.0)
        else:
            force[contact] = vec3(real(0.0))
            if wp.static(rotation):
                couple[contact] = vec4(real(0.0))
            if wp.static(history):
                spring[contact] = vec3(real(0.0))

    return act, release
