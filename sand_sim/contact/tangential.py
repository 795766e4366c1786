"""Tangential contact laws.

Each is one Warp function ``(contact, pair, normal_force, spring, dt) -> (force [N], spring [m])`` in the tangent plane, acting
on body a. The spring is the elastic slip remembered by the contact; laws without history return it untouched. Beside it stands
``(contact, pair) -> stiffness [N/m]`` of that spring.
"""

from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from sand_sim.contact.contact import contact_types
from sand_sim.precision import Precision


@dataclass(frozen=True)
class TangentialLaw:
    """A choice for the tangential slot and what it needs from the world."""

    build: Callable[[Precision], wp.Function]
    build_stiffness: Callable[[Precision], wp.Function]
    history: bool
    rotation: bool


def build_frictionless(precision: Precision) -> wp.Function:
    """No tangential force. With it spheres never turn, so rotation and history are left out of the world."""
    real, vec3, types = precision.real, precision.vec3, contact_types(precision)

    @wp.func
    def frictionless(contact: types.contact, pair: types.pair, normal_force: real, spring: vec3, dt: real):
        return vec3(real(0.0)), spring

    return frictionless


def build_no_stiffness(precision: Precision) -> wp.Function:
    """A law without a spring."""
    real, types = precision.real, contact_types(precision)

    @wp.func
    def no_stiffness(contact: types.contact, pair: types.pair) -> real:
        return real(0.0)

    return no_stiffness


def build_mindlin_stiffness(precision: Precision) -> wp.Function:
    """Mindlin's tangential stiffness without slip, ``k_t = 8 G* a``."""
    real, types = precision.real, contact_types(precision)

    @wp.func
    def mindlin_stiffness(contact: types.contact, pair: types.pair) -> real:
        return real(8.0) * pair.shear * contact.patch

    return mindlin_stiffness


def build_mindlin(precision: Precision) -> wp.Function:
    """Mindlin's no-slip tangential stiffness with history, bounded by Coulomb friction.

    ``F_t = -k_t s - 2 z sqrt(k_t m*) v_s`` with ``k_t = 8 G* a`` and ``|F_t| <= mu F_n``. The spring s is projected on the new
    tangent plane, then grows by ``v_s dt``; while sliding it is cut back to what the bound can hold.

    Source: Mindlin & Deresiewicz 1953, in the incremental form of Di Renzo & Di Maio 2004,
    https://doi.org/10.1016/j.ces.2003.09.037. It is not the full load-history theory: the stiffness follows the present overlap.
    """
    real, vec3, types = precision.real, precision.vec3, contact_types(precision)
    mindlin_stiffness = build_mindlin_stiffness(precision)

    @wp.func
    def mindlin(contact: types.contact, pair: types.pair, normal_force: real, spring: vec3, dt: real):
        stiffness = mindlin_stiffness(contact, pair)
        viscosity = pair.shear_damping * contact.inertia
        turned = spring - contact.normal * wp.dot(spring, contact.normal)
        stretched = turned + contact.slip * dt
        viscous = contact.slip * viscosity
        force = -stretched * stiffness - viscous
        bound = pair.friction * normal_force
        force_square = wp.dot(force, force)
        if force_square > bound * bound:
            force = force * (bound / wp.sqrt(force_square))
            stretched = -(force + viscous) / stiffness
        return force, stretched

    return mindlin


TANGENTIAL_LAWS = {
    "none": TangentialLaw(build_frictionless, build_no_stiffness, history=False, rotation=False),
    "mindlin": TangentialLaw(build_mindlin, build_mindlin_stiffness, history=True, rotation=True),
}
