"""Distances to several spheres at once, in the vector registers of a core, and what was found written down without a branch.

Spheres are taken in chunks that follow one another in memory. Branches here would depend on where sand happens to lie, which no
core can guess; measuring some distances in vain costs less.
"""

from functools import cache

import warp as wp

from sand_sim.precision import Precision

CHUNK = 8  # spheres at once where there are vector registers; few rows of three cells hold more

_FIND_NEAR = """
    using real = wp::float{bits};
    int near = 0;
#if defined(__clang__) && !defined(__CUDA_ARCH__)
#pragma clang loop vectorize(enable)
#endif
    for (int k = 0; k < {chunk}; ++k) {{
        const int at = base + k;
        const auto& there = place.data[at];
        const real x = real(here[0] - there[0]), y = real(here[1] - there[1]), z = real(here[2] - there[2]);
        const real reach = real(there[3] + allowed.data[at]) + gap;
        near |= (int)((x * x + y * y + z * z < reach * reach) & (at >= first) & (at < last)) << k;
    }}
    return near;
"""

_NOTE = """
    static const unsigned long long places[] = {{{places}}};
    for (int k = 0; k < {chunk}; ++k) hits.data[at + k] = base + (int)(places[near] >> 8 * k & 255);
"""


@cache
def build_find_near(precision: Precision, chunk: int) -> wp.Function:
    """Warp function that tells which of a chunk of spheres, from ``base`` on, are within reach and in a row, as bits."""
    real, whole, whole4 = precision.real, precision.whole, precision.whole4

    @wp.func_native(_FIND_NEAR.format(bits=32 if real is wp.float32 else 64, chunk=chunk))
    def find_near(
        place: wp.array(dtype=whole4),
        allowed: wp.array(dtype=whole),
        base: int,
        first: int,
        last: int,
        here: whole4,
        gap: real,
    ) -> int: ...

    return find_near


@cache
def build_note_hits(chunk: int) -> wp.Function:
    """Warp function that writes down which spheres of a chunk bits stand for, one after the other, and something behind them.

    It looks up the places of the bits, which spares branches that nobody can guess.
    """
    places = [sum(k << 8 * n for n, k in enumerate(k for k in range(chunk) if bits >> k & 1)) for bits in range(2**chunk)]

    @wp.func_native(_NOTE.format(places=", ".join(f"{one}ull" for one in places), chunk=chunk))
    def note_hits(hits: wp.array(dtype=int), at: int, base: int, near: int): ...

    return note_hits
