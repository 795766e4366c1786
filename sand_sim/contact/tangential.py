"""Tangential contact laws.

``(contact, pair, normal_force, memory) -> (force [N], memory)``: the force acts on body a in the tangent plane, the memory is
a vec3 and for some laws carries one number more. Laws without memory return it untouched. The energy beside it is
``(contact, pair, memory) -> [J]``.
"""

import numpy as np
import warp as wp

from sand_sim.contact.contact import ContactTypes
from sand_sim.contact.damping import damping_ratio
from sand_sim.contact.law import NONE, VECTOR, Law, PairNumbers
from sand_sim.precision import Precision

# A spring gets back the length that turning it takes away only where the plane has turned by more than a milliradian in one
# step, and only beyond what that milliradian takes: a contact that turns by a whole radian loses less than a thousandth.
_TURN_SQUARE = 1e-6


def build_bounded(precision: Precision) -> wp.Function:
    """Warp function ``(spring, viscous, stiffness, bound) -> (force, spring)``: Coulomb's bound.

    A spring beyond the bound yields to what the bound can hold; then spring and dashpot together are cut back to it. The spring
    does not take up the dashpot's share: it would turn against the motion while the bound grows, and a sphere that slides through
    an impact would lose less than ``mu`` times its normal momentum.
    """
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def bounded(spring: vec3, viscous: vec3, stiffness: real, bound: real):
        square = stiffness * stiffness * wp.dot(spring, spring)
        share = real(1.0)
        if square > bound * bound:
            share = bound / wp.sqrt(square)
        held = spring * share
        force = -held * stiffness - viscous
        square = wp.dot(force, force)
        share = real(1.0)
        if square > bound * bound:
            share = bound / wp.sqrt(square)
        return force * share, held

    return bounded


def build_turned(precision: Precision) -> wp.Function:
    """Warp function ``(spring, normal) -> spring`` turned into the tangent plane."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def turned(spring: vec3, normal: vec3):
        out = wp.dot(spring, normal)
        flat = spring - normal * out
        length = wp.dot(flat, flat)
        stretch = real(1.0)
        if length > real(0.0):
            lost = out * out / length
            if lost > real(wp.static(_TURN_SQUARE)):
                stretch = wp.sqrt((real(1.0) + lost) / (real(1.0) + real(wp.static(_TURN_SQUARE))))
        return flat * stretch

    return turned


def build_viscous(precision: Precision, types: ContactTypes) -> wp.Function:
    """Viscous friction bounded by Coulomb, without history (source document A, its choice).

    ``F = -min(mu F_n, g |v_s|) v_s / |v_s|``. A slope built of spheres creeps under it; interlocking grains hold by their shape.

    Source: Haff & Werner 1986, https://doi.org/10.1016/0032-5910(86)80048-1.
    """
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def viscous(contact: types.contact, pair: types.pair, normal_force: real, spring: vec3):
        force = contact.slip * -pair.shear_viscosity
        square = wp.dot(force, force)
        bound = pair.friction * normal_force
        share = real(1.0)
        if square > bound * bound:
            share = bound / wp.sqrt(square)
        return force * share, spring

    return viscous


def build_linear(precision: Precision, types: ContactTypes) -> wp.Function:
    """Linear tangential spring-dashpot with history, bounded by Coulomb friction.

    ``F = -k_s s - 2 z sqrt(k_s m*) v_s`` and ``|F| <= mu F_n``; the spring s is turned with the tangent plane and grows by
    ``v_s dt``; while sliding it yields to what the bound can hold. With a restitution of one it is the displacement-Coulomb law
    of source document A (Lee & Herrmann 1993, https://doi.org/10.1088/0305-4470/26/2/021) but for that: there the spring holds
    all of the displacement since touch, so that a contact which has slid a long way is pushed back with the whole bound.

    Source: Cundall & Strack 1979, https://doi.org/10.1680/geot.1979.29.1.47; Luding 2008,
    https://doi.org/10.1007/s10035-008-0099-x.
    """
    real, vec3 = precision.real, precision.vec3
    bounded, turned = build_bounded(precision), build_turned(precision)

    @wp.func
    def linear(contact: types.contact, pair: types.pair, normal_force: real, spring: vec3):
        stretched = turned(spring, contact.normal) + contact.drift * contact.span
        viscous = contact.slip * (pair.linear_shear_damping * wp.sqrt(contact.mass) * contact.share)
        return bounded(stretched, viscous, pair.shear_stiffness, pair.friction * normal_force)

    return linear


def build_linear_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the tangential spring, ``k_s s^2 / 2``."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def linear_energy(contact: types.contact, pair: types.pair, spring: vec3) -> real:
        return real(0.5) * pair.shear_stiffness * wp.dot(spring, spring)

    return linear_energy


def prepare_linear(pair: PairNumbers) -> dict[str, float]:
    """Fields of the linear law."""
    stiffness = pair.given["shear_stiffness"]
    ratio = damping_ratio(pair.given["restitution"], exponent=1.0)
    return prepare_friction(pair) | {"shear_stiffness": stiffness, "linear_shear_damping": 2.0 * ratio * np.sqrt(stiffness)}


def build_mindlin(precision: Precision, types: ContactTypes) -> wp.Function:
    """Mindlin's no-slip tangential stiffness with history, bounded by Coulomb friction.

    ``F = -k_t s - 2 z sqrt(k_t m*) v_s`` with ``k_t = 8 G* a`` and ``|F| <= mu F_n``. The spring s is turned with the tangent
    plane and grows by ``v_s dt``; while sliding it yields to what the bound can hold.

    Source: Mindlin & Deresiewicz 1953, in the incremental form of Di Renzo & Di Maio 2004,
    https://doi.org/10.1016/j.ces.2003.09.037. It is not the full load-history theory: the stiffness follows the present overlap.
    """
    real, vec3 = precision.real, precision.vec3
    bounded, turned = build_bounded(precision), build_turned(precision)

    @wp.func
    def mindlin(contact: types.contact, pair: types.pair, normal_force: real, spring: vec3):
        stiffness = real(8.0) * pair.shear * contact.patch
        stretched = turned(spring, contact.normal) + contact.drift * contact.span
        viscous = contact.slip * (pair.shear_damping * contact.inertia)
        return bounded(stretched, viscous, stiffness, pair.friction * normal_force)

    return mindlin


def build_mindlin_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the tangential spring, ``k_t s^2 / 2``."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def mindlin_energy(contact: types.contact, pair: types.pair, spring: vec3) -> real:
        return real(4.0) * pair.shear * contact.patch * wp.dot(spring, spring)

    return mindlin_energy


def build_mindlin_rescaled(precision: Precision, types: ContactTypes) -> wp.Function:
    """Mindlin's law as above whose spring shrinks with the contact patch while the contact is unloaded.

    As ``mindlin``, ``F = -k_t s - 2 z sqrt(k_t m*) v_s``, and where the patch radius falls from ``a'`` to ``a`` the spring is
    scaled by ``a / a'``, because the outer ring of the patch that opens lets go of its share. What it grows by in the step is
    scaled by half of that, as it comes while the patch shrinks; else the law would be first order in the time step.

    Source: Thornton, Cummins & Cleary 2013, https://doi.org/10.1016/j.powtec.2012.08.012.
    """
    vec3, vec4, real = precision.vec3, precision.vec4, precision.real
    mindlin = build_mindlin(precision, types)

    @wp.func
    def mindlin_rescaled(contact: types.contact, pair: types.pair, normal_force: real, memory: vec4):
        share = real(1.0)
        if contact.patch < memory[3]:
            share = contact.patch / memory[3]
        spring = vec3(memory[0], memory[1], memory[2]) * share
        spring -= contact.drift * (contact.span * real(0.5) * (real(1.0) - share))
        force, stretched = mindlin(contact, pair, normal_force, spring)
        return force, vec4(stretched[0], stretched[1], stretched[2], contact.patch)

    return mindlin_rescaled


def build_mindlin_rescaled_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the tangential spring, ``k_t s^2 / 2``."""
    vec3, vec4, real = precision.vec3, precision.vec4, precision.real
    mindlin_energy = build_mindlin_energy(precision, types)

    @wp.func
    def mindlin_rescaled_energy(contact: types.contact, pair: types.pair, memory: vec4) -> real:
        return mindlin_energy(contact, pair, vec3(memory[0], memory[1], memory[2]))

    return mindlin_rescaled_energy


def prepare_friction(pair: PairNumbers) -> dict[str, float]:
    """The Coulomb coefficient."""
    return {"friction": pair.given["friction"]}


def prepare_viscous(pair: PairNumbers) -> dict[str, float]:
    """Fields of the viscous law."""
    return prepare_friction(pair) | {"shear_viscosity": pair.given["shear_viscosity"]}


def prepare_mindlin(pair: PairNumbers) -> dict[str, float]:
    """Fields of Mindlin's law."""
    ratio = damping_ratio(pair.given["restitution"], exponent=1.5)
    return prepare_friction(pair) | {"shear": pair.shear, "shear_damping": 2.0 * ratio * np.sqrt(8.0 * pair.shear)}


_FRICTION = {"friction": "[1] Coulomb mu"}
_MINDLIN = _FRICTION | {
    "shear": "[Pa] G*: 1/G* = (2 - nu_a)/G_a + (2 - nu_b)/G_b",
    "shear_damping": "[sqrt(Pa)] 2 z sqrt(8 G*), z the damping ratio",
}

TANGENTIAL_LAWS = {
    "none": NONE,
    "viscous": Law(
        build_viscous,
        fields=_FRICTION | {"shear_viscosity": "[N s/m] g"},
        prepare=prepare_viscous,
        asks=("friction", "shear_viscosity"),
        rotation=True,
    ),
    "linear": Law(
        build_linear,
        build_linear_energy,
        fields=_FRICTION
        | {"shear_stiffness": "[N/m] k_s", "linear_shear_damping": "[sqrt(N/m)] 2 z sqrt(k_s), z the damping ratio"},
        prepare=prepare_linear,
        asks=("friction", "restitution", "shear_stiffness"),
        memory=VECTOR,
        rotation=True,
    ),
    "mindlin": Law(
        build_mindlin,
        build_mindlin_energy,
        fields=_MINDLIN,
        prepare=prepare_mindlin,
        asks=("friction", "restitution"),
        memory=VECTOR,
        rotation=True,
    ),
    "mindlin_rescaled": Law(
        build_mindlin_rescaled,
        build_mindlin_rescaled_energy,
        fields=_MINDLIN,
        prepare=prepare_mindlin,
        asks=("friction", "restitution"),
        memory=(*VECTOR, 1),
        rotation=True,
    ),
}
