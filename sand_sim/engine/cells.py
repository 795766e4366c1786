"""The cell grid in which neighbours are found: one level of cells for each class of grain sizes.

The grid is laid anew at every search around the grains there are, so that it costs nothing where a domain is empty.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from sand_sim.engine.count import GROUP, Count, count_of, share_out, share_start
from sand_sim.engine.kernel import kernel
from sand_sim.engine.lattice import Lattice
from sand_sim.precision import Precision

_CELLS_PER_GRAIN = 4
_FEWEST_CELLS = 4096
_SIZE_CLASS = 2.0  # radii within a level differ by about this factor


@cache
def level_type(precision: Precision) -> type:
    """Warp struct of one level of cells."""
    real, whole = precision.real, precision.whole

    @wp.struct
    class Level:
        radius: whole  # [quantum] largest radius of the level's spheres
        across: real  # [quantum] widest gap across which one of them acts on a larger sphere, one of its own level or a surface
        reach: real  # [quantum] smallest allowed cell edge
        inverse_cell: real  # [1/quantum]
        fast: int  # the axis along which cells are numbered first, the shortest: neighbours lie near each other in memory
        middle: int
        slow: int  # the longest
        nx: int  # cells along these axes, in this order
        ny: int
        nz: int
        first_key: int  # key of the level's cell (0, 0, 0)

    return Level


@dataclass(frozen=True)
class Cells:
    """Levels from the finest to the coarsest.

    Attributes:
        levels: array of ``Level``, shape (levels,).
        low: lower corner of the grid, whole3, shape (1,) [quantum].
        corners: lower and upper corner of each share of the grains, then of each group of shares in the place of its first,
            whole3, shape (shares, 2) [quantum].
        bins: keys in use, one more than there are cells; retired grains get the last.
    """

    levels: wp.array
    low: wp.array
    corners: wp.array
    bins: Count


def prepare_cells(radii: np.ndarray, skin: float, reach: Callable[[float], float], lattice: Lattice, on) -> Cells:
    """Choose the levels for spheres of the given radii.

    A cell is at least as wide as the reach of its level's largest spheres, so that partners lie in the 27 cells around.

    Args:
        radii: radii of all spheres, shape (n,) [m].
        skin: how far two spheres may approach each other before they are sought again, at most [m].
        reach: widest gap across which spheres act, from the largest radius of the smaller one [m].
        lattice: the domain.
        on: the device, from ``device.open_device``.
    """
    largest = [float(radii.max())]
    while True:
        finer = radii[radii * _SIZE_CLASS < largest[-1] * (1.0 - 1e-6)]
        if not len(finer):
            break
        largest.append(float(finer.max()))
    level, whole3 = level_type(lattice.precision), lattice.precision.whole3
    levels = []
    for radius in reversed(largest):
        one = level()
        one.radius = int(lattice.to_whole_length(radius)) + 1
        one.across = reach(radius) / lattice.quantum
        one.reach = (2.0 * radius + skin + reach(radius)) / lattice.quantum * 1.001
        levels.append(one)
    return Cells(
        levels=wp.array(levels, dtype=level, device=on.name),
        low=wp.zeros(1, dtype=whole3, device=on.name),
        corners=wp.zeros((on.shares, 2), dtype=whole3, device=on.name),
        bins=Count(len(levels) * max(_FEWEST_CELLS, _CELLS_PER_GRAIN * len(radii)), on.lanes, on.name),
    )


@cache
def build_find_corners(precision: Precision) -> wp.Kernel:
    """Kernel for the bounding box of each share of the grains."""
    whole, whole3, whole4 = precision.whole, precision.whole3, precision.whole4

    @kernel
    def find_corners(
        lane: int, shares: int, spans: wp.array(dtype=int), place: wp.array(dtype=whole4), corners: wp.array2d(dtype=whole3)
    ):
        own = lane + wp.tid()
        grains = count_of(spans)
        far = whole(wp.static(2**precision.lattice_bits))
        low = whole3(far, far, far)
        high = -low
        for i in range(share_start(grains, own, shares), share_start(grains, own + 1, shares)):
            here = place[i]
            if here[3] > whole(0):
                at = whole3(here[0], here[1], here[2])
                low = wp.min(low, at)
                high = wp.max(high, at)
        corners[own, 0] = low
        corners[own, 1] = high

    return find_corners


@cache
def build_join_corners(precision: Precision) -> wp.Kernel:
    """Kernel for the bounding box of each group of shares."""
    whole3 = precision.whole3

    @kernel
    def join_corners(lane: int, shares: int, corners: wp.array2d(dtype=whole3)):
        first = wp.static(GROUP) * (lane + wp.tid())
        if first < shares:
            low = corners[first, 0]
            high = corners[first, 1]
            for one in range(first + 1, wp.min(first + wp.static(GROUP), shares)):
                low = wp.min(low, corners[one, 0])
                high = wp.max(high, corners[one, 1])
            corners[first, 0] = low
            corners[first, 1] = high

    return join_corners


@cache
def build_lay_cells(precision: Precision) -> wp.Kernel:
    """Kernel, one thread, that lays all levels over the bounding box; cells grow where they would outnumber their room."""
    real, vec3, whole3 = precision.real, precision.vec3, precision.whole3
    level = level_type(precision)

    @kernel
    def lay_cells(
        corners: wp.array2d(dtype=whole3),
        levels: wp.array(dtype=level),
        low: wp.array(dtype=whole3),
        bins: wp.array(dtype=int),
        room: int,
    ):
        lowest = corners[0, 0]
        highest = corners[0, 1]
        for group in range(wp.static(GROUP), corners.shape[0], wp.static(GROUP)):
            lowest = wp.min(lowest, corners[group, 0])
            highest = wp.max(highest, corners[group, 1])
        low[0] = lowest
        span = vec3(real(highest[0] - lowest[0]), real(highest[1] - lowest[1]), real(highest[2] - lowest[2]))
        fast = int(0)
        slow = int(0)
        for axis in range(1, 3):
            if span[axis] < span[fast]:
                fast = axis
            if span[axis] >= span[slow]:
                slow = axis
        middle = 3 - fast - slow
        span_x = wp.max(span[fast], real(0.0))
        span_y = wp.max(span[middle], real(0.0))
        span_z = wp.max(span[slow], real(0.0))
        share = real(room / levels.shape[0] - 1)
        key = int(0)
        for k in range(levels.shape[0]):
            one = levels[k]
            cell = one.reach
            number = (span_x / cell + real(1.0)) * (span_y / cell + real(1.0)) * (span_z / cell + real(1.0))
            while number > share:
                cell = cell * real(1.05)
                number = (span_x / cell + real(1.0)) * (span_y / cell + real(1.0)) * (span_z / cell + real(1.0))
            one.inverse_cell = real(1.0) / cell
            one.fast = fast
            one.middle = middle
            one.slow = slow
            one.nx = int(span_x / cell) + 1
            one.ny = int(span_y / cell) + 1
            one.nz = int(span_z / cell) + 1
            one.first_key = key
            levels[k] = one
            key += one.nx * one.ny * one.nz
        share_out(bins, key + 1)

    return lay_cells


@cache
def cell_functions(precision: Precision):
    """Warp functions ``level_of(levels, radius)`` and ``cell_of(level, low, place) -> vec3i``."""
    real, whole, whole3, whole4 = precision.real, precision.whole, precision.whole3, precision.whole4
    level = level_type(precision)

    @wp.func
    def level_of(levels: wp.array(dtype=level), radius: whole) -> int:
        found = int(0)
        while found < levels.shape[0] - 1 and radius > levels[found].radius:
            found += 1
        return found

    @wp.func
    def cell_of(one: level, low: whole3, place: whole4) -> wp.vec3i:
        x = int(real(place[one.fast] - low[one.fast]) * one.inverse_cell)
        y = int(real(place[one.middle] - low[one.middle]) * one.inverse_cell)
        z = int(real(place[one.slow] - low[one.slow]) * one.inverse_cell)
        return wp.vec3i(wp.min(x, one.nx - 1), wp.min(y, one.ny - 1), wp.min(z, one.nz - 1))

    return level_of, cell_of


@cache
def build_cell_keys(precision: Precision) -> wp.Kernel:
    """Kernel that gives each sphere the key of its cell; spheres of radius zero (retired) get the last."""
    whole, whole3, whole4 = precision.whole, precision.whole3, precision.whole4
    level = level_type(precision)
    level_of, cell_of = cell_functions(precision)

    @kernel
    def cell_keys(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        levels: wp.array(dtype=level),
        low: wp.array(dtype=whole3),
        bins: wp.array(dtype=int),
        keys: wp.array(dtype=int),
    ):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            here = place[i]
            if here[3] == whole(0):
                keys[i] = count_of(bins) - 1
            else:
                one = levels[level_of(levels, here[3])]
                cell = cell_of(one, low[0], here)
                keys[i] = one.first_key + (cell[2] * one.ny + cell[1]) * one.nx + cell[0]

    return cell_keys
