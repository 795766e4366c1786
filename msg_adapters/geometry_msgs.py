"""``geometry_msgs``: tool poses in, wrenches out."""

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped

from msg_adapters.builtin_interfaces import stamp_to_time, time_to_stamp
from sand_sim.border import ToolPose, ToolReport


def pose_to_command(message: PoseStamped, tool: str) -> ToolPose:
    """A stamped pose to a command; a zero stamp means no time.

    Args:
        message: pose of the tool frame in the frame of its header, which the caller has checked.
        tool: name.
    """
    at, turn, stamp = message.pose.position, message.pose.orientation, message.header.stamp
    return ToolPose(
        tool,
        np.array([at.x, at.y, at.z]),
        np.array([turn.x, turn.y, turn.z, turn.w]),
        stamp_to_time(stamp) if stamp.sec or stamp.nanosec else None,
    )


def command_to_pose(command: ToolPose, frame_id: str) -> PoseStamped:
    """A command to a stamped pose in a frame; no time gives a zero stamp."""
    message = PoseStamped()
    message.header.frame_id = frame_id
    if command.time is not None:
        message.header.stamp = time_to_stamp(command.time)
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = (float(value) for value in command.position)
    turn.x, turn.y, turn.z, turn.w = (float(value) for value in command.orientation)
    return message


def report_to_wrench(report: ToolReport, time: float) -> WrenchStamped:
    """Force and torque of the sand on a tool about the tool frame's origin, in the tool frame, which is named like the tool.

    Args:
        report: of the tool.
        time: of the observation [s].
    """
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = time_to_stamp(time), report.name
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z = (float(value) for value in report.force)
    torque.x, torque.y, torque.z = (float(value) for value in report.torque)
    return message


def wrench_to_arrays(message: WrenchStamped) -> tuple[np.ndarray, np.ndarray]:
    """Force [N] and torque [N m], shape (3,) each."""
    force, torque = message.wrench.force, message.wrench.torque
    return np.array([force.x, force.y, force.z]), np.array([torque.x, torque.y, torque.z])
