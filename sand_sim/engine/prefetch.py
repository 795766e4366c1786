"""Have a core fetch from memory what it will read a little later, where it cannot guess that by itself."""

from functools import cache

import warp as wp

from sand_sim.engine.recipe import Recipe

_FETCH = """
#if !defined(__CUDA_ARCH__)
    __builtin_prefetch(values.data + at);
#endif
"""


@cache
def build_prefetch(dtype: type) -> wp.Function:
    """Warp function ``(values, at)`` that fetches one item of an array."""

    @wp.func_native(_FETCH)
    def fetch(values: wp.array(dtype=dtype), at: int): ...

    return fetch


@cache
def build_fetch_grain(recipe: Recipe) -> wp.Function:
    """Warp function that fetches what forces read of a grain. It does nothing on a GPU, where other threads work meanwhile."""
    precision, rotation, halves = recipe.precision, recipe.rotation, recipe.halves
    vec3, vec4, whole4 = precision.vec3, precision.vec4, precision.whole4
    fetch_place, fetch4, fetch3 = (build_prefetch(dtype) for dtype in (whole4, vec4, vec3))

    @wp.func
    def fetch_grain(
        grain: int,
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        half_spin: wp.array(dtype=vec3),
    ):
        fetch_place(place, grain)
        fetch4(motion, grain)
        if wp.static(rotation):
            fetch4(spin, grain)
        if wp.static(halves):
            fetch3(half_motion, grain)
            fetch3(half_spin, grain)

    return fetch_grain
