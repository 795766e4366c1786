"""``sensor_msgs``: grains and contacts as point clouds, heights as an image, joint states."""

import array

import numpy as np
from sensor_msgs.msg import Image, JointState, PointCloud2, PointField

from msg_adapters.builtin_interfaces import stamp_to_time, time_to_stamp
from sand_sim.border import GrainCloud

_TYPES = {"<f4": PointField.FLOAT32, "<u4": PointField.UINT32}
_KINDS = {number: kind for kind, number in _TYPES.items()}
_COLUMNS = {
    "x": lambda grains: grains.position[:, 0],
    "y": lambda grains: grains.position[:, 1],
    "z": lambda grains: grains.position[:, 2],
    "radius": lambda grains: grains.radius,
    "speed": lambda grains: grains.speed,
    "id": lambda grains: grains.identity.astype("<u4"),
    "vx": lambda grains: grains.velocity[:, 0],
    "vy": lambda grains: grains.velocity[:, 1],
    "vz": lambda grains: grains.velocity[:, 2],
    "mass": lambda grains: grains.mass,
}
# Files of parameters take a plain y for a truth value, so that lists of single letters must be quoted there.
_GROUPS = {"position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz")}
POINT_FIELDS = (*_COLUMNS, *_GROUPS)
USUAL_FIELDS = ("position", "radius", "speed", "id")


def grains_to_cloud(grains: GrainCloud, time: float, frame_id: str, fields: tuple[str, ...] = USUAL_FIELDS) -> PointCloud2:
    """Grains to a cloud, in single precision.

    Args:
        grains: all grains.
        time: of the observation [s].
        frame_id: of the world frame.
        fields: some of ``POINT_FIELDS``: x y z [m], radius [m], speed [m/s], id, vx vy vz [m/s], mass [kg]; position and
            velocity for three at once.
    """
    names = [name for field in fields for name in _GROUPS.get(field, (field,))]
    return columns_to_cloud({name: _COLUMNS[name](grains) for name in names}, time, frame_id)


def columns_to_cloud(columns: dict[str, np.ndarray], time: float, frame_id: str) -> PointCloud2:
    """Columns of equal length, shape (n,) each, to a cloud: uint32 as they are, all else in single precision.

    Args:
        columns: by the names of the fields.
        time: [s].
        frame_id: of the frame that positions are in.
    """
    kinds = {name: "<u4" if column.dtype == np.uint32 else "<f4" for name, column in columns.items()}
    points = np.empty(len(next(iter(columns.values()))), list(kinds.items()))
    for name, column in columns.items():
        points[name] = column
    size = points.dtype.itemsize
    fields = [
        PointField(name=name, offset=offset, datatype=_TYPES[kind.str], count=1)
        for name, (kind, offset) in points.dtype.fields.items()
    ]
    message = PointCloud2(height=1, width=len(points), fields=fields, is_bigendian=False, is_dense=True)
    message.point_step, message.row_step = size, size * len(points)
    message.header.stamp, message.header.frame_id = time_to_stamp(time), frame_id
    message.data = _bytes_of(points)
    return message


def cloud_to_points(message: PointCloud2) -> np.ndarray:
    """A cloud made here to a structured array with its fields, shape (n,)."""
    return np.frombuffer(message.data, [(field.name, _KINDS[field.datatype]) for field in message.fields])


def heights_to_image(heights: np.ndarray, time: float, frame_id: str) -> Image:
    """Heights to an image of single-precision metres, not a number where there is no grain.

    Args:
        heights: shape (rows along y, columns along x) [m]; the first row is the one with the least y.
        time: of the observation [s].
        frame_id: of the world frame.
    """
    rows, columns = heights.shape
    message = Image(height=rows, width=columns, encoding="32FC1", is_bigendian=0, step=4 * columns)
    message.header.stamp, message.header.frame_id = time_to_stamp(time), frame_id
    message.data = _bytes_of(np.ascontiguousarray(heights, "<f4"))
    return message


def image_to_heights(message: Image) -> np.ndarray:
    """An image made by ``heights_to_image`` to heights, shape (rows, columns) [m]."""
    return np.frombuffer(message.data, "<f4").reshape(message.height, message.width)


def _bytes_of(values: np.ndarray) -> array.array:
    # Given a NumPy array, or bytes where it is told to check fields, rclpy goes byte by byte, hundreds of times slower than this.
    data = array.array("B")
    data.frombytes(values.view(np.uint8))
    return data


def joints_to_values(message: JointState) -> tuple[dict[str, float], float]:
    """Values of joints by their names [rad or m], of those that have one, and the time they are of [s]."""
    return dict(zip(message.name, message.position, strict=False)), stamp_to_time(message.header.stamp)


def values_to_joints(values: dict[str, float], time: float) -> JointState:
    """The opposite of ``joints_to_values``."""
    message = JointState(name=list(values), position=[float(value) for value in values.values()])
    message.header.stamp = time_to_stamp(time)
    return message
