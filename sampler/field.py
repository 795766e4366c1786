"""The signed distance on a sparse grid near the surface, as plain arrays that any kernel can sample."""

from dataclasses import dataclass

import numpy as np

from sampler.distance import SignedDistance
from sampler.errors import MeshError
from sampler.options import is_positive
from sampler.sampling import thinnest_wall

BLOCK = 8  # cells along the edge of a block
_NODES = BLOCK + 1
_BLOCK_MEMORY = 4 + 4 * _NODES**3  # [bytes] of its number and its values
_TOGETHER = 400  # blocks evaluated in one go


@dataclass(frozen=True)
class DistanceField:
    """Signed distance in blocks of cells near the surface; trilinear between the nodes.

    Attributes:
        origin: low corner of the first cell, shape (3,) [m].
        cell: edge of a cell [m].
        band: distance from the surface up to which values are kept [m].
        block: number of each block of ``BLOCK`` cells per edge, -1 far outside, -2 far inside, int32 of shape (x, y, z).
        values: distance at the nodes of the kept blocks, negative inside, float32 of shape (n, 9, 9, 9) [m].
        thinnest_wall: of the solid [m].
    """

    origin: np.ndarray
    cell: float
    band: float
    block: np.ndarray
    values: np.ndarray
    thinnest_wall: float

    @property
    def resolves_walls(self) -> bool:
        """Whether a cell is at most half the thinnest wall, so that no wall falls between the nodes."""
        return self.cell <= 0.5 * self.thinnest_wall * (1.0 + 1e-9)

    @property
    def memory(self) -> int:
        """Size of all arrays [bytes]."""
        return self.values.nbytes + self.block.nbytes

    def sample(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance and its gradient.

        Args:
            points: shape (n, 3) [m].

        Returns:
            Distance, shape (n,) [m], plus or minus the band where it is farther; gradient, shape (n, 3), zero there.
        """
        place = (np.asarray(points, float) - self.origin) / self.cell
        whole = np.floor(place).astype(int)
        home = whole // BLOCK
        within = np.all((home >= 0) & (home < self.block.shape), axis=1)
        number = np.full(len(place), -1)
        number[within] = self.block[tuple(home[within].T)]
        distance = np.where(number == -2, -self.band, self.band)
        gradient = np.zeros((len(place), 3))
        kept = number >= 0
        share = (place - whole)[kept]
        at = (whole - home * BLOCK)[kept]
        corner = np.empty((len(at), 2, 2, 2))
        for i, j, k in np.ndindex(2, 2, 2):
            corner[:, i, j, k] = self.values[number[kept], at[:, 0] + i, at[:, 1] + j, at[:, 2] + k]
        weight = np.stack([1.0 - share, share], axis=2)  # point, axis, end
        x, y, z = weight[:, 0], weight[:, 1], weight[:, 2]
        distance[kept] = np.einsum("nijk,ni,nj,nk->n", corner, x, y, z)
        slope = np.array([-1.0, 1.0])
        gradient[kept, 0] = np.einsum("nijk,i,nj,nk->n", corner, slope, y, z) / self.cell
        gradient[kept, 1] = np.einsum("nijk,ni,j,nk->n", corner, x, slope, z) / self.cell
        gradient[kept, 2] = np.einsum("nijk,ni,nj,k->n", corner, x, y, slope) / self.cell
        return distance, gradient


def make_field(
    distance: SignedDistance,
    band: float,
    cell: float | None = None,
    memory: int = 256 << 20,
) -> DistanceField:
    """Evaluate a distance on blocks near its surface.

    Args:
        distance: to evaluate.
        band: distance from the surface up to which values are needed [m], for a tool the largest grain's radius and more.
        cell: edge of a cell [m]; half the thinnest wall, and at most half the band, if None.
        memory: most to take [bytes]; cells grow until it suffices, see ``DistanceField.resolves_walls``.

    Raises:
        MeshError: if the band or the cell is not positive and finite, or not even one block fits into the memory.
    """
    for name, value in (("band", band), ("cell", cell)):
        if not (is_positive(value) or (name == "cell" and value is None)):
            raise MeshError(f"{name} of a field must be positive, got {value!r}")
    if not memory >= _BLOCK_MEMORY:
        raise MeshError(f"memory of a field must be at least {_BLOCK_MEMORY} bytes, one block, got {memory!r}")
    wall = thinnest_wall(distance.surface)
    cell = min(0.5 * wall, 0.5 * band) if cell is None else cell
    corners = distance.surface.triangles.reshape(-1, 3)
    low, high = corners.min(axis=0) - band, corners.max(axis=0) + band
    while True:
        number = np.maximum(np.ceil((high - low) / (BLOCK * cell)).astype(int), 1)
        # Blocks that hold the band are at least those that the surface's area alone takes, which is quick to tell.
        area = float(distance.surface.areas.sum())
        least = area * 2.0 * band / (BLOCK * cell) ** 3
        if 4.0 * np.prod(number) + 4.0 * _NODES**3 * least > memory:
            cell *= 1.1
            continue
        near, inside = _near_blocks(distance, low, number, cell, band)
        if 4 * np.prod(number) + 4 * _NODES**3 * len(near) <= memory:
            break
        cell *= 1.1
    block = np.where(inside, -2, -1).astype(np.int32)
    block[tuple(near.T)] = np.arange(len(near))
    node = np.stack(np.meshgrid(*[np.arange(_NODES)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    values = np.empty((len(near), _NODES, _NODES, _NODES), np.float32)
    for first in range(0, len(near), _TOGETHER):
        part = near[first : first + _TOGETHER]
        places = low + cell * (BLOCK * part[:, None] + node)
        values[first : first + len(part)] = distance.query(places.reshape(-1, 3))[0].reshape(-1, _NODES, _NODES, _NODES)
    return DistanceField(low, cell, band, block, values, wall)


def _near_blocks(distance: SignedDistance, low, number, cell, band) -> tuple[np.ndarray, np.ndarray]:
    """Indices of blocks that reach into the band, shape (n, 3), and which blocks' middles are inside, shape as ``number``."""
    index = np.stack(np.meshgrid(*map(np.arange, number), indexing="ij"), axis=-1)
    middle = low + cell * BLOCK * (index.reshape(-1, 3) + 0.5)
    far = distance.query(middle)[0].reshape(tuple(number))
    return index[np.abs(far) <= band + 0.5 * np.sqrt(3.0) * BLOCK * cell], far < 0.0
