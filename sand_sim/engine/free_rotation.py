"""Rotation of a rigid body without torque, so that it neither gains energy nor drifts."""

import warp as wp

_SMALL = 0.01  # square of an angle below which series are exact to rounding


@wp.func
def turn_by(vector: wp.vec3d) -> wp.quatd:
    """Rotation about a vector by its length [rad]."""
    square = wp.dot(vector, vector)
    sine = wp.float64(0.0)
    cosine = wp.float64(1.0)
    if square < wp.float64(wp.static(_SMALL)):
        # sin(a/2)/a and cos(a/2) up to a^6
        one, quarter = wp.float64(1.0), square / wp.float64(4.0)
        sine = one - quarter / wp.float64(6.0) * (one - quarter / wp.float64(20.0) * (one - quarter / wp.float64(42.0)))
        sine = sine / wp.float64(2.0)
        cosine = one - quarter / wp.float64(2.0) * (one - quarter / wp.float64(12.0) * (one - quarter / wp.float64(30.0)))
    else:
        angle = wp.sqrt(square)
        sine = wp.sin(angle / wp.float64(2.0)) / angle
        cosine = wp.cos(angle / wp.float64(2.0))
    return wp.quatd(vector[0] * sine, vector[1] * sine, vector[2] * sine, cosine)


@wp.func
def turn_about(axis: int, angle: wp.float64) -> wp.quatd:
    """Rotation about an axis of the frame."""
    vector = wp.vec3d(wp.float64(0.0))
    vector[axis] = angle
    return turn_by(vector)


@wp.func
def rotate_freely(turn: wp.quatd, momentum: wp.vec3d, inertia: wp.vec3d, dt: wp.float64) -> wp.quatd:
    """Orientation after a time, with the angular momentum L [kg m^2/s] fixed in the world frame.

    The kinetic energy is split into ``L^2 / 2 I_2``, which turns the body about L, and what the first and third axes differ from
    that, ``l_1^2/2 (1/I_1 - 1/I_2) + l_3^2/2 (1/I_3 - 1/I_2)``, which turns it about these axes. Each part is solved exactly, so
    the step is symplectic, time-reversible and of second order; |L| is kept to the bit and the energy does not drift.

    Source: splitting of Touma & Wisdom 1994, https://doi.org/10.1086/116931, as in Celledoni et al. 2008,
    https://doi.org/10.1088/1751-8113/41/4/045206.
    """
    one, half = wp.float64(1.0), wp.float64(0.5)
    first = (one / inertia[0] - one / inertia[1]) * dt
    third = (one / inertia[2] - one / inertia[1]) * dt
    turned = turn
    if first != wp.float64(0.0):
        turned = turned * turn_about(0, half * first * wp.quat_rotate_inv(turned, momentum)[0])
    if third != wp.float64(0.0):
        turned = turned * turn_about(2, third * wp.quat_rotate_inv(turned, momentum)[2])
    if first != wp.float64(0.0):
        turned = turned * turn_about(0, half * first * wp.quat_rotate_inv(turned, momentum)[0])
    turned = turn_by(momentum * (dt / inertia[1])) * turned
    return wp.normalize(turned)


@wp.func
def spin_of(turn: wp.quatd, momentum: wp.vec3d, inertia: wp.vec3d) -> wp.vec3d:
    """Angular velocity [rad/s] in the world frame."""
    local = wp.quat_rotate_inv(turn, momentum)
    return wp.quat_rotate(turn, wp.vec3d(local[0] / inertia[0], local[1] / inertia[1], local[2] / inertia[2]))
