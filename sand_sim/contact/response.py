"""From the kinematics of a contact to the force: the one line in which every kind of contact ends."""

from dataclasses import dataclass
from functools import cache

import warp as wp

from sand_sim.contact.contact import contact_types
from sand_sim.contact.normal import NORMAL_LAWS
from sand_sim.contact.tangential import TANGENTIAL_LAWS
from sand_sim.precision import Precision


@dataclass(frozen=True)
class ContactModel:
    """One choice per slot of the contact law; static, so another choice is another kernel."""

    normal: str = "hertz"
    tangential: str = "mindlin"

    @property
    def history(self) -> bool:
        """Whether contacts remember their slip."""
        return TANGENTIAL_LAWS[self.tangential].history

    @property
    def rotation(self) -> bool:
        """Whether contacts can turn a sphere."""
        return TANGENTIAL_LAWS[self.tangential].rotation


@cache
def build_response(model: ContactModel, precision: Precision) -> wp.Function:
    """Warp function ``(contact, pair, spring, dt) -> (normal_force [N], tangential force [N], spring [m])`` on body a."""
    vec3, real, types = precision.vec3, precision.real, contact_types(precision)
    normal = NORMAL_LAWS[model.normal].build(precision)
    tangential = TANGENTIAL_LAWS[model.tangential].build(precision)

    @wp.func
    def response(contact: types.contact, pair: types.pair, spring: vec3, dt: real):
        normal_force = normal(contact, pair)
        tangential_force, stretched = tangential(contact, pair, normal_force, spring, dt)
        return normal_force, tangential_force, stretched

    return response


@cache
def build_meeting(precision: Precision) -> wp.Function:
    """Warp function that fills a ``Contact`` from normal, overlap and the relative velocity at the contact point [m/s]."""
    real, vec3, types = precision.real, precision.vec3, contact_types(precision)

    @wp.func
    def meeting(normal: vec3, overlap: real, velocity: vec3, radius: real, mass: real) -> types.contact:
        contact = types.contact()
        contact.normal = normal
        contact.overlap = overlap
        contact.normal_speed = wp.dot(velocity, normal)
        contact.slip = velocity - normal * contact.normal_speed
        contact.radius = radius
        contact.mass = mass
        contact.patch = wp.sqrt(radius * overlap)
        contact.inertia = wp.sqrt(contact.patch * mass)
        return contact

    return meeting


@cache
def build_stored_energy(model: ContactModel, precision: Precision) -> wp.Function:
    """Warp function ``(contact, pair, spring) -> energy [J]`` stored in both springs of a contact."""
    real, vec3, types = precision.real, precision.vec3, contact_types(precision)
    normal_energy = NORMAL_LAWS[model.normal].build_energy(precision)
    stiffness = TANGENTIAL_LAWS[model.tangential].build_stiffness(precision)

    @wp.func
    def stored_energy(contact: types.contact, pair: types.pair, spring: vec3) -> real:
        return normal_energy(contact, pair) + real(0.5) * stiffness(contact, pair) * wp.dot(spring, spring)

    return stored_energy
