"""The way of a tool from one commanded pose to the next, and along the trajectory of a scene."""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sand_sim import rotation
from sand_sim.border import ToolPose
from sand_sim.reach import Reach
from sand_sim.scene.types import Pose, Scene, Waypoint

SPEED_TOLERANCE = 1.02  # times its max_speed at which a tool is not yet too fast


@dataclass(frozen=True)
class Track:
    """Even motion between two poses; before and after it the tool rests.

    Attributes:
        begin_time, end_time: [s].
        begin_position, end_position: shape (3,) [m].
        begin_orientation, end_orientation: shape (4,).
    """

    begin_time: float
    end_time: float
    begin_position: np.ndarray
    end_position: np.ndarray
    begin_orientation: np.ndarray
    end_orientation: np.ndarray

    @classmethod
    def rest(cls, pose: Pose | ToolPose) -> "Track":
        """Stay at a pose."""
        position, orientation = np.asarray(pose.position, float), np.asarray(pose.orientation, float)
        return cls(0.0, 0.0, position, position, orientation, orientation)

    @property
    def velocity(self) -> np.ndarray:
        """Of the frame's origin while it moves, shape (3,) [m/s]."""
        return (self.end_position - self.begin_position) / self._duration

    @property
    def spin(self) -> np.ndarray:
        """Angular velocity while it moves, world frame, shape (3,) [rad/s]."""
        turn = rotation.multiply(self.end_orientation, rotation.inverse(self.begin_orientation))
        return rotation.to_vector(turn) / self._duration

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and orientation at a time [s]."""
        if time >= self.end_time:
            return self.end_position, self.end_orientation
        passed = max(time - self.begin_time, 0.0)
        position = self.begin_position + self.velocity * passed
        return position, rotation.multiply(rotation.from_vector(self.spin * passed), self.begin_orientation)

    @property
    def _duration(self) -> float:
        return self.end_time - self.begin_time if self.end_time > self.begin_time else np.inf


def travel(before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray], reach: Reach) -> float:
    """How far any point of a tool moves at most on its way between two poses [m].

    Args:
        before: position, shape (3,) [m], and orientation, shape (4,).
        after: the same.
        reach: of the tool.
    """
    turn = rotation.to_vector(rotation.multiply(rotation.inverse(before[1]), after[1]))  # in the tool frame
    return float(np.linalg.norm(after[0] - before[0]) + reach.swing(turn))


def pose_on_trajectory(waypoints: tuple[Waypoint, ...], time: float) -> tuple[np.ndarray, np.ndarray]:
    """Pose of a tool on a trajectory, at rest before the first waypoint and after the last.

    Args:
        waypoints: in the order of their times, at least one.
        time: [s].

    Returns:
        Position, shape (3,) [m], and orientation, shape (4,).
    """
    k = bisect_right(waypoints, time, key=lambda stop: stop.time)
    before, after = waypoints[max(k - 1, 0)], waypoints[min(k, len(waypoints) - 1)]
    start, begin = np.asarray(before.pose.position, float), np.asarray(before.pose.orientation)
    if after is before:
        return start, begin
    if after.motion:
        return after.motion.after(start, begin, time - before.time)
    share = (time - before.time) / (after.time - before.time)
    way = np.asarray(after.pose.position, float) - start
    return start + share * way, rotation.between(begin, np.asarray(after.pose.orientation), share)


def phases_of(waypoints: tuple[Waypoint, ...]) -> dict[str, tuple[float, float]]:
    """Begin and end [s] of each named phase of a trajectory; neighbouring stretches of one name are one phase.

    The first waypoint's phase names no stretch, as no way leads to it.
    """
    phases: dict[str, tuple[float, float]] = {}
    for before, after in pairwise(waypoints):
        if after.phase:
            going_on = after.phase == before.phase and after.phase in phases
            begin = phases[after.phase][0] if going_on else before.time
            phases[after.phase] = (begin, after.time)
    return phases


def phases_at(scene: Scene, time: float) -> list[str]:
    """Names of the phases that the tools' trajectories are in at a time [s]; a phase includes its end, not its beginning."""
    spans = [span for tool in scene.tools for span in phases_of(tool.trajectory).items()]
    return [phase for phase, (begin, end) in spans if begin < time <= end + 1e-9]
