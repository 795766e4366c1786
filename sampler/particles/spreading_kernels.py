"""Kernels that move particles over a surface; lengths in units of the mesh's diagonal."""

from math import exp

import warp as wp

from sampler.geometry.closest import closest_point
from sampler.geometry.surface import ASIDE, nearest_face
from sampler.particles.cells import Cells, cell_at, row_of
from sampler.particles.gap_kernels import MODULE, SAME

_OTHER = -0.7  # between normals below which two places lie on different skins
_THROWN = wp.constant(0.85)  # how near to each other particles of different skins may be thrown, of those on one skin
_CORE, _HARD = 8.0, 1.25  # what holds particles apart: strength, and range, of how far they were thrown
_SIDE = 0.6  # by how much weaker particles push on the other skin of a wall, so that neighbours change sides
_BACK = 0.33  # strength of points beyond a rim
_LEVEL = 0.3  # how far out of the plane of another they may lie to push it, in spacings
_FARTHEST = wp.constant(0.3)  # of a step, in spacings


@wp.func
def same_skin(a: wp.vec3, b: wp.vec3) -> float:
    """1 for places on one skin, 0 for the two skins of a wall, smooth between."""
    share = wp.clamp((wp.dot(a, b) - wp.static(_OTHER)) / wp.static(SAME - _OTHER), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


# Particles near by are gathered from their rows, then all of them push at once, in vectors: three times as fast as one by one.
_PUSH = f"""
    const int most = 64;
    const float shape = 2.0f / (256.0f * spacing * spacing), hard = {_HARD}f * apart;
    float x[most], y[most], z[most], u[most], v[most], w[most];
    float sum[3] = {{0.0f, 0.0f, 0.0f}};
    int count = 0;
    for (int k = low[2]; k <= high[2]; ++k) for (int j = low[1]; j <= high[1]; ++j) {{
        const int row = (k * size[1] + j) * size[0], end = begin[row + high[0] + 1];
        const bool last = k == high[2] && j == high[1];
        for (int i = begin[row + low[0]]; i < end || (last && count);) {{
            for (; i < end && count < most; ++i, ++count) {{
                const wp::vec3 p = points[i], n = normals[i];
                x[count] = here[0] - p[0]; y[count] = here[1] - p[1]; z[count] = here[2] - p[2];
                u[count] = n[0]; v[count] = n[1]; w[count] = n[2];
            }}
            if (count < most && !last) break;
            const int full = (count + 7) & ~7;
            for (int c = count; c < full; ++c) x[c] = y[c] = z[c] = u[c] = v[c] = w[c] = 0.0f;
            #ifndef __CUDA_ARCH__
            _Pragma("clang loop vectorize(enable) interleave_count(1)")
            #endif
            for (int c = 0; c < full; ++c) {{
                const float square = x[c] * x[c] + y[c] * y[c] + z[c] * z[c], way = sqrtf(square);
                float near = 1.0f - shape * square;  // and to the power of 256: a Gaussian without an exponential
                near *= near; near *= near; near *= near; near *= near; near *= near; near *= near; near *= near; near *= near;
                near = near > {exp(-8.0)}f ? near - {exp(-8.0)}f : 0.0f;
                const float cosine = up[0] * u[c] + up[1] * v[c] + up[2] * w[c];
                const float along = (cosine - {_OTHER}f) / ({SAME}f - {_OTHER}f);
                const float share = along < 0.0f ? 0.0f : (along > 1.0f ? 1.0f : along);
                const float soft = near * (1.0f - {_SIDE}f * (1.0f - share * share * (3.0f - 2.0f * share)));
                const float core = {_CORE}f / spacing * (hard - way);
                const float out = up[0] * x[c] + up[1] * y[c] + up[2] * z[c];
                const float level = out * out < {_LEVEL * _LEVEL}f * spacing * spacing ? {_BACK}f * soft : 0.0f;
                const bool beyond = u[c] == 0.0f && v[c] == 0.0f && w[c] == 0.0f;
                const float push = beyond ? level : soft + (core > 0.0f ? core : 0.0f);
                const float least = 1.0e-3f * spacing, weight = push / (way > least ? way : least);
                sum[0] += weight * x[c]; sum[1] += weight * y[c]; sum[2] += weight * z[c];
            }}
            count = 0;
        }}
    }}
    return wp::vec3(sum[0], sum[1], sum[2]);
"""


@wp.func_native(_PUSH)
def push_on(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    begin: wp.array(dtype=int),
    size: wp.vec3i,
    low: wp.vec3i,
    high: wp.vec3i,
    here: wp.vec3,
    up: wp.vec3,
    spacing: float,
    apart: float,
) -> wp.vec3:
    """Push of the particles in some cells on one with a normal; without a unit.

    A Gaussian that has faded at two spacings (source document A).
    """
    ...


@wp.kernel(enable_backward=False, module=MODULE)
def push_apart(
    cells: Cells,
    mesh: wp.uint64,
    corners: wp.array(dtype=wp.vec3),
    face_normals: wp.array(dtype=wp.vec3),
    held: wp.array(dtype=int),
    spacing: float,
    apart: float,
    strength: float,
    first: int,
    moved: wp.array(dtype=wp.vec3),
    moved_normals: wp.array(dtype=wp.vec3),
):
    """Push each point away from its neighbours, also through a wall, and bring it back to the surface.

    Points that are held stay; those beyond the rim of a sheet, which have no normal, push what lies in about one plane with them.
    """
    rank = first + wp.tid()
    i = cells.which[rank]
    here = cells.points[rank]
    up = cells.normals[rank]
    moved[i] = here
    moved_normals[i] = up
    if held[i] == 1:
        return
    low = cell_at(cells, here - wp.vec3(2.0 * spacing))
    high = cell_at(cells, here + wp.vec3(2.0 * spacing))
    step = strength * push_on(cells.points, cells.normals, cells.begin, cells.size, low, high, here, up, spacing, apart)
    step *= wp.min(1.0, _FARTHEST * spacing / wp.max(wp.length(step), 1.0e-12))
    there = here + step
    face = nearest_face(mesh, there, 1.01 * wp.length(step) + 1.0e-3 * spacing, up, ASIDE)
    if face >= 0:
        moved[i] = closest_point(corners[3 * face], corners[3 * face + 1], corners[3 * face + 2], there)
        moved_normals[i] = face_normals[face]


@wp.kernel(enable_backward=False, module=MODULE)
def throw_darts(
    cells: Cells,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    apart: float,
    wanted: int,
    last: wp.array(dtype=int),
    before: wp.array(dtype=int),
    kept: wp.array(dtype=int),
):
    """Keep points one after another if none kept lies nearer than ``apart`` on the same skin; one thread.

    ``last`` is the point kept last in each cell, and ``before`` the one kept there before each; -1 for none.
    """
    number = int(0)
    for i in range(points.shape[0]):
        if number < wanted:
            here = points[i]
            free = int(1)
            low = cell_at(cells, here - wp.vec3(apart))
            high = cell_at(cells, here + wp.vec3(apart))
            for z in range(low[2], high[2] + 1):
                for y in range(low[1], high[1] + 1):
                    for x in range(low[0], high[0] + 1):
                        j = last[row_of(cells, y, z) + x]
                        while j >= 0 and free == 1:
                            distance = wp.length(points[j] - here)
                            if distance < apart:
                                same = same_skin(normals[i], normals[j])
                                if distance < apart * (_THROWN + (1.0 - _THROWN) * same):
                                    free = 0
                            j = before[j]
            if free == 1:
                at = cell_at(cells, here)
                cell = row_of(cells, at[1], at[2]) + at[0]
                before[i] = last[cell]
                last[cell] = i
                kept[i] = 1
                number += 1
