"""Height of the bed over a level grid: what excavation planners read."""

from math import ceil

import numpy as np

from sand_sim.border import GrainCloud, HeightMap

_AT_ONCE = 1 << 20  # cells that spheres may cover in one go, which bounds the memory


def footprint_grid(low: np.ndarray, high: np.ndarray, cell: float) -> tuple[np.ndarray, tuple[int, int]]:
    """Grid of whole cells over a rectangle, to a thousandth of a cell, and around the same middle.

    Args:
        low: corner of the rectangle, x and y first, shape (2,) or (3,) [m].
        high: the opposite corner.
        cell: edge of a cell [m].

    Returns:
        Lower corner of the grid, shape (2,) [m], and its rows (along y) and columns (along x).

    Raises:
        ValueError: if the cell is not positive.
    """
    if not cell > 0.0:
        raise ValueError(f"cell: must be positive, not {cell}")
    low, high = np.asarray(low, float)[:2], np.asarray(high, float)[:2]
    columns, rows = (max(1, ceil(edge / cell - 1e-3)) for edge in high - low)
    return 0.5 * (low + high) - 0.5 * cell * np.array([columns, rows]), (rows, columns)


def bed_grid(scene, cloud: GrainCloud, cell: float | None = None) -> tuple[np.ndarray, float, tuple[int, int]]:
    """Grid over the regions of a scene's fills and the grains there are.

    Args:
        scene: with the fills.
        cloud: the grains.
        cell: edge of a cell [m]; None for about the median grain diameter.

    Returns:
        Lower corner, shape (2,) [m], cell [m], rows and columns.

    Raises:
        ValueError: if there are neither fills with a region nor grains, or the cell is not positive.
    """
    corners = [np.asarray(corner, float)[:2] for fill in scene.fills if fill.low is not None for corner in (fill.low, fill.high)]
    if len(cloud):
        reach = cloud.radius[:, None]
        corners += [(cloud.position[:, :2] - reach).min(axis=0), (cloud.position[:, :2] + reach).max(axis=0)]
    if not corners:
        raise ValueError("there are neither fills with a region nor grains to lay a grid over")
    if cell is None:
        cell = 2.0 * float(np.median(cloud.radius)) if len(cloud) else 0.02 * float(np.ptp(corners, axis=0).max())
    low, shape = footprint_grid(np.min(corners, axis=0), np.max(corners, axis=0), cell)
    return low, cell, shape


def make_height_map(cloud: GrainCloud, low: np.ndarray, cell: float, shape: tuple[int, int]) -> HeightMap:
    """Top of the highest sphere over the middle of each cell; NaN where there is none.

    Args:
        cloud: spheres, best ``Observation.spheres``, so that bodies show their shape.
        low: lower corner of the grid, shape (2,) [m].
        cell: edge of a cell [m].
        shape: rows (along y) and columns (along x).

    Raises:
        ValueError: if cell or shape are not positive.
    """
    rows, columns = shape
    if not (cell > 0.0 and rows > 0 and columns > 0):
        raise ValueError(f"height map: cell and shape must be positive, not {cell} and {shape}")
    place, radius = cloud.position, cloud.radius.astype(float)
    x, y = ((place[:, :2] - low) / cell).T  # in cells; their middles lie at k + 1/2
    reach = radius / cell
    first_x, wide = _middles_within(x, reach, columns)
    first_y, high = _middles_within(y, reach, rows)
    covered = wide * high
    heights = np.full(rows * columns, -np.inf)
    over = np.flatnonzero(covered)
    ends = np.cumsum(covered[over])
    start = 0
    while start < len(over):
        stop = max(start + 1, int(np.searchsorted(ends, (ends[start - 1] if start else 0) + _AT_ONCE, side="right")))
        part = over[start:stop]
        sphere = np.repeat(part, covered[part])
        number = np.arange(len(sphere)) - np.repeat(np.cumsum(covered[part]) - covered[part], covered[part])
        column, row = first_x[sphere] + number % wide[sphere], first_y[sphere] + number // wide[sphere]
        cap = reach[sphere] ** 2 - (column + 0.5 - x[sphere]) ** 2 - (row + 0.5 - y[sphere]) ** 2
        hit = cap >= 0.0
        top = place[sphere[hit], 2] + cell * np.sqrt(cap[hit])
        np.maximum.at(heights, row[hit] * columns + column[hit], top)
        start = stop
    heights[np.isneginf(heights)] = np.nan
    return HeightMap(np.asarray(low, float), float(cell), heights.reshape(shape).astype(np.float32))


def _middles_within(at: np.ndarray, reach: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """First cell whose middle is within reach, and how many are; all in cells, shape (n,) int."""
    first = np.clip(np.ceil(at - reach - 0.5), 0, number).astype(int)
    last = np.clip(np.floor(at + reach - 0.5), -1, number - 1).astype(int)
    return first, np.maximum(last - first + 1, 0)
