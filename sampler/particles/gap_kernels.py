"""Kernels that measure gaps between particles on a surface; lengths in units of the mesh's diagonal unless told otherwise."""

import warp as wp

from sampler.particles.cells import Cells, cell_at, row_of

MODULE = "sampler_spreading"

SAME = -0.2  # cosine between normals from which two places lie on one skin
_SEEN = 5.0e-5  # least width of a gap
_NARROW = 0.05  # gaps narrower than this count as closed, so that either skin's particles cover both; in spacings

# The way between places of a surface is straight on one skin, and where they look at each other across a narrow gap. Else it
# leads around the edge where their planes meet: unfolded, its square is ``|b|^2 + 2 (|p| + p c) / (1 - c^2)`` with ``b`` from one
# to the other, ``p = (b . up) (b . other)`` and ``c = up . other``. Between the two skins of a wall it is very far.
# Many particles are measured at once, in vectors and without branches, which would be guessed wrong.
_NEAREST = f"""
    const int most = 64;
    const float gap = {_NARROW}f * spacing;
    float straight[most], along[most];
    wp::vec_t<6, float> best = before;
    for (int start = begin; start < end; start += most) {{
        const int count = end - start < most ? end - start : most;
        float x[most], y[most], z[most], u[most], v[most], w[most];
        for (int i = 0; i < count; ++i) {{
            const int k = listed ? chosen[start + i] : start + i;
            const wp::vec3 p = points[k], n = normals[k];
            x[i] = p[0] - here[0]; y[i] = p[1] - here[1]; z[i] = p[2] - here[2];
            u[i] = n[0]; v[i] = n[1]; w[i] = n[2];
        }}
        const int full = (count + 7) & ~7;
        for (int i = count; i < full; ++i) {{
            x[i] = 1.0e3f; y[i] = z[i] = 0.0f;
            u[i] = v[i] = w[i] = 0.0f;
        }}
        #ifndef __CUDA_ARCH__
        _Pragma("clang loop vectorize(enable) interleave_count(1)")
        #endif
        for (int i = 0; i < full; ++i) {{
            const float square = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
            const float forth = x[i] * up[0] + y[i] * up[1] + z[i] * up[2], back = -x[i] * u[i] - y[i] * v[i] - z[i] * w[i];
            const float cosine = up[0] * u[i] + up[1] * v[i] + up[2] * w[i], turn = 1.0f - cosine * cosine;
            const float product = -forth * back, size = product < 0.0f ? -product : product;
            const float detour = turn < 1.0e-4f ? 1.0e6f : 2.0f * (size + product * cosine) / turn;
            const float less = forth < back ? forth : back, more = forth < back ? back : forth;
            const bool one = cosine > {SAME}f || (less > {_SEEN}f && more < gap);
            straight[i] = square;
            along[i] = square + (one ? 0.0f : detour);
        }}
        for (int kind = 0; kind < 2; ++kind) {{
            const float* way = kind ? along : straight;
            float nearest = best[3 * kind], next = best[3 * kind + 1], which = best[3 * kind + 2];
            for (int i = 0; i < count; ++i) {{
                if (way[i] <= nearest) {{
                    const int k = listed ? chosen[start + i] : start + i;
                    next = nearest < next ? nearest : next;
                    if (way[i] < nearest || k < which) which = k;  // of equals the first, as lists of a GPU are in any order
                    nearest = way[i];
                }} else if (way[i] < next) next = way[i];
            }}
            best[3 * kind] = nearest; best[3 * kind + 1] = next; best[3 * kind + 2] = which;
        }}
    }}
    return best;
"""
_Found = wp.types.vector(length=6, dtype=float)  # square of the way to the nearest, and to the next, its rank; along the surface


@wp.func_native(_NEAREST)
def nearest_of(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    chosen: wp.array(dtype=int),
    listed: bool,
    begin: int,
    end: int,
    here: wp.vec3,
    up: wp.vec3,
    spacing: float,
    before: _Found,
) -> _Found:
    """The nearest particles of those found before and of some ranks, from a list or themselves from a first to a last."""
    ...


@wp.struct
class Nearest:
    """A particle, how far it is, and how far the next one."""

    which: int
    way: float
    next: float


@wp.func
def nearest_particles(cells: Cells, here: wp.vec3, up: wp.vec3, spacing: float, most: float):
    """Particle nearest to a place, and the nearest one along the surface, in spacings; at most ``most``, the next at most 1."""
    far = most * most * spacing * spacing
    none = _Found(far, spacing * spacing, -1.0, far, spacing * spacing, -1.0)
    cell = cell_at(cells, here)
    number = row_of(cells, cell[1], cell[2]) + cell[0]
    begin = cells.near_begin[number]
    end = cells.near_begin[number + 1]
    best = nearest_of(cells.points, cells.normals, cells.near, True, begin, end, here, up, spacing, none)
    reach = spacing
    while best[3] > reach * reach and reach < most * spacing:  # next to never
        reach = wp.min(2.0 * reach, most * spacing)
        best = none
        low = cell_at(cells, here - wp.vec3(reach))
        high = cell_at(cells, here + wp.vec3(reach))
        for z in range(low[2], high[2] + 1):
            for y in range(low[1], high[1] + 1):
                row = row_of(cells, y, z)
                begin = cells.begin[row + low[0]]
                end = cells.begin[row + high[0] + 1]
                best = nearest_of(cells.points, cells.normals, cells.near, False, begin, end, here, up, spacing, best)
    closest = in_spacings(cells, best[2], best[0], best[1], spacing)
    return closest, in_spacings(cells, best[5], best[3], best[4], spacing)


@wp.func
def in_spacings(cells: Cells, rank: float, way: float, next: float, spacing: float) -> Nearest:
    """A particle by its number, and ways in spacings from their squares."""
    which = int(rank)
    if which >= 0:
        which = cells.which[which]
    return Nearest(which, wp.sqrt(way) / spacing, wp.sqrt(next) / spacing)


@wp.kernel(enable_backward=False, module=MODULE)
def find_gaps(
    cells: Cells,
    places: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    spacing: float,
    most: float,
    first: int,
    found: wp.array(dtype=Nearest),
    found_along: wp.array(dtype=Nearest),
):
    """Particle nearest to each place, and the nearest one along the surface."""
    i = first + wp.tid()
    closest, own = nearest_particles(cells, places[i], normals[i], spacing, most)
    found[i] = closest
    found_along[i] = own


@wp.kernel(enable_backward=False, module=MODULE)
def find_neighbours(cells: Cells, spacing: float, most: float, first: int, distance: wp.array(dtype=float)):
    """Distance of each particle from the nearest other one, in spacings; at most ``most``."""
    i = first + wp.tid()
    here = cells.points[i]
    farthest = most * spacing
    best = farthest
    reach = float(0.0)
    while best > reach and reach < farthest:
        reach = wp.min(wp.max(2.0 * reach, spacing), farthest)
        low = cell_at(cells, here - wp.vec3(reach))
        high = cell_at(cells, here + wp.vec3(reach))
        for z in range(low[2], high[2] + 1):
            for y in range(low[1], high[1] + 1):
                row = row_of(cells, y, z)
                for k in range(cells.begin[row + low[0]], cells.begin[row + high[0] + 1]):
                    if k != i:
                        best = wp.min(best, wp.length(cells.points[k] - here))
    distance[cells.which[i]] = best / spacing
