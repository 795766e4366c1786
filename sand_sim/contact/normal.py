"""Normal contact laws: ``(contact, pair) -> force [N] >= 0`` along ``contact.normal``; the energy beside it is ``-> [J]``."""

import numpy as np
import warp as wp

from sand_sim.contact.contact import ContactTypes
from sand_sim.contact.damping import damping_ratio
from sand_sim.contact.law import Law, PairNumbers
from sand_sim.precision import Precision


def build_hertz(precision: Precision, types: ContactTypes) -> wp.Function:
    """Hertz contact with damping that never pulls.

    ``F = max(0, 4/3 E* a xi - 2 z sqrt(S m*) v_n)`` with the patch radius ``a = sqrt(R* xi)``, the tangent stiffness
    ``S = 2 E* a`` and the damping ratio z of damping.py. Valid for overlaps small against the radius; the restitution does not
    depend on speed. It is not plastic and not adhesive.

    Source: Hertz 1882; damping of Tsuji et al. 1992, https://doi.org/10.1016/0032-5910(92)88030-L.
    """
    real = precision.real

    @wp.func
    def hertz(contact: types.contact, pair: types.pair) -> real:
        elastic = real(4.0) / real(3.0) * pair.young * contact.patch * contact.overlap
        viscous = pair.normal_damping * contact.inertia * contact.normal_speed
        return wp.max(elastic - viscous, real(0.0))

    return hertz


def build_hertz_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the elastic Hertz force, ``8/15 E* a xi^2``."""
    real = precision.real

    @wp.func
    def hertz_energy(contact: types.contact, pair: types.pair) -> real:
        return real(8.0) / real(15.0) * pair.young * contact.patch * contact.overlap * contact.overlap

    return hertz_energy


def prepare_hertz(pair: PairNumbers) -> dict[str, float]:
    """Fields of the Hertz law."""
    ratio = damping_ratio(pair.given["restitution"], exponent=1.5)
    return {"young": pair.young, "normal_damping": 2.0 * ratio * np.sqrt(2.0 * pair.young)}


def build_linear(precision: Precision, types: ContactTypes) -> wp.Function:
    """Linear spring-dashpot that never pulls.

    ``F = max(0, k xi - 2 z sqrt(k m*) v_n)`` with a stiffness that belongs to the pair, whatever the radii. Contact time and
    restitution do not depend on speed. It is no elastic solid: stiffness does not grow with load.

    Source: Cundall & Strack 1979, https://doi.org/10.1680/geot.1979.29.1.47; clipping as Schwager & Poeschel 2007,
    https://doi.org/10.1007/s10035-007-0065-z.
    """
    real = precision.real

    @wp.func
    def linear(contact: types.contact, pair: types.pair) -> real:
        viscous = pair.linear_damping * wp.sqrt(contact.mass) * contact.share * contact.normal_speed
        return wp.where(contact.overlap > real(0.0), wp.max(pair.stiffness * contact.overlap - viscous, real(0.0)), real(0.0))

    return linear


def build_linear_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the linear spring, ``k xi^2 / 2``."""
    real = precision.real

    @wp.func
    def linear_energy(contact: types.contact, pair: types.pair) -> real:
        return real(0.5) * pair.stiffness * contact.overlap * contact.overlap

    return linear_energy


def prepare_linear(pair: PairNumbers) -> dict[str, float]:
    """Fields of the linear law."""
    stiffness = pair.given["stiffness"]
    ratio = damping_ratio(pair.given["restitution"], exponent=1.0)
    return {"stiffness": stiffness, "linear_damping": 2.0 * ratio * np.sqrt(stiffness)}


def build_viscoelastic(precision: Precision, types: ContactTypes) -> wp.Function:
    """Hertz contact of viscoelastic spheres, never pulling; faster impacts lose a larger share.

    ``F = max(0, 4/3 E* a (xi - 3/2 A v_n))`` with the viscous time A of the pair of materials. Valid while the impact is slow
    against the speed of sound and A short against the contact. Restitution tends to one at low speed.

    Source: Kuwabara & Kono 1987, https://doi.org/10.1143/JJAP.26.1230; Brilliantov et al. 1996,
    https://doi.org/10.1103/PhysRevE.53.5382.
    """
    real = precision.real

    @wp.func
    def viscoelastic(contact: types.contact, pair: types.pair) -> real:
        strain = contact.overlap - real(1.5) * pair.viscous_time * contact.normal_speed
        return real(4.0) / real(3.0) * pair.young * contact.patch * wp.max(strain, real(0.0))

    return viscoelastic


def prepare_viscoelastic(pair: PairNumbers) -> dict[str, float]:
    """Fields of the viscoelastic law."""
    return {"young": pair.young, "viscous_time": pair.given["viscous_time"]}


_YOUNG = {"young": "[Pa] E*: 1/E* = (1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b"}

NORMAL_LAWS = {
    "hertz": Law(
        build_hertz,
        build_hertz_energy,
        fields=_YOUNG | {"normal_damping": "[sqrt(Pa)] 2 z sqrt(2 E*), z the damping ratio"},
        prepare=prepare_hertz,
        asks=("restitution",),
    ),
    "linear": Law(
        build_linear,
        build_linear_energy,
        fields={"stiffness": "[N/m] k", "linear_damping": "[sqrt(N/m)] 2 z sqrt(k), z the damping ratio"},
        prepare=prepare_linear,
        asks=("restitution", "stiffness"),
    ),
    "viscoelastic": Law(
        build_viscoelastic,
        build_hertz_energy,
        fields=_YOUNG | {"viscous_time": "[s] A"},
        prepare=prepare_viscoelastic,
        asks=("viscous_time",),
    ),
}
