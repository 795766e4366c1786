"""Add many small gains to a large value without losing their digits."""

from functools import cache

import warp as wp

from sand_sim.engine.recipe import Recipe


@cache
def build_add(recipe: Recipe) -> wp.Function:
    """Warp function ``(value, gain, carries, item) -> sum``; carries keep what rounding takes off, if the recipe asks.

    A velocity of 1 m/s has steps of 6e-8 m/s in single precision, one of gravity in a microsecond adds 1e-5 m/s: rounded the same
    way each time, it would fall 0.3 % too fast or too slowly.

    Source: Kahan 1965, https://doi.org/10.1145/363707.363723.
    """
    vec3, carry = recipe.precision.vec3, recipe.carry

    @wp.func
    def add(value: vec3, gain: vec3, carries: wp.array(dtype=vec3), item: int) -> vec3:
        wanted = gain
        if wp.static(carry):
            wanted = gain + carries[item]
        total = value + wanted
        if wp.static(carry):
            carries[item] = wanted - (total - value)
        return total

    return add
