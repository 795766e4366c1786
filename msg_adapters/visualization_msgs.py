"""``visualization_msgs``: contact forces as lines, meshes and outlines, for RViz."""

import numpy as np
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.builtin_interfaces import time_to_stamp
from sand_sim.border import ToolContacts

_FORCE, _POINT = 0, 1  # ids


def contacts_to_markers(contacts: ToolContacts, time: float, frame_id: str, metres_per_newton: float, size: float) -> MarkerArray:
    """Two markers of the tool's namespace: a line along each force, beginning at its contact, and the contacts as points.

    Args:
        contacts: of a tool.
        time: of the observation [s].
        frame_id: of the world frame.
        metres_per_newton: length of the lines [m/N].
        size: of the points, a quarter of it the width of the lines [m].
    """
    ends = contacts.point + metres_per_newton * contacts.force
    lines = _marker(contacts.tool, _FORCE, Marker.LINE_LIST, time, frame_id, (0.9, 0.2, 0.1), 0.25 * size)
    lines.points = _points(np.stack([contacts.point, ends], axis=1).reshape(-1, 3))
    points = _marker(contacts.tool, _POINT, Marker.POINTS, time, frame_id, (0.1, 0.2, 0.9), size)
    points.points = _points(contacts.point)
    return MarkerArray(markers=[lines, points])


def triangles_to_marker(triangles: np.ndarray, name: str, frame_id: str, colour: tuple) -> Marker:
    """A mesh that follows its frame.

    Args:
        triangles: in that frame, shape (n, 3, 3) [m].
        name: its namespace.
        frame_id: of its frame.
        colour: red, green, blue, opacity; 0 to 1.
    """
    marker = _marker(name, 0, Marker.TRIANGLE_LIST, 0.0, frame_id, colour[:3], 1.0)
    marker.scale.z, marker.color.a, marker.frame_locked = 1.0, colour[3], True
    marker.points = _points(np.reshape(triangles, (-1, 3)))
    return marker


def lines_to_marker(ends: np.ndarray, name: str, frame_id: str, colour: tuple, width: float) -> Marker:
    """Lines, given their ends, shape (n, 2, 3) [m]; the rest as ``triangles_to_marker``, the width in metres."""
    marker = _marker(name, 0, Marker.LINE_LIST, 0.0, frame_id, colour, width)
    marker.points = _points(np.reshape(ends, (-1, 3)))
    return marker


def _marker(namespace: str, number: int, kind: int, time: float, frame_id: str, colour: tuple, size: float) -> Marker:
    marker = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    marker.header.stamp, marker.header.frame_id = time_to_stamp(time), frame_id
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = size
    marker.color.r, marker.color.g, marker.color.b = colour
    marker.color.a = 1.0
    return marker


def _points(values: np.ndarray) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in values.astype(float).tolist()]
