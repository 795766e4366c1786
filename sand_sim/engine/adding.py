"""Add many small gains to a large value without losing their digits."""

from functools import cache

import warp as wp

from sand_sim.precision import Precision


@cache
def build_add(precision: Precision) -> wp.Function:
    """Warp function ``(value, gain, carry) -> (sum, carry)``: the carry is what rounding took off the sum, for the next addition.

    A velocity of 1 m/s has steps of 6e-8 m/s in single precision, one of gravity in a microsecond adds 1e-5 m/s: rounded the same
    way each time, it would fall 0.3 % too fast or too slowly.

    Source: Kahan 1965, https://doi.org/10.1145/363707.363723.
    """
    vec3 = precision.vec3

    @wp.func
    def add(value: vec3, gain: vec3, carry: vec3):
        wanted = gain + carry
        total = value + wanted
        return total, wanted - (total - value)

    return add
