"""Particles sorted into the cells of a grid, so that those near a place are found fast; lengths in the unit of the points.

Warp has a hash grid, which divides for every cell it visits. Here a row of cells is one stretch of memory, and where places are
asked again and again each cell has a list of all particles near it.
"""

import math
from functools import partial

import numpy as np
import warp as wp

_MOST = 16, 100_000  # cells per particle, or at least so many; particles that are scattered more widely get wider cells


@wp.struct
class Cells:
    """Particles in the order of their cells, of which those along x follow one another.

    Attributes:
        low: corner of the grid.
        per: cells per unit.
        size: cells along each axis.
        begin: rank of the first particle of each cell, and after the last one their number.
        which: numbers of the particles, by rank.
        points, normals: the particles, by rank.
        near_begin, near: for each cell where its list of the ranks of particles near it begins; the lists.
    """

    low: wp.vec3
    per: float
    size: wp.vec3i
    begin: wp.array(dtype=int)
    which: wp.array(dtype=int)
    points: wp.array(dtype=wp.vec3)
    normals: wp.array(dtype=wp.vec3)
    near_begin: wp.array(dtype=int)
    near: wp.array(dtype=int)


@wp.func
def cell_at(cells: Cells, place: wp.vec3) -> wp.vec3i:
    """Cell of a place; of places outside of the grid the nearest one."""
    at = (place - cells.low) * cells.per
    x = wp.clamp(int(at[0]), 0, cells.size[0] - 1)
    y = wp.clamp(int(at[1]), 0, cells.size[1] - 1)
    return wp.vec3i(x, y, wp.clamp(int(at[2]), 0, cells.size[2] - 1))


@wp.func
def row_of(cells: Cells, y: int, z: int) -> int:
    """Number of the first cell of a row."""
    return (z * cells.size[1] + y) * cells.size[0]


@wp.kernel(enable_backward=False, module="sampler_cells")
def list_near(cells: Cells, reach: float, cursor: wp.array(dtype=int), near: wp.array(dtype=int)):
    """Put each particle down in the lists of all cells within reach; where there are no lists yet count only.

    Lists are in the order of the ranks on a CPU, in any order on a GPU.
    """
    rank = wp.tid()
    here = cells.points[rank]
    low = cell_at(cells, here - wp.vec3(reach))
    high = cell_at(cells, here + wp.vec3(reach))
    for z in range(low[2], high[2] + 1):
        for y in range(low[1], high[1] + 1):
            for x in range(low[0], high[0] + 1):
                corner = cells.low + wp.vec3(float(x), float(y), float(z)) / cells.per
                below = corner - here
                above = -below - wp.vec3(1.0 / cells.per)
                if wp.length_sq(wp.max(wp.max(below, above), wp.vec3(0.0))) <= 1.001 * reach * reach:
                    slot = wp.atomic_add(cursor, row_of(cells, y, z) + x, 1)
                    if near.shape[0] > 0:
                        near[slot] = rank


def empty_cells(points: np.ndarray, width: float) -> Cells:
    """Cells at least so wide around points, shape (n, 3) float32, with nothing in them."""
    columns = np.ascontiguousarray(points.T)  # NumPy is slow along an axis of three
    low, extent = columns.min(axis=1), np.ptp(columns, axis=1).astype(float)
    most, size = max(_MOST[0] * len(points), _MOST[1]), extent // width + 1.0
    while size.prod() > most:
        width *= 1.1 * (size.prod() / most) ** (1.0 / 3.0)
        size = extent // width + 1.0
    cells = Cells()
    cells.low, cells.per, cells.size = wp.vec3(low), 1.0 / width, wp.vec3i(size.astype(int))
    return cells


def sort_into_cells(points: np.ndarray, normals: np.ndarray, width: float, device: str) -> Cells:
    """Sort particles, shape (n, 3) float32, with their normals, shape (n, 3), into cells at least so wide."""
    cells = empty_cells(points, width)
    cell = cell_numbers(cells, points)
    order = np.argsort(cell, kind="stable")
    cells.begin = _integers(_ends(np.bincount(cell, minlength=math.prod(cells.size))), device)
    cells.which = _integers(order, device)
    cells.points, cells.normals = (wp.array(x[order].astype(np.float32), dtype=wp.vec3, device=device) for x in (points, normals))
    return cells


def cell_numbers(cells: Cells, points: np.ndarray) -> np.ndarray:
    """Number of the cell of each point, shape (n, 3) float32, outside of the grid that of the nearest one; shape (n,)."""
    number = np.zeros(len(points), np.int64)
    for axis in (2, 1, 0):
        at = ((points[:, axis] - np.float32(cells.low[axis])) * np.float32(cells.per)).astype(np.int64)
        number = number * cells.size[axis] + np.clip(at, 0, cells.size[axis] - 1)
    return number


def cells_around(cells: Cells, points: np.ndarray, reach: float) -> np.ndarray:
    """Whether each cell may hold places within reach of any of the points, shape (n, 3); shape (number of cells,)."""
    around = np.zeros(tuple(cells.size)[::-1], bool)
    around.reshape(-1)[cell_numbers(cells, points)] = True
    for axis in range(3):
        once = around.copy()
        for step in range(1, math.ceil(reach * cells.per) + 1):
            ahead, behind = (np.moveaxis(x, axis, 0) for x in (around, once))
            ahead[step:] |= behind[:-step]
            ahead[:-step] |= behind[step:]
    return around.reshape(-1)


def add_lists(cells: Cells, reach: float, device: str) -> None:
    """Give each cell a list of the particles within reach of it."""
    cursor = wp.zeros(len(cells.begin) - 1, dtype=int, device=device)
    launch = partial(wp.launch, list_near, len(cells.points), device=device)  # on one core, whose sums are not atomic
    launch(inputs=[cells, reach, cursor, wp.empty(0, dtype=int, device=device)])
    begin = _ends(cursor.numpy())
    cells.near_begin, cursor = _integers(begin, device), _integers(begin, device)
    cells.near = wp.empty(int(begin[-1]), dtype=int, device=device)
    launch(inputs=[cells, reach, cursor, cells.near])


def _ends(numbers: np.ndarray) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(numbers)])


def _integers(values: np.ndarray, device: str) -> wp.array:
    return wp.array(values.astype(np.int32), dtype=int, device=device)
