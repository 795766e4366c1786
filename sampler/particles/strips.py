"""Strips and wires far narrower than the spacing, which get fewer particles for their area than a row of them needs."""

import numpy as np
import warp as wp

from sampler.launching import launch_shares
from sampler.particles.cells import Cells, cell_at, row_of, sort_into_cells
from sampler.particles.rows import ROW
from sampler.particles.skin import Skin, halve_triangles, longest_edges, slices

_PIECE = 0.5  # longest edge of pieces that are asked, in spacings
_SLIM = 0.5  # triangles less high than this share of that are cut across their longest edge: halved, needles would breed
_TOGETHER = 0.3  # width of cells whose pieces are asked together, in spacings
_LEAST = 1.2  # times its area that a piece must want before it gets more


@wp.kernel(enable_backward=False, module="sampler_cells")
def gather_area(cells: Cells, areas: wp.array(dtype=float), first: int, total: wp.array(dtype=float), far: wp.array(dtype=float)):
    """Area within a spacing of each place, and how far off the farthest of it is; everything by rank, in spacings."""
    rank = first + wp.tid()
    here = cells.points[rank]
    low = cell_at(cells, here - wp.vec3(1.0))
    high = cell_at(cells, here + wp.vec3(1.0))
    area = float(0.0)
    most = float(0.0)
    for z in range(low[2], high[2] + 1):
        for y in range(low[1], high[1] + 1):
            row = row_of(cells, y, z)
            for other in range(cells.begin[row + low[0]], cells.begin[row + high[0] + 1]):
                way = wp.length(cells.points[other] - here)
                if way < 1.0:
                    area += areas[other]
                    most = wp.max(most, way)
    total[rank] = area
    far[rank] = most


@wp.kernel(enable_backward=False, module="sampler_cells")
def widest_near(
    cells: Cells,
    total: wp.array(dtype=float),
    far: wp.array(dtype=float),
    first: int,
    most: wp.array(dtype=float),
    least: wp.array(dtype=float),
):
    """The most area around any place within a spacing, which tells rims of what is wide from strips, and the least extent."""
    rank = first + wp.tid()
    here = cells.points[rank]
    low = cell_at(cells, here - wp.vec3(1.0))
    high = cell_at(cells, here + wp.vec3(1.0))
    area = total[rank]
    extent = far[rank]
    for z in range(low[2], high[2] + 1):
        for y in range(low[1], high[1] + 1):
            row = row_of(cells, y, z)
            for other in range(cells.begin[row + low[0]], cells.begin[row + high[0] + 1]):
                if wp.length(cells.points[other] - here) < 1.0:
                    area = wp.max(area, total[other])
                    extent = wp.min(extent, far[other])
    most[rank] = area
    least[rank] = extent


def with_rows(skin: Skin, spacing: float) -> Skin:
    """The skin, whose strips and wires count as wide as a row of particles; the same one if there are none.

    Args:
        skin: that particles are to cover.
        spacing: of these [m].
    """
    places, areas, parent = _pieces(skin.triangles, _PIECE * spacing)
    whole = Skin.areas_of(skin.triangles)
    area = areas * (skin.areas / whole)[parent]
    places = places / spacing
    cell = np.floor(places / _TOGETHER).astype(np.int64)
    cell -= cell.min(axis=0)
    _, which = np.unique(np.ravel_multi_index(cell.T, cell.max(axis=0) + 1), return_inverse=True)
    together = np.bincount(which, area)
    middle = np.column_stack([np.bincount(which, area * places[:, k]) for k in range(3)]) / together[:, None]
    middle = (middle - middle.mean(axis=0)).astype(np.float32)
    wanted = _wanted(middle, together / spacing**2, skin.device)
    if np.all(wanted == 1.0):
        return skin
    return Skin(skin.triangles, skin.device, whole / np.bincount(parent, area * wanted[which], len(whole)))


def _pieces(triangles: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pieces of triangles, none longer than so far [m].

    Returns:
        Their centroids, shape (n, 3) [m]; areas, shape (n,) [m^2]; the triangle that each is of, shape (n,).
    """
    parent, found = np.arange(len(triangles)), []
    while len(triangles):
        edge, area = longest_edges(triangles), Skin.areas_of(triangles)
        small = edge <= longest
        slim = ~small & (2.0 * area < _SLIM * edge * longest)
        places, shares, which = slices(triangles[slim], longest)
        found += [(triangles[small].mean(axis=1), area[small], parent[small])]
        found += [(places, shares * area[slim][which], parent[slim][which])]
        rest = ~(small | slim)
        triangles, parent = halve_triangles(triangles[rest]), np.tile(parent[rest], 2)
    return tuple(map(np.concatenate, zip(*found, strict=True)))


def _wanted(places: np.ndarray, areas: np.ndarray, device: str) -> np.ndarray:
    """How many times its area each place is to count, shape (n,) [1]; in spacings."""
    cells = sort_into_cells(places, np.zeros_like(places), 1.0, device)
    order, number = cells.which.numpy(), len(places)
    by_rank = wp.array(areas[order].astype(np.float32), dtype=float, device=device)
    total, far, most, least = (wp.zeros(number, dtype=float, device=device) for _ in range(4))
    launch_shares(gather_area, number, [cells, by_rank], [total, far], device)
    launch_shares(widest_near, number, [cells, total, far], [most, least], device)
    wanted = np.empty(number)
    # A row of particles one spacing apart, one particle in what is shorter than that.
    wanted[order] = ROW * np.maximum(1.0, 2.0 * least.numpy() + _TOGETHER) / most.numpy()
    return np.where(wanted > _LEAST, wanted, 1.0)
