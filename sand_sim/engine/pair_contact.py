"""Two grains seen as a contact."""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_drifting, build_meeting
from sand_sim.engine.recipe import Recipe
from sand_sim.precision import Precision


@cache
def build_direction(precision: Precision) -> wp.Function:
    """Warp function ``vector from b to a -> (normal, distance)``; coinciding centres part upwards."""
    real, vec3 = precision.real, precision.vec3

    @wp.func
    def direction(apart: vec3):
        distance = wp.length(apart)
        there = distance > real(0.0)
        x = wp.where(there, apart[0] / distance, real(0.0))
        y = wp.where(there, apart[1] / distance, real(0.0))
        z = wp.where(there, apart[2] / distance, real(1.0))
        return vec3(x, y, z), distance

    return direction


@cache
def build_excess(precision: Precision) -> wp.Function:
    """Warp function ``(x_a - x_b, r_a + r_b) -> (r_a + r_b)^2 - |x_a - x_b|^2`` [quantum^2], positive where spheres touch.

    In single precision the lattice allows it to be computed exactly in 64-bit whole numbers, so that an overlap of a millionth of
    the radius still has seven digits; the difference of two rounded distances would have one.
    """
    real, whole, whole3, exact = precision.real, precision.whole, precision.whole3, precision.whole is wp.int32

    @wp.func
    def excess(apart: whole3, reach: whole) -> real:
        result = real(0.0)
        if wp.static(exact):
            x = wp.int64(apart[0])
            y = wp.int64(apart[1])
            z = wp.int64(apart[2])
            span = wp.int64(reach)
            result = real(span * span - x * x - y * y - z * z)
        else:
            u = real(apart[0])
            v = real(apart[1])
            w = real(apart[2])
            far = real(reach)
            result = far * far - u * u - v * v - w * w
        return result

    return excess


@cache
def build_pair_contact(recipe: Recipe) -> wp.Function:
    """Warp function that makes a ``Contact`` of two grains, and half the overlap [m] by which their arms are shorter.

    It is given the excess, where a is from b and both radii [quantum], the velocity of a relative to b and both spins now and,
    named past, over the last step, both masses, the quantum [m] and the step [s]. Where none are kept for the last step, those of
    now are.
    """
    precision, rotation = recipe.precision, recipe.rotation
    real, vec3, whole, whole3 = precision.real, precision.vec3, precision.whole, precision.whole3
    direction, meeting = build_direction(precision), build_meeting(precision)
    drifting, springs, halves = build_drifting(precision), recipe.springs, recipe.halves

    @wp.func
    def pair_contact(
        excess: real,
        apart: whole3,
        size_a: whole,
        size_b: whole,
        velocity: vec3,
        spin_a: vec3,
        spin_b: vec3,
        past: vec3,
        past_a: vec3,
        past_b: vec3,
        mass_a: real,
        mass_b: real,
        quantum: real,
        dt: real,
    ):
        span = real(size_a + size_b)
        normal, distance = direction(vec3(real(apart[0]), real(apart[1]), real(apart[2])))
        overlap = excess / (span + distance) * quantum
        radius_a = real(size_a) * quantum
        radius_b = real(size_b) * quantum
        half = real(0.5) * overlap
        slip = velocity
        if wp.static(rotation):
            slip -= wp.cross(spin_a * (radius_a - half) + spin_b * (radius_b - half), normal)
        radius = radius_a * radius_b / (span * quantum)
        mass = mass_a * mass_b / (mass_a + mass_b)
        met = meeting(normal, overlap, slip, spin_a - spin_b, radius, wp.min(radius_a, radius_b), radius, mass)
        if wp.static(springs):
            if wp.static(not halves):
                past = velocity
                past_a = spin_a
                past_b = spin_b
            lag = (past - normal * wp.dot(past, normal)) * (real(0.5) * dt / (radius_a + radius_b))
            drift = past - wp.cross(past_a * (radius_a - half) + past_b * (radius_b - half), normal - lag)
            met = drifting(met, drift, past_a - past_b, lag)
        return met, half

    return pair_contact
