"""``nav_msgs``: where the cells of a height map lie, and how free bodies move."""

import numpy as np
from nav_msgs.msg import MapMetaData, Odometry

from msg_adapters.builtin_interfaces import time_to_stamp
from msg_adapters.geometry_msgs import fill
from sand_sim.border import BodyReport


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


def body_to_odometry(report: BodyReport, twist: np.ndarray, time: float, frame_id: str, child_frame_id: str) -> Odometry:
    """Where a body is, in the world frame, and how it moves, in its own; nothing is uncertain.

    Args:
        report: of the body.
        twist: velocity of its frame's origin [m/s] and spin [rad/s], in its own frame, shape (2, 3).
        time: of the observation [s].
        frame_id: of the world frame.
        child_frame_id: of the body's own.
    """
    message = Odometry(child_frame_id=child_frame_id)
    message.header.frame_id, message.header.stamp = frame_id, time_to_stamp(time)
    fill(message.pose.pose.position, report.position)
    fill(message.pose.pose.orientation, report.orientation)
    fill(message.twist.twist.linear, twist[0])
    fill(message.twist.twist.angular, twist[1])
    return message
