"""Rolling and twisting resistance.

Rolling: ``(contact, pair, normal_force, memory) -> (moment [N m], memory)``, twisting the same; the moment acts on body a,
its opposite on body b. Rolling resists the part of the relative angular velocity in the tangent plane, twisting the part along
the normal.
"""

import warp as wp

from sand_sim.contact.contact import ContactTypes
from sand_sim.contact.law import NONE, VECTOR, Law, PairNumbers
from sand_sim.contact.tangential import TANGENTIAL_LAWS, build_bounded, build_turned
from sand_sim.precision import Precision

ROLLING_DAMPING = 0.3  # share of critical in the spring-dashpot law


def build_constant(precision: Precision, types: ContactTypes) -> wp.Function:
    """Constant rolling torque against the rolling motion.

    ``M = -mu_r R F_n w / |w|`` with w the relative angular velocity in the tangent plane, R being R* of two grains, and the
    radius of one on a surface, also on one of particles. It stops rolling grains; grains at rest rattle under it, because its
    sign follows the smallest motion, and on a slope creep down by about ``g dt``.

    Source: Zhou et al. 1999, https://doi.org/10.1016/S0378-4371(99)00183-1; model A of Ai et al. 2011,
    https://doi.org/10.1016/j.powtec.2010.09.030.
    """
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def constant(contact: types.contact, pair: types.pair, normal_force: real, memory: vec3):
        rolling = contact.turning - contact.normal * wp.dot(contact.turning, contact.normal)
        rate = wp.length(rolling)
        torque = real(0.0)
        if rate > real(0.0):
            torque = -pair.rolling_friction * contact.lever * normal_force / rate
        return rolling * torque, memory

    return constant


def build_spring(precision: Precision, types: ContactTypes) -> wp.Function:
    """Elastic-plastic spring-dashpot against rolling (EPSD).

    ``M = -k_r p - c_r w`` with the rolled angle p, ``k_r = 2.25 S (mu_r R)^2`` (S = 2 E* a the normal tangent stiffness, R as in
    the constant law), c_r a fixed share of critical, and ``|M| <= mu_r R F_n``. A sphere rests up to ``tan(slope) = mu_r``.

    Source: model C of Ai et al. 2011, https://doi.org/10.1016/j.powtec.2010.09.030, after Iwashita & Oda 1998.
    """
    real, vec3, damping = precision.real, precision.vec3, ROLLING_DAMPING
    bounded, turned = build_bounded(precision), build_turned(precision)

    @wp.func
    def spring(contact: types.contact, pair: types.pair, normal_force: real, memory: vec3):
        rolling = contact.turning - contact.normal * wp.dot(contact.turning, contact.normal)
        # Moments over the arm, because squares of moments of grains below a micrometre are zero in single precision.
        arm = pair.rolling_friction * contact.lever
        line = real(2.25) * pair.rolling_young * contact.patch
        # 7/5 m r^2 is the inertia of a sphere about its contact point.
        critical = real(2.0) * wp.max(contact.least, contact.lever) * wp.sqrt(line * (real(7.0) / real(5.0) * contact.mass))
        viscous = rolling * (real(wp.static(damping)) * critical)
        over = contact.roll - contact.normal * wp.dot(contact.roll, contact.normal)
        rolled = turned(memory, contact.normal) + over * contact.span
        force, held = bounded(rolled, viscous, line * arm, normal_force)
        return force * arm, held

    return spring


def build_spring_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the rolling spring, ``k_r p^2 / 2``."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def spring_energy(contact: types.contact, pair: types.pair, rolled: vec3) -> real:
        arm = pair.rolling_friction * contact.lever
        return real(1.125) * arm * arm * pair.rolling_young * contact.patch * wp.dot(rolled, rolled)

    return spring_energy


def prepare_constant(pair: PairNumbers) -> dict[str, float]:
    """Fields of the constant torque."""
    return {"rolling_friction": pair.given["rolling_friction"]}


def prepare_spring(pair: PairNumbers) -> dict[str, float]:
    """Fields of the rolling spring."""
    return prepare_constant(pair) | {"rolling_young": 2.0 * pair.young}


def build_marshall(precision: Precision, types: ContactTypes) -> wp.Function:
    """Twisting friction of a Hertz-Mindlin contact: the tangential law integrated over the patch.

    ``M = -(k_t a^2 / 2) q - (c_t a^2 / 2) w_n`` with the twisted angle q, ``k_t = 8 G* a``, and ``|M| <= 2/3 a mu F_n``; it
    has no numbers of its own.

    Source: Marshall 2009, https://doi.org/10.1016/j.jcp.2008.10.020.
    """
    real = precision.real

    @wp.func
    def marshall(contact: types.contact, pair: types.pair, normal_force: real, twisted: real):
        rate = wp.dot(contact.turning, contact.normal)
        half = real(0.5) * contact.patch * contact.patch
        stiffness = real(8.0) * pair.shear * contact.patch * half
        viscous = pair.shear_damping * contact.inertia * half * rate
        angle = twisted + wp.dot(contact.roll, contact.normal) * contact.span
        bound = real(2.0) / real(3.0) * contact.patch * pair.friction * normal_force
        if stiffness * wp.abs(angle) > bound:
            angle = wp.sign(angle) * bound / stiffness
        return contact.normal * wp.clamp(-stiffness * angle - viscous, -bound, bound), angle

    return marshall


def build_marshall_energy(precision: Precision, types: ContactTypes) -> wp.Function:
    """Energy of the twisting spring, ``k_t a^2 q^2 / 4``."""
    real = precision.real

    @wp.func
    def marshall_energy(contact: types.contact, pair: types.pair, twisted: real) -> real:
        return real(2.0) * pair.shear * contact.patch * contact.patch * contact.patch * twisted * twisted

    return marshall_energy


ROLLING_LAWS = {
    "none": NONE,
    "constant": Law(
        build_constant,
        fields={"rolling_friction": "[1] mu_r"},
        prepare=prepare_constant,
        asks=("rolling_friction",),
        rotation=True,
    ),
    "spring": Law(
        build_spring,
        build_spring_energy,
        fields={"rolling_friction": "[1] mu_r", "rolling_young": "[Pa] 2 E*"},
        prepare=prepare_spring,
        asks=("rolling_friction",),
        memory=VECTOR,
        rotation=True,
    ),
}

TWISTING_LAWS = {
    "none": NONE,
    "marshall": Law(
        build_marshall,
        build_marshall_energy,
        fields=TANGENTIAL_LAWS["mindlin"].fields,
        prepare=TANGENTIAL_LAWS["mindlin"].prepare,
        asks=TANGENTIAL_LAWS["mindlin"].asks,
        memory=(1,),
        rotation=True,
    ),
}
