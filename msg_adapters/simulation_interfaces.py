"""``simulation_interfaces``, which is not among the wheels: whether it is there, and what its messages say of us."""

from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped

from msg_adapters.builtin_interfaces import time_to_stamp
from msg_adapters.geometry_msgs import command_to_pose, command_to_twist, pose_to_command, twist_to_command
from sand_sim.border import BodyReport, ToolPose, ToolReport, ToolVelocity

try:
    from simulation_interfaces import action, msg, srv
except ImportError:
    action = msg = srv = None


@dataclass(frozen=True)
class Asked:
    """Which entities a client asks for; what is empty does not restrict.

    Attributes:
        pattern: regular expression for names.
        categories: numbers of categories.
        tags: of which one, or each if ``all_tags``, must be there.
        all_tags: whether each must be there.
        bounded: whether they shall overlap with a region.
    """

    pattern: str
    categories: tuple[int, ...]
    tags: tuple[str, ...]
    all_tags: bool
    bounded: bool


def filters_to_asked(message) -> Asked:
    """``EntityFilters`` to what is asked for."""
    tags = message.tags
    categories = tuple(one.category for one in message.categories)
    every = tags.filter_mode == msg.TagsFilter.FILTER_MODE_ALL
    return Asked(message.filter, categories, tuple(tags.tags), every, bool(message.bounds.points))


def report_to_state(report: ToolReport | BodyReport, velocity: np.ndarray, time: float, frame_id: str):
    """A tool or a body to an ``EntityState``; its acceleration is not known and stays zero.

    Args:
        report: of it.
        velocity: of its frame's origin, world frame, shape (3,) [m/s].
        time: of the observation [s].
        frame_id: of the world frame.
    """
    state = msg.EntityState()
    state.header.stamp, state.header.frame_id = time_to_stamp(time), frame_id
    state.pose = command_to_pose(ToolPose(report.name, report.position, report.orientation), frame_id).pose
    state.twist = command_to_twist(ToolVelocity(report.name, velocity, report.spin), frame_id).twist
    return state


def state_to_command(state, tool: str) -> ToolPose:
    """The pose of an ``EntityState`` to a command without a time, in the frame of its header."""
    return pose_to_command(PoseStamped(pose=state.pose), tool)


def state_to_velocity(state, body: str) -> ToolVelocity:
    """The twist of an ``EntityState`` to the velocity of a frame's origin, in the axes of its header's frame."""
    return twist_to_command(TwistStamped(twist=state.twist), body, False)


def texts_to_info(category: int, description: str, tags: list[str]):
    """An ``EntityInfo``."""
    info = msg.EntityInfo(description=description, tags=tags)
    info.category.category = category
    return info


def names_to_features(names: tuple[str, ...], custom_info: str):
    """``SimulatorFeatures`` with those of the names that the installed version of the package knows."""
    numbers = [getattr(msg.SimulatorFeatures, name) for name in names if hasattr(msg.SimulatorFeatures, name)]
    return msg.SimulatorFeatures(features=numbers, custom_info=custom_info)
