"""Poses in a scene file."""

import math
from collections.abc import Sequence

from sand_sim import rotation
from sand_sim.scene.fields import Field
from sand_sim.scene.types import Pose

_WIDEST = 6.3  # [rad] a whole turn, however it is rounded


def in_degrees(angles: Sequence[float], widest: float = _WIDEST) -> str:
    """What to say of angles [rad] that are wider than makes sense and so most likely meant in degrees; empty of others."""
    if max(map(abs, angles)) <= widest:
        return ""
    meant = [round(math.radians(angle), 4) for angle in angles]
    return f"is in radians, and {list(angles)} is more than a whole turn; in degrees it would be {meant}"


def read_pose(entry: Field, widest: float = _WIDEST) -> Pose:
    """A pose from ``position`` [m] and ``orientation`` (x y z w) or ``rpy`` [rad], of angles up to the widest [rad]."""
    entry.keys(("position", "orientation", "rpy"))
    position = entry.optional("position", Field.vector, (0.0, 0.0, 0.0))
    if "rpy" in entry:
        if "orientation" in entry:
            raise entry.refuse("give only one of 'orientation' and 'rpy'")
        angles = entry["rpy"].vector()
        if doubt := in_degrees(angles, widest):
            raise entry["rpy"].refuse(doubt)
        return Pose(position, tuple(map(float, rotation.from_rpy(*angles))))
    if "orientation" not in entry:
        return Pose(position)
    quaternion = entry["orientation"].vector(4)
    try:
        return Pose(position, tuple(rotation.unit(quaternion)))
    except ValueError as error:
        raise entry["orientation"].refuse(f"must not be {error}") from None
