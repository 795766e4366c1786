"""The one line in which every contact ends: apply the laws and store what they give, or let the contact go."""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_meeting, build_response, build_stored_energy, memory_type
from sand_sim.engine.recipe import Recipe
from sand_sim.integrator import VERLET


@cache
def build_acts(recipe: Recipe) -> wp.Function:
    """Warp function ``(contact, touching, memory) -> bool``: whether a contact exerts forces; with a bond also across a gap."""
    model = recipe.contact
    bonds, bond, memory = model.bonds, model.offset("cohesion"), memory_type(model, recipe.precision)
    real = recipe.precision.real

    @wp.func
    def acts(contact: int, touching: bool, memory: wp.array(dtype=memory)) -> bool:
        result = touching
        if wp.static(bonds):
            result = touching or memory[contact][wp.static(bond)] > real(0.0)
        return result

    return acts


@cache
def build_act(recipe: Recipe, measuring: bool) -> tuple[wp.Function, wp.Function]:
    """Warp functions ``act`` for a contact that exerts forces and ``release`` for one that does not.

    Args:
        recipe: static choices.
        measuring: write the energy stored in the contact too, and let nothing else outlast this call.
    """
    precision, rotation, history, couples = recipe.precision, recipe.rotation, recipe.history, recipe.contact.couples
    real, vec4 = precision.real, precision.vec4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    response = build_response(recipe.contact, precision)
    stored_energy = build_stored_energy(recipe.contact, precision)
    meeting, lagging = build_meeting(precision), recipe.integrator != VERLET

    @wp.func
    def act(
        contact: int,
        met: types.contact,
        pair: types.pair,
        dt: real,
        arm_loss: real,
        lane: int,
        depth: real,
        memory: wp.array(dtype=memory_vector),
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        before = memory_vector()
        if wp.static(history):
            before = memory[contact]
        push, drag, resistance, after = response(met, pair, before, dt)
        pushed = met.normal * push + drag
        force[contact] = vec4(pushed[0], pushed[1], pushed[2], real(0.0))
        if wp.static(rotation):
            turn = wp.cross(drag, met.normal)
            couple[contact] = vec4(turn[0], turn[1], turn[2], arm_loss)
        if wp.static(couples):
            moment[contact] = vec4(resistance[0], resistance[1], resistance[2], real(0.0))
        if depth > deepest[lane]:
            wp.atomic_max(deepest, lane, depth)
        if wp.static(measuring):
            stored_in = met
            if wp.static(lagging):
                # Velocities are those of the middle of the last step; energies add up if the overlap is taken there, too.
                overlap = met.overlap + real(0.5) * dt * met.normal_speed
                stored_in = meeting(met.normal, overlap, met.slip, met.turning, met.radius, met.least, met.lever, met.mass)
            energy[contact] = stored_energy(stored_in, pair, after)
        elif wp.static(history):
            memory[contact] = after

    @wp.func
    def release(
        contact: int,
        memory: wp.array(dtype=memory_vector),
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        energy: wp.array(dtype=real),
    ):
        force[contact] = vec4(real(0.0))
        if wp.static(rotation):
            couple[contact] = vec4(real(0.0))
        if wp.static(couples):
            moment[contact] = vec4(real(0.0))
        if wp.static(measuring):
            energy[contact] = real(0.0)
        elif wp.static(history):
            memory[contact] = memory_vector()

    return act, release


@cache
def build_swapped(recipe: Recipe) -> wp.Function:
    """Warp function that gives what a contact remembers once its bodies have swapped roles."""
    memory = memory_type(recipe.contact, recipe.precision)
    signs = memory(*recipe.contact.memory)

    @wp.func
    def swapped(kept: memory) -> memory:
        return wp.cw_mul(kept, wp.static(signs))

    return swapped
