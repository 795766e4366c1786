"""Poses in a scene file."""

import numpy as np

from sand_sim import rotation
from sand_sim.scene.fields import Field
from sand_sim.scene.types import Pose


def read_pose(entry: Field) -> Pose:
    """A pose from ``position`` [m] and ``orientation`` (x y z w) or ``rpy`` [rad]."""
    entry.keys(("position", "orientation", "rpy"))
    position = entry.optional("position", Field.vector, (0.0, 0.0, 0.0))
    if "rpy" in entry:
        return Pose(position, tuple(map(float, rotation.from_rpy(*entry["rpy"].vector()))))
    if "orientation" not in entry:
        return Pose(position)
    quaternion = np.array(entry["orientation"].vector(4))
    length = np.linalg.norm(quaternion)
    if length < 1e-6:
        raise entry["orientation"].refuse("must not be the zero quaternion; [0, 0, 0, 1] is no rotation")
    return Pose(position, tuple(quaternion / length))
