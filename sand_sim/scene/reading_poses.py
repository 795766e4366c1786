"""Poses in a scene file."""

from sand_sim import rotation
from sand_sim.scene.fields import Field
from sand_sim.scene.types import Pose


def read_pose(entry: Field) -> Pose:
    """A pose from ``position`` [m] and ``orientation`` (x y z w) or ``rpy`` [rad]."""
    entry.keys(("position", "orientation", "rpy"))
    position = entry.optional("position", Field.vector, (0.0, 0.0, 0.0))
    if "rpy" in entry:
        if "orientation" in entry:
            raise entry.refuse("give only one of 'orientation' and 'rpy'")
        return Pose(position, tuple(map(float, rotation.from_rpy(*entry["rpy"].vector()))))
    if "orientation" not in entry:
        return Pose(position)
    quaternion = entry["orientation"].vector(4)
    try:
        return Pose(position, tuple(rotation.unit(quaternion)))
    except ValueError as error:
        raise entry["orientation"].refuse(f"must not be {error}") from None
