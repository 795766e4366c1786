"""From the kinematics of a contact to forces and moments: the one line in which every kind of contact ends."""

from functools import cache

import warp as wp

from sand_sim.contact.contact import contact_type
from sand_sim.contact.model import ContactModel
from sand_sim.precision import Precision


def memory_type(model: ContactModel, precision: Precision) -> type:
    """Warp vector with all that a contact remembers."""
    return {3: precision.vec3, 4: precision.vec4}.get(len(model.memory)) or wp.types.vector(
        max(len(model.memory), 1), precision.real
    )


@cache
def build_meeting(precision: Precision) -> wp.Function:
    """Warp function that fills a ``Contact`` from normal, overlap, relative velocity at the contact point and relative spin."""
    real, vec3, contact_struct = precision.real, precision.vec3, contact_type(precision)

    @wp.func
    def meeting(
        normal: vec3, overlap: real, velocity: vec3, turning: vec3, radius: real, least: real, lever: real, mass: real
    ) -> contact_struct:
        contact = contact_struct()
        contact.normal = normal
        contact.overlap = overlap
        contact.normal_speed = wp.dot(velocity, normal)
        contact.slip = velocity - normal * contact.normal_speed
        contact.turning = turning
        contact.drift = contact.slip
        contact.roll = turning
        contact.radius = radius
        contact.least = least
        contact.lever = lever
        contact.mass = mass
        contact.patch = wp.sqrt(radius * wp.max(overlap, real(0.0)))
        contact.inertia = wp.sqrt(contact.patch * mass)
        contact.share = real(1.0)
        return contact

    return meeting


@cache
def build_drifting(precision: Precision) -> wp.Function:
    """Warp function ``(contact, velocity, turning, lag) -> contact`` with what the bodies did over the last step.

    The velocities are those of the middle of the step, the one at the contact point as well, where the normal was less by ``lag``
    [1] than it is now. Taken with the normal of now, a grain that spins about it would seem to slip by half the angle that the
    normal turns by in a step, and grains that roll round one another or in a drum would gain or lose energy with every turn.

    Springs that grow by the velocities of half steps, which move the bodies, are leapfrog oscillators and neither gain nor lose;
    grown by velocities predicted for now they would gain ``(w dt)^3 / 4`` a radian, and dense beds would jitter.
    """
    vec3, contact_struct = precision.vec3, contact_type(precision)

    @wp.func
    def drifting(contact: contact_struct, velocity: vec3, turning: vec3, lag: vec3) -> contact_struct:
        contact.drift = velocity - contact.normal * wp.dot(velocity, contact.normal)
        contact.roll = turning + lag * wp.dot(turning, contact.normal) - contact.normal * wp.dot(turning, lag)
        return contact

    return drifting


@cache
def build_fresh(precision: Precision) -> wp.Function:
    """Warp function ``(contact, dt) -> contact`` that gives dampers their due in the step in which bodies touch.

    Damping sets in at full strength at touch, which lies anywhere within a step. Its first force therefore stands for the time
    since touch and half a step on, ``share = xi / |v_n| dt + 1/2``, with the patch it has in the mean over that time; else the
    restitution would depend on where in a step grains meet (by 0.02 at 25 steps a contact). Elastic forces begin at zero and are
    left alone, so that elastic contacts stay reversible.

    A touch of just now is left to the step after, which then stands for a step and a half: grains that are placed touching one
    another, or touch at the end of a step, do so but for rounding, and must not be taken for grains that touched long ago.
    """
    real, contact_struct = precision.real, contact_type(precision)

    @wp.func
    def fresh(contact: contact_struct, dt: real) -> contact_struct:
        advance = -contact.normal_speed * dt
        just_now = advance * (real(1.0) / real(100.0))
        contact.span = dt
        if contact.overlap < advance + just_now:
            contact.span = contact.overlap / advance * dt
            contact.share = contact.overlap / advance + real(0.5)
            if contact.overlap < just_now:
                contact.span = real(0.0)
                contact.share = real(0.0)
            # The mean of xi^(1/4) up to an overlap is that at (4/5)^4 of it.
            mean = real(256.0) / real(625.0) * contact.share * advance
            contact.inertia = contact.share * wp.sqrt(contact.mass * wp.sqrt(contact.radius * mean))
        return contact

    return fresh


@cache
def build_response(model: ContactModel, precision: Precision) -> wp.Function:
    """Warp function ``(contact, pair, memory, dt) -> (push, drag, moment, memory)`` on body a.

    ``push`` [N] acts along the normal and may pull, ``drag`` [N] in the tangent plane at the contact point, ``moment`` [N m] is
    that of rolling and twisting resistance; the memory given back is that of now.
    """
    vec3, real, types = precision.vec3, precision.real, model.types(precision)
    built = {slot: law.build(precision, types) for slot, law in model.laws.items()}
    normal, tangential, rolling, twisting, cohesion = built.values()
    has_tangential, has_rolling, has_twisting = (law is not None for law in (tangential, rolling, twisting))
    cohesive, bonds, memory_vector = model.cohesive, model.bonds, memory_type(model, precision)
    slips, rolls = len(model.law("tangential").memory), len(model.law("rolling").memory)
    first_roll, its_twist, its_bond = (model.offset(slot) for slot in ("rolling", "twisting", "cohesion"))
    remembered, fresh = len(model.memory), build_fresh(precision)
    slip_vector = precision.vec4 if slips == 4 else vec3

    @wp.func
    def response(contact: types.contact, pair: types.pair, memory: memory_vector, dt: real):
        drag = vec3(real(0.0))
        moment = vec3(real(0.0))
        after = memory_vector()
        contact = fresh(contact, dt)
        push = normal(contact, pair)
        if wp.static(has_tangential):
            slip = slip_vector()
            for k in range(wp.static(slips)):
                slip[k] = memory[k]
            drag, slipped = tangential(contact, pair, push, slip)
            for k in range(wp.static(slips)):
                after[k] = slipped[k]
        if wp.static(has_rolling):
            roll = vec3()
            for k in range(wp.static(rolls)):
                roll[k] = memory[wp.static(first_roll) + k]
            turn, rolled = rolling(contact, pair, push, roll)
            moment += turn
            for k in range(wp.static(rolls)):
                after[wp.static(first_roll) + k] = rolled[k]
        if wp.static(has_twisting):
            twist, twisted = twisting(contact, pair, push, memory[wp.static(its_twist)])
            moment += twist
            after[wp.static(its_twist)] = twisted
        if wp.static(cohesive):
            # Across a gap all that is thrown away; where nothing acts across gaps only touching contacts count.
            touching = contact.overlap > real(0.0)
            bond = real(0.0)
            if wp.static(bonds):
                bond = memory[wp.static(its_bond)]
            attraction, bond = cohesion(contact, pair, bond)
            push = wp.where(touching, push, real(0.0)) - attraction
            for k in range(3):
                drag[k] = wp.where(touching, drag[k], real(0.0))
                moment[k] = wp.where(touching, moment[k], real(0.0))
            for k in range(wp.static(remembered)):
                after[k] = wp.where(touching, after[k], real(0.0))
            if wp.static(bonds):
                after[wp.static(its_bond)] = bond
        return push, drag, moment, after

    return response


@cache
def build_stored_energy(model: ContactModel, precision: Precision) -> wp.Function:
    """Warp function ``(contact, pair, memory) -> energy [J]`` stored in all springs of a contact."""
    real, vec3, types = precision.real, precision.vec3, model.types(precision)
    built = {slot: law.build_energy and law.build_energy(precision, types) for slot, law in model.laws.items()}
    normal, tangential, rolling, twisting, cohesion = built.values()
    has, bonds = {slot: energy is not None for slot, energy in built.items()}, model.bonds
    slips, rolls = len(model.law("tangential").memory), len(model.law("rolling").memory)
    first_roll, its_twist, its_bond = (model.offset(slot) for slot in ("rolling", "twisting", "cohesion"))
    slip_vector = precision.vec4 if slips == 4 else vec3

    @wp.func
    def stored_energy(contact: types.contact, pair: types.pair, memory: memory_type(model, precision)) -> real:
        energy = real(0.0)
        if contact.overlap > real(0.0):
            energy += normal(contact, pair)
            if wp.static(has["tangential"]):
                slip = slip_vector()
                for k in range(wp.static(slips)):
                    slip[k] = memory[k]
                energy += tangential(contact, pair, slip)
            if wp.static(has["rolling"]):
                roll = vec3()
                for k in range(wp.static(rolls)):
                    roll[k] = memory[wp.static(first_roll) + k]
                energy += rolling(contact, pair, roll)
            if wp.static(has["twisting"]):
                energy += twisting(contact, pair, memory[wp.static(its_twist)])
        if wp.static(has["cohesion"]):
            bond = real(0.0)
            if wp.static(bonds):
                bond = memory[wp.static(its_bond)]
            energy += cohesion(contact, pair, bond)
        return energy

    return stored_energy
