"""``nav_msgs``: where the cells of a height map lie."""

import numpy as np
from nav_msgs.msg import MapMetaData


def grid_to_metadata(low: np.ndarray, cell: float, shape: tuple[int, int]) -> MapMetaData:
    """The grid of a height map.

    Args:
        low: lower corner, x and y, world frame, shape (2,) [m].
        cell: edge of a cell [m].
        shape: rows (along y) and columns (along x).
    """
    message = MapMetaData(resolution=float(cell), width=shape[1], height=shape[0])
    message.origin.position.x, message.origin.position.y = float(low[0]), float(low[1])
    message.origin.orientation.w = 1.0
    return message
