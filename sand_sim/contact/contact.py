"""What a contact law sees: every contact, grain on grain, tool or wall, is reduced to the same ``Contact``."""

from dataclasses import dataclass
from functools import cache

import warp as wp

from sand_sim.precision import Precision


@dataclass(frozen=True)
class ContactTypes:
    """The two Warp structs of the contact slot, in one precision."""

    contact: type
    pair: type


@cache
def contact_types(precision: Precision) -> ContactTypes:
    """Build ``Contact`` and ``MaterialPair`` for a precision."""
    real, vec3 = precision.real, precision.vec3

    @wp.struct
    class Contact:
        normal: vec3  # [1] unit vector from body b to body a, along which a is pushed
        overlap: real  # [m] xi >= 0
        normal_speed: real  # [m/s] v . n, negative while approaching
        slip: vec3  # [m/s] v - (v . n) n, velocity of a relative to b at the contact point, in the tangent plane
        radius: real  # [m] effective radius R* = Ra Rb / (Ra + Rb)
        mass: real  # [kg] effective mass m* = ma mb / (ma + mb)
        patch: real  # [m] radius of the Hertz contact patch, a = sqrt(R* xi)
        inertia: real  # [sqrt(kg m)] sqrt(m* a), shared by the damping of both directions

    @wp.struct
    class MaterialPair:
        young: real  # [Pa] E*: 1/E* = (1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b
        shear: real  # [Pa] G*: 1/G* = (2 - nu_a)/G_a + (2 - nu_b)/G_b
        friction: real  # [1] Coulomb coefficient mu
        normal_damping: real  # [sqrt(Pa)] 2 z sqrt(2 E*), z the damping ratio of damping.py
        shear_damping: real  # [sqrt(Pa)] 2 z sqrt(8 G*)

    return ContactTypes(Contact, MaterialPair)
