"""Play the trajectories of a scene: the poses that a client sends, frame by frame."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from sand_sim import rotation
from sand_sim.border import ToolPose
from sand_sim.reach import Reach
from sand_sim.scene.types import Pose, Scene, SceneError, Tool
from sand_sim.tool_motion.track import SPEED_TOLERANCE, pose_on_trajectory, travel


def frame_times(scene: Scene, duration: float | None = None) -> Iterator[float]:
    """Ends of all frames of a scene [s]."""
    for k in range(round((duration or scene.duration) * scene.frame_rate)):
        yield (k + 1) / scene.frame_rate


def pose_times(scene: Scene, begin: float, end: float) -> list[float]:
    """When poses must be told between two times for tools to go as they should: at waypoints, in motions, at the end [s]."""
    least = 1e-6 / scene.frame_rate  # from one to the next: waypoints are meant to lie at ends of frames that are rounded
    first, last = begin + least, end - least
    times = {stop.time for tool in scene.tools for stop in tool.trajectory if first < stop.time < last}
    for before, after in (pair for tool in scene.tools for pair in pairwise(tool.trajectory)):
        if after.motion:
            start, until = before.time, min(last, after.time - least)
            times.update(start + passed for passed in after.motion.stops(max(first - start, 0.0), until - start))
    return [*sorted(times), end]


def driven_tools(scene: Scene) -> list[str]:
    """Names of the tools with a trajectory.

    Raises:
        SceneError: if there are none.
    """
    driven = [tool.name for tool in scene.tools if tool.trajectory]
    if not driven:
        raise SceneError(f"scene '{scene.name}' has no tool with a trajectory, so there is nothing to play")
    return driven


def commands_at(scene: Scene, time: float) -> list[ToolPose]:
    """Poses that the tools with a trajectory have at a time [s]."""
    driven = [tool for tool in scene.tools if tool.trajectory]
    return [ToolPose(tool.name, *pose_on_trajectory(tool.trajectory, time), time) for tool in driven]


def check_trajectory(tool: Tool, reach: Reach, first: float) -> None:
    """See that a tool can follow its trajectory, before the run that would end where it cannot.

    Args:
        tool: with a trajectory or without.
        reach: its reach.
        first: time of the first pose that is played [s].

    Raises:
        SceneError: naming the waypoint and how to mend it.
    """
    where, fastest = f"tools.{tool.name}", f"than its max_speed of {tool.max_speed:g} m/s"
    for number, (before, after) in enumerate(pairwise(tool.trajectory), 1):
        if motion := after.motion:
            own = rotation.rotate(rotation.inverse(before.pose.orientation), np.asarray(motion.spin))
            speed = motion.fastest + reach.swing(own)
        else:
            speed = travel(_arrays(before.pose), _arrays(after.pose), reach) / (after.time - before.time)
        if speed > SPEED_TOLERANCE * tool.max_speed:
            raise SceneError(
                f"{where}.trajectory[{number}]: on the way there a point of the tool moves at {speed:.3g} m/s, faster {fastest}; "
                "give it more time or a shorter way, or raise 'max_speed'"
            )
    if tool.trajectory:
        way = travel(_arrays(tool.pose), pose_on_trajectory(tool.trajectory, first), reach)
        if way > SPEED_TOLERANCE * tool.max_speed * first:
            raise SceneError(
                f"{where}.pose: is {way:.3g} m from where the trajectory has it {first:.3g} s later, farther "
                f"{fastest} allows; leave it out, and the tool begins where its trajectory does"
            )


def _arrays(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(pose.position), np.asarray(pose.orientation)
