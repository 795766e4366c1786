"""``geometry_msgs``: tool poses and velocities in, wrenches and poses out."""

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped, WrenchStamped

from msg_adapters.builtin_interfaces import stamp_to_time, time_to_stamp
from sand_sim.border import Frame, ToolPose, ToolReport, ToolVelocity


def pose_to_command(message: PoseStamped, tool: str) -> ToolPose:
    """A stamped pose to a command; a zero stamp means no time.

    Args:
        message: pose of the tool frame in the frame of its header, which the caller has checked.
        tool: name.
    """
    pose = message.pose
    return ToolPose(tool, _vector(pose.position), _quaternion(pose.orientation), _time_or_none(message.header.stamp))


def command_to_pose(command: ToolPose, frame_id: str) -> PoseStamped:
    """A command to a stamped pose in a frame; no time gives a zero stamp."""
    message = PoseStamped()
    message.header.frame_id = frame_id
    if command.time is not None:
        message.header.stamp = time_to_stamp(command.time)
    fill(message.pose.position, command.position)
    fill(message.pose.orientation, command.orientation)
    return message


def twist_to_command(message: TwistStamped, tool: str, in_tool_frame: bool) -> ToolVelocity:
    """A stamped twist to a command; a zero stamp means no time.

    Args:
        message: velocity of the tool frame's origin and angular velocity, in the frame of its header, which the caller knows.
        tool: name.
        in_tool_frame: whether that frame is the tool's own.
    """
    twist = message.twist
    return ToolVelocity(tool, _vector(twist.linear), _vector(twist.angular), in_tool_frame, _time_or_none(message.header.stamp))


def command_to_twist(command: ToolVelocity, frame_id: str) -> TwistStamped:
    """A velocity to a stamped twist in a frame; no time gives a zero stamp."""
    message = TwistStamped()
    message.header.frame_id = frame_id
    if command.time is not None:
        message.header.stamp = time_to_stamp(command.time)
    fill(message.twist.linear, command.linear)
    fill(message.twist.angular, command.angular)
    return message


def transform_to_frame(message: TransformStamped, fixed: bool = False) -> Frame:
    """A transform to a frame.

    Args:
        message: of TF, with the frame as ``child_frame_id``.
        fixed: whether it holds for all times.
    """
    transform = message.transform
    time = None if fixed else stamp_to_time(message.header.stamp)
    place, turn = _vector(transform.translation), _quaternion(transform.rotation)
    return Frame(message.child_frame_id, message.header.frame_id, place, turn, time)


def frame_to_transform(frame: Frame) -> TransformStamped:
    """A frame to a transform of TF; one without a time gets a zero stamp."""
    message = TransformStamped(child_frame_id=frame.name)
    message.header.frame_id, message.header.stamp = frame.parent, time_to_stamp(frame.time or 0.0)
    fill(message.transform.translation, frame.position)
    fill(message.transform.rotation, frame.orientation)
    return message


def report_to_pose(report: ToolReport, time: float, frame_id: str) -> PoseStamped:
    """Where a tool is, in the world frame.

    Args:
        report: of the tool.
        time: of the observation [s].
        frame_id: of the world frame.
    """
    return command_to_pose(ToolPose(report.name, report.position, report.orientation, time), frame_id)


def arrays_to_wrench(force: np.ndarray, torque: np.ndarray, time: float, frame_id: str) -> WrenchStamped:
    """A wrench in the axes of a frame.

    Args:
        force: shape (3,) [N].
        torque: shape (3,) [N m].
        time: [s].
        frame_id: of the frame.
    """
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = time_to_stamp(time), frame_id
    fill(message.wrench.force, force)
    fill(message.wrench.torque, torque)
    return message


def wrench_to_arrays(message: WrenchStamped) -> tuple[np.ndarray, np.ndarray]:
    """Force [N] and torque [N m], shape (3,) each."""
    return _vector(message.wrench.force), _vector(message.wrench.torque)


def _vector(message) -> np.ndarray:
    return np.array([message.x, message.y, message.z])


def _quaternion(message) -> np.ndarray:
    return np.array([message.x, message.y, message.z, message.w])


def fill(message, values: np.ndarray) -> None:
    """Set x, y, z and, where there are four values, w of a message."""
    for name, value in zip("xyzw", values, strict=False):
        setattr(message, name, float(value))


def _time_or_none(stamp) -> float | None:
    return stamp_to_time(stamp) if stamp.sec or stamp.nanosec else None
