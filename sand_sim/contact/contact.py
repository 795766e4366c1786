"""What a contact law sees: every contact, grain on grain, tool or wall, is reduced to the same ``Contact``."""

from dataclasses import dataclass
from functools import cache

import warp as wp

from sand_sim.precision import Precision


@dataclass(frozen=True)
class ContactTypes:
    """The two Warp structs of the contact slots."""

    contact: type
    pair: type


@cache
def contact_type(precision: Precision) -> type:
    """Build ``Contact`` for a precision."""
    real, vec3 = precision.real, precision.vec3

    @wp.struct
    class Contact:
        normal: vec3  # [1] unit vector from body b to body a, along which a is pushed
        overlap: real  # [m] xi, negative across a gap
        normal_speed: real  # [m/s] v . n, negative while approaching
        slip: vec3  # [m/s] v - (v . n) n, velocity of a relative to b at the contact point, in the tangent plane
        turning: vec3  # [rad/s] angular velocity of a relative to b
        drift: vec3  # [m/s] slip over the last step, by which springs have grown
        roll: vec3  # [rad/s] turning over the last step
        span: real  # [s] for how long they have grown, a step or the time since touch
        radius: real  # [m] effective radius R* = Ra Rb / (Ra + Rb)
        least: real  # [m] radius of the smaller body
        lever: real  # [m] arm of rolling resistance, R*, on a surface the grain's radius, whatever particles that consists of
        mass: real  # [kg] effective mass m* = ma mb / (ma + mb)
        patch: real  # [m] radius of the Hertz contact patch, a = sqrt(R* xi), zero across a gap
        inertia: real  # [sqrt(kg m)] sqrt(m* a), shared by the damping of both directions
        share: real  # [1] time for which the damping of this step stands, over the step

    return Contact


@cache
def pair_type(precision: Precision, fields: tuple[str, ...]) -> type:
    """Build ``MaterialPair`` with the fields that the chosen laws read."""
    names = fields or ("nothing",)
    return wp.struct(type("MaterialPair", (), {"__annotations__": dict.fromkeys(names, precision.real)}))
