"""How far a rigid body reaches, and so how far its points swing as it turns."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Reach:
    """Bounds of the surface of a body in its own frame.

    A screw or a wheel that turns about its axis moves its points by their distance from that, and not by that from the origin,
    which may be many times as large.

    Attributes:
        extent: farthest point from the origin [m].
        arms: farthest points from the x, the y and the z axis, shape (3,) [m].
    """

    extent: float
    arms: np.ndarray

    def swing(self, turn: np.ndarray) -> float:
        """How far any point moves at most [m], or how fast [m/s].

        Args:
            turn: axis times angle in the body's own frame, shape (3,) [rad], or its angular velocity [rad/s].
        """
        return float(min(self.extent * np.linalg.norm(turn), self.arms @ np.abs(turn)))


def reach_of(points: np.ndarray, margin: float) -> Reach:
    """Reach of a body.

    Args:
        points: all corners of its surface, or centres of its spheres, shape (n, 3) [m].
        margin: how far its surface lies outside of them [m].
    """
    square = points**2
    arms = np.sqrt((square.sum(axis=1, keepdims=True) - square).max(axis=0))
    return Reach(float(np.sqrt(square.sum(axis=1).max()) + margin), arms + margin)
