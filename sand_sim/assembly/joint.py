"""Joints of a robot: how links hang on others, and where they are at a value.

Source: http://wiki.ros.org/urdf/XML/joint.
"""

from dataclasses import dataclass

import numpy as np

from sand_sim import rotation

FIXED, FLOATING = "fixed", "floating"
_TURNING, _SLIDING = ("revolute", "continuous"), "prismatic"
JOINTS = (FIXED, *_TURNING, _SLIDING, FLOATING, "planar")


@dataclass(frozen=True)
class Joint:
    """How a link hangs on another one.

    Attributes:
        kind: ``fixed``, or that of a movable one.
        parent: name of the link it hangs on.
        position: of the link's frame in the parent's when all joints are at zero, shape (3,) [m].
        orientation: link's frame to parent's, then, shape (4,).
        name: of the joint.
        axis: about or along which it moves, in the link's frame, shape (3,) [1].
        mimics: joint whose value it has, times a factor, plus an offset [rad or m]; none if empty.
        factor: of that [1].
        offset: added to that [rad or m].
    """

    kind: str
    parent: str
    position: np.ndarray
    orientation: np.ndarray
    name: str
    axis: np.ndarray
    mimics: str = ""
    factor: float = 1.0
    offset: float = 0.0

    def pose_at(self, value: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Position and orientation of the link's frame in the parent's, (3,) and (4,), at a value [rad or m].

        None for joints of which one value does not tell it.
        """
        if self.kind == FIXED:
            return self.position, self.orientation
        if self.kind in _TURNING:
            return self.position, rotation.multiply(self.orientation, rotation.from_vector(value * self.axis))
        if self.kind == _SLIDING:
            return self.position + rotation.rotate(self.orientation, value * self.axis), self.orientation
        return None
