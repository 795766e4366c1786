"""``sensor_msgs``: the grains as a point cloud."""

import array

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.builtin_interfaces import time_to_stamp
from sand_sim.border import GrainCloud

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("radius", "<f4"), ("speed", "<f4"), ("id", "<u4")])
_TYPES = {"<f4": PointField.FLOAT32, "<u4": PointField.UINT32}
_FIELDS = [
    PointField(name=name, offset=offset, datatype=_TYPES[kind.str], count=1) for name, (kind, offset) in POINT.fields.items()
]


def grains_to_cloud(grains: GrainCloud, time: float, frame_id: str, decimation: int = 1) -> PointCloud2:
    """Grains to a cloud with the fields x y z [m], radius [m], speed [m/s] and id.

    Args:
        grains: all grains.
        time: of the observation [s].
        frame_id: of the world frame.
        decimation: keep the grains whose id is a multiple of this.
    """
    kept = grains.identity % decimation == 0
    points = np.empty(int(kept.sum()), POINT)
    for k, name in enumerate("xyz"):
        points[name] = grains.position[kept, k]
    points["radius"], points["speed"], points["id"] = grains.radius[kept], grains.speed[kept], grains.identity[kept]
    message = PointCloud2(
        height=1,
        width=len(points),
        fields=_FIELDS,
        is_bigendian=False,
        point_step=POINT.itemsize,
        row_step=POINT.itemsize * len(points),
        is_dense=True,
    )
    message.header.stamp, message.header.frame_id = time_to_stamp(time), frame_id
    # Assigning bytes or a NumPy array makes rclpy copy byte by byte, hundreds of times slower than this.
    data = array.array("B")
    data.frombytes(points.view(np.uint8))
    message.data = data
    return message


def cloud_to_points(message: PointCloud2) -> np.ndarray:
    """A cloud made by ``grains_to_cloud`` to a structured array with the fields of ``POINT``, shape (n,)."""
    return np.frombuffer(message.data, POINT)
