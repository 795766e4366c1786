"""Fewer grains of a cloud, for networks and screens that cannot take all of them. Whole grains are kept, none is made up."""

from math import isfinite

import numpy as np

from sand_sim.border import GrainCloud

_SPARSE = 8  # voxels per grain beyond which a table of all voxels is not worth its memory


def take_grains(cloud: GrainCloud, chosen: np.ndarray) -> GrainCloud:
    """The grains of a mask, shape (n,) bool, or of row numbers; their order stays that of the rows."""
    return GrainCloud(*(getattr(cloud, name)[chosen] for name in GrainCloud.__dataclass_fields__))


def select_every(cloud: GrainCloud, step: int) -> GrainCloud:
    """Grains whose identity is a multiple of ``step``: the same ones in every frame.

    Raises:
        ValueError: if the step is not at least one.
    """
    if not step >= 1:
        raise ValueError(f"step: must be at least 1, not {step}")
    return take_grains(cloud, cloud.identity % int(step) == 0)


def select_box(cloud: GrainCloud, low: np.ndarray, high: np.ndarray) -> GrainCloud:
    """Grains whose centres are in a box with edges along the axes of the world.

    Args:
        cloud: to select from.
        low: lowest corner, shape (3,) [m]; minus infinity leaves a side open.
        high: highest corner, shape (3,) [m].

    Raises:
        ValueError: if a corner has not three numbers, or is not below the other.
    """
    return take_grains(cloud, in_box(cloud.position, low, high))


def in_box(position: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Whether points, shape (n, 3), are in a box, shape (n,); see ``select_box``."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    if low.shape != (3,) or high.shape != (3,):
        raise ValueError(f"box: corners must be of shape (3,), not {low.shape} and {high.shape}")
    if not np.all(low < high):
        raise ValueError(f"box: every coordinate of low {low.tolist()} must be below that of high {high.tolist()}")
    inside = np.ones(len(position), bool)
    for axis in range(3):
        inside &= (position[:, axis] >= low[axis]) & (position[:, axis] <= high[axis])
    return inside


def select_voxels(cloud: GrainCloud, edge: float) -> GrainCloud:
    """One grain per voxel, the topmost: what can be seen of a bed from above stays, and each grain shown is a real one.

    The voxels lie on a grid through the world's origin, so that a bed at rest shows the same grains in every frame. Of grains
    at the same height the one with the lowest identity is taken.

    Args:
        cloud: to select from.
        edge: of a voxel [m].

    Raises:
        ValueError: if the edge is not positive, or so small that voxels cannot be counted.
    """
    if not (edge > 0.0 and isfinite(edge)):
        raise ValueError(f"edge: must be a positive length in m, not {edge}")
    if not len(cloud):
        return cloud
    low, high = (np.floor(corner / edge) for corner in (cloud.position.min(axis=0), cloud.position.max(axis=0)))
    number = high - low + 1.0
    if not np.prod(number) < 2.0**62:
        raise ValueError(f"edge: {edge} m is too small for a cloud of {np.ptp(cloud.position, axis=0).round(3).tolist()} m")
    voxel = np.zeros(len(cloud), np.int64)
    for axis in (2, 1, 0):
        voxel *= int(number[axis])
        voxel += (np.floor(cloud.position[:, axis] / edge) - low[axis]).astype(np.int64)
    total = int(np.prod(number))
    if total > _SPARSE * len(cloud):
        _, voxel = np.unique(voxel, return_inverse=True)
        total = int(voxel.max()) + 1
    height = cloud.position[:, 2]
    top = np.full(total, -np.inf)
    np.maximum.at(top, voxel, height)
    row = np.flatnonzero(height == top[voxel])[::-1]
    first = np.full(total, -1)
    first[voxel[row]] = row  # the last one written counts, which is the lowest
    return take_grains(cloud, np.sort(first[first >= 0]))
