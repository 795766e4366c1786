"""Normal contact laws.

Each is one Warp function ``(contact, pair) -> force [N] >= 0`` along ``contact.normal``. Beside it stands ``(contact, pair) ->
energy [J]`` stored in the elastic part.
"""

from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from sand_sim.contact.contact import contact_types
from sand_sim.precision import Precision


@dataclass(frozen=True)
class NormalLaw:
    """A choice for the normal slot: its builders and the power of the overlap in its elastic force."""

    build: Callable[[Precision], wp.Function]
    build_energy: Callable[[Precision], wp.Function]
    exponent: float


def build_hertz(precision: Precision) -> wp.Function:
    """Hertz contact with damping that never pulls.

    ``F = max(0, 4/3 E* a xi - 2 z sqrt(S m*) v_n)`` with the patch radius ``a = sqrt(R* xi)``, the tangent stiffness
    ``S = 2 E* a`` and the damping ratio z of damping.py. Valid for overlaps small against the radius; the restitution does not
    depend on speed. It is not plastic and not adhesive.

    Source: Hertz 1882; damping of Tsuji et al. 1992, https://doi.org/10.1016/0032-5910(92)88030-L.
    """
    real, types = precision.real, contact_types(precision)

    @wp.func
    def hertz(contact: types.contact, pair: types.pair) -> real:
        tangent = real(2.0) * pair.young * contact.patch
        elastic = real(2.0) / real(3.0) * tangent * contact.overlap
        viscous = pair.normal_damping * contact.inertia * contact.normal_speed
        return wp.max(elastic - viscous, real(0.0))

    return hertz


def build_hertz_energy(precision: Precision) -> wp.Function:
    """Energy of the elastic Hertz force, ``8/15 E* sqrt(R*) xi^2.5``."""
    real, types = precision.real, contact_types(precision)

    @wp.func
    def hertz_energy(contact: types.contact, pair: types.pair) -> real:
        return real(8.0) / real(15.0) * pair.young * contact.patch * contact.overlap * contact.overlap

    return hertz_energy


NORMAL_LAWS = {"hertz": NormalLaw(build_hertz, build_hertz_energy, exponent=1.5)}
