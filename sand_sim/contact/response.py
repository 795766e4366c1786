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
        normal: vec3, overlap: real, velocity: vec3, turning: vec3, radius: real, least: real, mass: real
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
        contact.mass = mass
        contact.patch = wp.sqrt(radius * wp.max(overlap, real(0.0)))
        contact.inertia = wp.sqrt(contact.patch * mass)
        contact.share = real(1.0)
        return contact

    return meeting


@cache
def build_drifting(precision: Precision) -> wp.Function:
    """Warp function ``(contact, velocity, turning) -> contact`` with what the bodies did over the last step.

    Springs that grow by the velocities of half steps, which move the bodies, are leapfrog oscillators and neither gain nor lose;
    grown by velocities predicted for now they would gain ``(w dt)^3 / 4`` a radian, and dense beds would jitter.
    """
    vec3, contact_struct = precision.vec3, contact_type(precision)

    @wp.func
    def drifting(contact: contact_struct, velocity: vec3, turning: vec3) -> contact_struct:
        contact.drift = velocity - contact.normal * wp.dot(velocity, contact.normal)
        contact.roll = turning
        return contact

    return drifting


@cache
def build_fresh(precision: Precision) -> wp.Function:
    """Warp function ``(contact, dt) -> contact`` that gives dampers their due in the step in which bodies touch.

    Damping sets in at full strength at touch, which lies anywhere within a step. Its first force therefore stands for the time
    since touch and half a step on, ``share = xi / |v_n| dt + 1/2``, with the patch it has in the mean over that time; else the
    restitution would depend on where in a step grains meet (by 0.02 at 25 steps a contact). Elastic forces begin at zero and are
    left alone, so that elastic contacts stay reversible.
    """
    real, contact_struct = precision.real, contact_type(precision)

    @wp.func
    def fresh(contact: contact_struct, dt: real) -> contact_struct:
        advance = -contact.normal_speed * dt
        contact.span = dt
        if contact.overlap < advance:
            contact.span = contact.overlap / advance * dt
            contact.share = contact.overlap / advance + real(0.5)
            # The mean of xi^(1/4) up to an overlap is that at (4/5)^4 of it.
            mean = real(256.0) / real(625.0) * contact.share * advance
            contact.inertia = contact.share * wp.sqrt(contact.mass * wp.sqrt(contact.radius * mean))
        return contact

    return fresh


@cache
def build_memory_slot(model: ContactModel, precision: Precision, slot: str) -> tuple[wp.Function, wp.Function]:
    """Warp functions that take the memory of one slot out of a contact's memory, and put it back."""
    real, vec3, vec4 = precision.real, precision.vec3, precision.vec4
    memory, first, length = memory_type(model, precision), model.offset(slot), len(model.laws[slot].memory)

    if length in (3, 4) and length == len(model.memory):

        @wp.func
        def take(whole: memory):
            return whole

        @wp.func
        def put(whole: memory, part: memory):
            return part

    elif length == 4:

        @wp.func
        def take(whole: memory):
            return vec4(
                whole[wp.static(first)], whole[wp.static(first + 1)], whole[wp.static(first + 2)], whole[wp.static(first + 3)]
            )

        @wp.func
        def put(whole: memory, part: vec4):
            for k in range(4):
                whole[wp.static(first) + k] = part[k]
            return whole

    elif length == 1:

        @wp.func
        def take(whole: memory):
            return whole[wp.static(first)]

        @wp.func
        def put(whole: memory, part: real):
            whole[wp.static(first)] = part
            return whole

    else:

        @wp.func
        def take(whole: memory):
            part = vec3(real(0.0))
            if wp.static(length == 3):
                part = vec3(whole[wp.static(first)], whole[wp.static(first + 1)], whole[wp.static(first + 2)])
            return part

        @wp.func
        def put(whole: memory, part: vec3):
            if wp.static(length == 3):
                for k in range(3):
                    whole[wp.static(first) + k] = part[k]
            return whole

    return take, put


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
    cohesive, memory_vector = model.cohesive, memory_type(model, precision)
    take_slip, put_slip = build_memory_slot(model, precision, "tangential")
    take_roll, put_roll = build_memory_slot(model, precision, "rolling")
    take_twist, put_twist = build_memory_slot(model, precision, "twisting")
    take_bond, put_bond = build_memory_slot(model, precision, "cohesion")
    fresh = build_fresh(precision)

    @wp.func
    def response(contact: types.contact, pair: types.pair, memory: memory_vector, dt: real):
        push = real(0.0)
        drag = vec3(real(0.0))
        moment = vec3(real(0.0))
        after = memory_vector()
        # Where nothing acts across a gap only touching contacts come here.
        if not wp.static(cohesive) or contact.overlap > real(0.0):
            contact = fresh(contact, dt)
            push = normal(contact, pair)
            if wp.static(has_tangential):
                drag, slipped = tangential(contact, pair, push, take_slip(memory))
                after = put_slip(after, slipped)
            if wp.static(has_rolling):
                turn, rolled = rolling(contact, pair, push, take_roll(memory))
                moment += turn
                after = put_roll(after, rolled)
            if wp.static(has_twisting):
                twist, twisted = twisting(contact, pair, push, take_twist(memory))
                moment += twist
                after = put_twist(after, twisted)
        if wp.static(cohesive):
            attraction, bond = cohesion(contact, pair, take_bond(memory))
            push -= attraction
            after = put_bond(after, bond)
        return push, drag, moment, after

    return response


@cache
def build_stored_energy(model: ContactModel, precision: Precision) -> wp.Function:
    """Warp function ``(contact, pair, memory) -> energy [J]`` stored in all springs of a contact."""
    real, types = precision.real, model.types(precision)
    built = {slot: law.build_energy and law.build_energy(precision, types) for slot, law in model.laws.items()}
    normal, tangential, rolling, twisting, cohesion = built.values()
    has = {slot: energy is not None for slot, energy in built.items()}
    take_slip, _ = build_memory_slot(model, precision, "tangential")
    take_roll, _ = build_memory_slot(model, precision, "rolling")
    take_twist, _ = build_memory_slot(model, precision, "twisting")
    take_bond, _ = build_memory_slot(model, precision, "cohesion")

    @wp.func
    def stored_energy(contact: types.contact, pair: types.pair, memory: memory_type(model, precision)) -> real:
        energy = real(0.0)
        if contact.overlap > real(0.0):
            energy += normal(contact, pair)
            if wp.static(has["tangential"]):
                energy += tangential(contact, pair, take_slip(memory))
            if wp.static(has["rolling"]):
                energy += rolling(contact, pair, take_roll(memory))
            if wp.static(has["twisting"]):
                energy += twisting(contact, pair, take_twist(memory))
        if wp.static(has["cohesion"]):
            energy += cohesion(contact, pair, take_bond(memory))
        return energy

    return stored_energy
