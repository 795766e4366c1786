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
        one, quarter = wp.float64(1.0), square * wp.float64(0.25)
        sine = one - quarter * wp.float64(1.0 / 20.0) * (one - quarter * wp.float64(1.0 / 42.0))
        sine = wp.float64(0.5) * (one - quarter * wp.float64(1.0 / 6.0) * sine)
        cosine = one - quarter * wp.float64(1.0 / 12.0) * (one - quarter * wp.float64(1.0 / 30.0))
        cosine = one - quarter * wp.float64(0.5) * cosine
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
def ease_of(inertia: wp.vec3d) -> wp.vec3d:
    """How easily a body turns about its principal axes: the inverse of their moments of inertia [1/(kg m^2)]."""
    one = wp.float64(1.0)
    return wp.vec3d(one / inertia[0], one / inertia[1], one / inertia[2])


@wp.func
def rotate_freely(turn: wp.quatd, momentum: wp.vec3d, ease: wp.vec3d, dt: wp.float64) -> wp.quatd:
    """Orientation after a time, with the angular momentum L [kg m^2/s] fixed in the world frame; ``ease`` is from ``ease_of``.

    The kinetic energy is split into ``L^2 / 2 I_2``, which turns the body about L, and what the first and third axes differ from
    that, ``l_1^2/2 (1/I_1 - 1/I_2) + l_3^2/2 (1/I_3 - 1/I_2)``, which turns it about these axes. Each part is solved exactly, so
    the step is symplectic, time-reversible and of second order; |L| is kept to the bit and the energy does not drift.

    Source: splitting of Touma & Wisdom 1994, https://doi.org/10.1086/116931, as in Celledoni et al. 2008,
    https://doi.org/10.1088/1751-8113/41/4/045206.
    """
    half = wp.float64(0.5)
    first = (ease[0] - ease[1]) * dt
    third = (ease[2] - ease[1]) * dt
    turned = turn
    if first != wp.float64(0.0):
        turned = turned * turn_about(0, half * first * wp.quat_rotate_inv(turned, momentum)[0])
    if third != wp.float64(0.0):
        turned = turned * turn_about(2, third * wp.quat_rotate_inv(turned, momentum)[2])
    if first != wp.float64(0.0):
        turned = turned * turn_about(0, half * first * wp.quat_rotate_inv(turned, momentum)[0])
    turned = turn_by(momentum * (dt * ease[1])) * turned
    return wp.normalize(turned)


@wp.func
def spin_of(axes: wp.mat33d, momentum: wp.vec3d, ease: wp.vec3d) -> wp.vec3d:
    """Angular velocity [rad/s] in the world frame of a body whose principal axes are the columns of a matrix."""
    return axes * wp.cw_mul(wp.transpose(axes) * momentum, ease)


@wp.func
def mean_spin(before: wp.quatd, after: wp.quatd, dt: wp.float64) -> wp.vec3d:
    """Angular velocity [rad/s] between two orientations, world frame: ``x_2 - x_1 = dt w x (x_1 + x_2) / 2`` for all arms x.

    Cayley's form of a rotation. Of a body that is not round the angular momentum of the middle of a step with the axes of its end
    would be off by what the axes turn by in half a step.
    """
    by = after * wp.quat_inverse(before)
    scale = wp.float64(2.0) / (by[3] * dt)
    return wp.vec3d(by[0] * scale, by[1] * scale, by[2] * scale)
