"""Cohesion laws: ``(contact, pair, memory) -> (attraction [N], memory)``, also across a gap while the memory says so.

Laws that act only where grains touch remember nothing; what they are given as memory is zero.

The attraction is taken off the force of the normal law; friction is bounded by the force of the normal law alone, which includes
what balances the attraction. ``reach`` gives the widest gap across which a law acts, ``bond`` what it takes to part grains.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from sand_sim.contact.contact import ContactTypes
from sand_sim.contact.law import Law, PairNumbers
from sand_sim.precision import Precision

SOLID_FRACTION = 0.6  # of the sand that a water saturation is reckoned for
BRIDGES = 6.0  # per grain in that sand
_NEWTON_STEPS = 8
_NARROWEST = 4.0 ** (-2.0 / 3.0)  # patch of a stuck contact as it tears, over that at touch
_ROOTS, _ROOT_STEPS = 5, 4  # within 2 % first, for all that the two precisions hold of lengths in metres, then to the last digit


@dataclass(frozen=True)
class CohesionLaw(Law):
    """A choice for the cohesion slot.

    Attributes:
        reach: ``reach(pair, smaller radius, effective radius)`` gives the widest gap [m].
        bond: ``bond(pair, smaller radius, effective radius)`` gives the work of the bond [J] and the largest pull [N]; zero
            without a bond.
    """

    reach: Callable[[PairNumbers, float, float], float] = lambda pair, least, radius: 0.0
    bond: Callable[[PairNumbers, float, float], tuple[float, float]] = lambda pair, least, radius: (0.0, 0.0)


def bridge_share(saturation: float) -> float:
    """Volume of one liquid bridge over the volume of a grain.

    The water that fills a share ``saturation`` of the pores of sand with 60 % solids, divided among six bridges per grain.
    """
    pores = (1.0 - SOLID_FRACTION) / SOLID_FRACTION
    return saturation * pores / (0.5 * BRIDGES)


def build_capillary(precision: Precision, types: ContactTypes) -> wp.Function:
    """Liquid bridges of the pendular regime, formed when grains touch, broken when drawn too far apart.

    ``F = 2 pi R g cos(t) / (1 + 1.05 S + 2.5 S^2)`` with ``S = s sqrt(R/V)`` across a gap s, R twice the effective radius, g the
    surface tension, t the contact angle and V the bridge's volume; rupture at ``s = (1 + t/2) V^(1/3)``. Valid for volumes up to
    a few hundredths of ``R^3`` and angles below half a radian; quasi-static, without viscous forces.

    Source: Willett et al. 2000, https://doi.org/10.1021/la000657y; rupture Lian, Thornton & Adams 1993,
    https://doi.org/10.1006/jcis.1993.1452.
    """
    real = precision.real

    @wp.func
    def capillary(contact: types.contact, pair: types.pair, volume: real):
        held = volume
        if contact.overlap > real(0.0):
            held = pair.bridge_volume * contact.least * contact.least * contact.least
        gap = wp.max(-contact.overlap, real(0.0))
        attraction = real(0.0)
        if held > real(0.0):
            if gap * gap * gap > pair.rupture_cube * held:
                held = real(0.0)
            else:
                radius = real(2.0) * contact.radius
                wide = gap * wp.sqrt(radius / held)
                attraction = pair.bridge_pull * radius / (real(1.0) + real(21.0) / real(20.0) * wide + real(2.5) * wide * wide)
        return attraction, held

    return capillary


def build_capillary_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy to draw a bridge from touch to its present gap, the integral of its force."""
    real = precision.real

    @wp.func
    def capillary_energy(contact: types.contact, pair: types.pair, volume: real) -> real:
        energy = real(0.0)
        gap = wp.max(-contact.overlap, real(0.0))
        if volume > real(0.0):
            radius = real(2.0) * contact.radius
            scale = wp.sqrt(volume / radius)
            wide = gap / scale
            root = wp.sqrt(real(8897.5) / real(1000.0))  # of 4 * 2.5 - 1.05^2
            area = (
                real(2.0)
                / root
                * (wp.atan((real(5.0) * wide + real(21.0) / real(20.0)) / root) - wp.atan(real(21.0) / real(20.0) / root))
            )
            energy = pair.bridge_pull * radius * scale * area
        return energy - pair.bridge_pull * real(2.0) * contact.radius * wp.max(contact.overlap, real(0.0))

    return capillary_energy


def prepare_capillary(pair: PairNumbers) -> dict[str, float]:
    """Fields of the liquid bridges."""
    liquid = pair.liquid
    angle = liquid["contact_angle"]
    return {
        "bridge_pull": 2.0 * np.pi * liquid["surface_tension"] * np.cos(angle),
        "bridge_volume": 4.0 / 3.0 * np.pi * bridge_share(liquid["saturation"]),
        "rupture_cube": (1.0 + 0.5 * angle) ** 3,
    }


def capillary_reach(pair: PairNumbers, least: float, radius: float) -> float:
    """Rupture distance of the bridge of two grains [m]."""
    fields = prepare_capillary(pair)
    return float((fields["rupture_cube"] * fields["bridge_volume"]) ** (1.0 / 3.0) * least)


def capillary_bond(pair: PairNumbers, least: float, radius: float) -> tuple[float, float]:
    """Energy to draw a bridge from touch until it breaks [J] and its pull at touch [N]."""
    fields = prepare_capillary(pair)
    pull = fields["bridge_pull"] * 2.0 * radius
    scale = np.sqrt(fields["bridge_volume"] * least**3 / (2.0 * radius))
    wide = capillary_reach(pair, least, radius) / scale
    root = np.sqrt(4.0 * 2.5 - 1.05**2)
    area = 2.0 / root * (np.arctan((5.0 * wide + 1.05) / root) - np.arctan(1.05 / root))
    return float(pull * scale * area), float(pull)


def build_dmt(precision: Precision, types: ContactTypes) -> wp.Function:
    """Adhesion of small stiff grains: a constant pull while they touch.

    ``F = 2 pi w R*`` with the work of adhesion w. Valid for a small Tabor number ``(R* w^2 / (E*^2 z0^3))^(1/3) < 0.1``.

    Source: Derjaguin, Muller & Toporov 1975, https://doi.org/10.1016/0021-9797(75)90018-1.
    """
    real = precision.real

    @wp.func
    def dmt(contact: types.contact, pair: types.pair, memory: real):
        attraction = real(0.0)
        if contact.overlap > real(0.0):
            attraction = pair.adhesion_pull * contact.radius
        return attraction, memory

    return dmt


def build_dmt_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy against the constant pull, ``-2 pi w R* xi``."""
    real = precision.real

    @wp.func
    def dmt_energy(contact: types.contact, pair: types.pair, memory: real) -> real:
        return -pair.adhesion_pull * contact.radius * wp.max(contact.overlap, real(0.0))

    return dmt_energy


def prepare_dmt(pair: PairNumbers) -> dict[str, float]:
    """Fields of the constant pull."""
    return {"adhesion_pull": 2.0 * np.pi * pair.given["adhesion"]}


def dmt_bond(pair: PairNumbers, least: float, radius: float) -> tuple[float, float]:
    """Work of the pull down to where the Hertz force balances it, ``(3 P/(4 E* sqrt(R*)))^(2/3)`` deep [J], and the pull [N]."""
    pull = prepare_dmt(pair)["adhesion_pull"] * radius
    return float(pull * (0.75 * pull / (pair.young * np.sqrt(radius))) ** (2.0 / 3.0)), float(pull)


def build_two_thirds(precision: Precision) -> wp.Function:
    """Warp function ``x -> x^(2/3)``, zero unless x is positive, without a library that knows one number at a time.

    ``2/3 = 1/2 + 1/8 + 1/32 + ...`` is a product of roots, of which Newton's method makes the rest.
    """
    real = precision.real

    @wp.func
    def two_thirds(x: real) -> real:
        part = x
        power = real(1.0)
        for _ in range(wp.static(_ROOTS)):
            part = wp.sqrt(part)
            power *= part
            part = wp.sqrt(part)
        for _ in range(wp.static(_ROOT_STEPS)):
            ratio = x / power
            power = (power + power + ratio * ratio) / real(3.0)
        return wp.where(x > real(0.0), power, real(0.0))

    return two_thirds


def build_stuck_patch(precision: Precision, types: ContactTypes) -> wp.Function:
    """Warp function ``(contact, pair, b_0) -> b``: radius of a stuck contact's patch, from that at touch, by Newton's method."""
    real = precision.real

    @wp.func
    def stuck_patch(contact: types.contact, pair: types.pair, unloaded: real) -> real:
        narrowest = real(wp.static(_NARROWEST * (1.0 + 2.0**-20))) * unloaded
        wide = contact.patch + unloaded
        for _ in range(wp.static(_NEWTON_STEPS)):
            root = pair.adhesion_root * wp.sqrt(wide)
            miss = wide * wide / contact.radius - root - contact.overlap
            slope = real(2.0) * wide / contact.radius - real(0.5) * root / wide
            wide = wp.max(wide - miss / slope, narrowest)
        return wide

    return stuck_patch


def build_jkr(precision: Precision, types: ContactTypes) -> wp.Function:
    """Adhesion of soft grains: the contact patch is wider than Hertz's and holds on until it is torn.

    The patch radius b solves ``xi = b^2/R* - sqrt(2 pi w b / E*)``, the force is ``F = 4 E* b^3 / (3 R*) - sqrt(8 pi w E* b^3)``,
    and the attraction is what that lies below the Hertz force. Grains stick from touch on and part at ``xi = -3 b_c^2 / R*`` with
    ``b_c = (R* sqrt(2 pi w / E*) / 4)^(2/3)``. Valid for a large Tabor number; to be combined with a Hertz normal law.

    Source: Johnson, Kendall & Roberts 1971, https://doi.org/10.1098/rspa.1971.0141.
    """
    real, two_thirds, stuck_patch = precision.real, build_two_thirds(precision), build_stuck_patch(precision, types)

    @wp.func
    def jkr(contact: types.contact, pair: types.pair, stuck: real):
        holds = stuck
        if contact.overlap > real(0.0):
            holds = real(1.0)
        attraction = real(0.0)
        if holds > real(0.0):
            unloaded = two_thirds(contact.radius * pair.adhesion_root)
            narrowest = real(wp.static(_NARROWEST)) * unloaded
            if contact.overlap < real(-3.0) * narrowest * narrowest / contact.radius:
                holds = real(0.0)
            else:
                wide = stuck_patch(contact, pair, unloaded)
                cube = wide * wide * wide
                # sqrt(8 pi w E* b^3) = 2 E* sqrt(2 pi w / E*) b^(3/2)
                whole = real(4.0) / real(3.0) * pair.adhesion_young * cube / contact.radius
                whole -= real(2.0) * pair.adhesion_young * pair.adhesion_root * wp.sqrt(cube)
                hertz = real(4.0) / real(3.0) * pair.adhesion_young * contact.patch * wp.max(contact.overlap, real(0.0))
                attraction = hertz - whole
        return attraction, holds

    return jkr


def build_jkr_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of a stuck contact, from touch on, less that of the Hertz force, which the normal law counts.

    With ``s = sqrt(2 pi w / E*)`` and the patch b, the integral of the force over the overlap is
    ``E* (8/15 b^5/R*^2 - 4/3 s b^(7/2)/R* + 1/2 s^2 b^2)``; at touch ``b_0 = (R* s)^(2/3)``, and it is ``-3/10 E* b_0^5/R*^2``.
    """
    real, two_thirds, stuck_patch = precision.real, build_two_thirds(precision), build_stuck_patch(precision, types)

    @wp.func
    def jkr_energy(contact: types.contact, pair: types.pair, stuck: real) -> real:
        energy = real(0.0)
        if stuck > real(0.0):
            unloaded = two_thirds(contact.radius * pair.adhesion_root)
            wide = stuck_patch(contact, pair, unloaded)
            bond = pair.adhesion_root * contact.radius / (wide * wp.sqrt(wide))  # from 1 at touch to 4 where it tears
            flat = wide * wide / contact.radius
            at_touch = unloaded * unloaded / contact.radius
            energy = flat * flat * wide * (real(8.0) / real(15.0) - real(4.0) / real(3.0) * bond + real(0.5) * bond * bond)
            energy += real(3.0) / real(10.0) * at_touch * at_touch * unloaded
            overlap = wp.max(contact.overlap, real(0.0))
            energy -= real(8.0) / real(15.0) * contact.patch * overlap * overlap
        return pair.adhesion_young * energy

    return jkr_energy


def prepare_jkr(pair: PairNumbers) -> dict[str, float]:
    """Fields of the soft adhesion."""
    return {"adhesion_young": pair.young, "adhesion_root": float(np.sqrt(2.0 * np.pi * pair.given["adhesion"] / pair.young))}


def jkr_reach(pair: PairNumbers, least: float, radius: float) -> float:
    """Gap at which a stuck contact is torn [m]."""
    patch = (radius * prepare_jkr(pair)["adhesion_root"] / 4.0) ** (2.0 / 3.0)
    return 3.0 * patch**2 / radius


def jkr_bond(pair: PairNumbers, least: float, radius: float) -> tuple[float, float]:
    """Energy that a bounce loses, ``7.09 (w^5 R*^4 / E*^2)^(1/3)`` [J], and the pull-off force, ``3/2 pi w R*`` [N].

    Source: Thornton & Ning 1998, https://doi.org/10.1016/S0032-5910(98)00099-0.
    """
    adhesion = pair.given["adhesion"]
    return 7.09 * (adhesion**5 * radius**4 / pair.young**2) ** (1.0 / 3.0), 1.5 * np.pi * adhesion * radius


COHESION_LAWS = {
    "none": CohesionLaw(build=lambda precision, types: None),
    "capillary": CohesionLaw(
        build_capillary,
        build_capillary_energy,
        fields={
            "bridge_pull": "[N/m] 2 pi g cos(t)",
            "bridge_volume": "[1] volume of a bridge over the cube of the smaller radius",
            "rupture_cube": "[1] (1 + t/2)^3",
        },
        prepare=prepare_capillary,
        memory=(1,),
        reach=capillary_reach,
        bond=capillary_bond,
    ),
    "dmt": CohesionLaw(
        build_dmt,
        build_dmt_energy,
        fields={"adhesion_pull": "[N/m] 2 pi w"},
        prepare=prepare_dmt,
        asks=("adhesion",),
        bond=dmt_bond,
    ),
    "jkr": CohesionLaw(
        build_jkr,
        build_jkr_energy,
        fields={"adhesion_young": "[Pa] E*", "adhesion_root": "[sqrt(m)] sqrt(2 pi w / E*)"},
        prepare=prepare_jkr,
        asks=("adhesion",),
        memory=(1,),
        reach=jkr_reach,
        bond=jkr_bond,
    ),
}
