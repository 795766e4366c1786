"""A ROS client that drives the tools of a node along the trajectories of a scene, a little ahead of its clock."""

import sys
import time
from itertools import pairwise

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.exceptions import NameValidationException
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_full_topic_name import validate_full_topic_name
from rosgraph_msgs.msg import Clock

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_pose
from sand_sim.interruption import Interruption
from sand_sim.node.security import demand_security
from sand_sim.scene.types import Scene, SceneError
from sand_sim.tool_motion.playing import commands_at, driven_tools, frame_times, pose_times

_AHEAD = 0.2  # [s] of simulated time by which poses are sent before they are due
_PATIENCE = 3.0  # [s] of waiting after which it is told what for, and again if that is something else by then


def play(scene: Scene, target: str, frame_id: str, clock_topic: str, interruption: Interruption) -> int:
    """Send all poses of a scene's trajectories, stamped with simulated time.

    Args:
        scene: with trajectories.
        target: name of the node, which is waited for.
        frame_id: frame that the poses are in; empty for the one in which the node tells where its tools are.
        clock_topic: where simulated time is told.
        interruption: the user's wish to stop.

    Returns:
        Exit code: 0 when all has been played, 130 when interrupted.

    Raises:
        SceneError: if there is nothing to play, no node can have that name, simulated time is past all of it, or the node has
            gone before the end; or as ``demand_security``.
    """
    driven = driven_tools(scene)
    for option, name, topic in (("--node", target, f"/{target}"), ("--clock", clock_topic, clock_topic)):
        try:
            validate_full_topic_name(topic)
        except NameValidationException as error:
            raise SceneError(f"{option} '{name}': {' '.join(str(error).split())}") from None
    demand_security()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("sand_sim_player")
    try:
        clock, frame = [None], [frame_id]

        def hear(message: Clock) -> None:
            clock[0] = stamp_to_time(message.clock)

        def hear_pose(message: PoseStamped) -> None:
            frame[0] = frame[0] or message.header.frame_id

        node.create_subscription(Clock, clock_topic, hear, 10)
        node.create_subscription(PoseStamped, f"/{target}/tools/{driven[0]}/pose_actual", hear_pose, 10)
        publishers = {
            name: node.create_publisher(PoseStamped, f"/{target}/tools/{name}/pose", QoSProfile(depth=100)) for name in driven
        }
        ends = [0.0, *frame_times(scene)]
        times = (moment for begin, end in pairwise(ends) for moment in pose_times(scene, begin, end))
        due, begun, told, tell_at = next(times, None), False, "", time.monotonic() + _PATIENCE
        while not interruption.asked:
            rclpy.spin_once(node, timeout_sec=0.05)
            # Matched, not only known: what is sent before that is lost, and the node would wait for it.
            present = all(publisher.get_subscription_count() for publisher in publishers.values())
            if not begun:
                begun = present and clock[0] is not None and bool(frame[0])
                if not begun:
                    if time.monotonic() > tell_at:
                        missing = _missing(target, publishers, clock[0], clock_topic)
                        if missing != told:
                            print(f"sand_sim: waiting for node '{target}': {missing}", file=sys.stderr)
                        told, tell_at = missing, time.monotonic() + _PATIENCE
                    continue
                if clock[0] > scene.duration - 0.5 / scene.frame_rate:
                    raise SceneError(_past(scene, target, clock[0]))
            while due is not None and due < clock[0] + _AHEAD:
                for command in commands_at(scene, due):
                    publishers[command.tool].publish(command_to_pose(command, frame[0]))
                due = next(times, None)
            if clock[0] > scene.duration - 0.5 / scene.frame_rate or (due is None and not present):
                return 0
            if not present:
                raise SceneError(
                    f"node '{target}' has gone, or takes no poses any more, at {clock[0]:.2f} s of {scene.duration:g} s"
                )
        return 130
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _missing(target: str, publishers: dict, now: float | None, clock_topic: str) -> str:
    unheard = [name for name, publisher in publishers.items() if not publisher.get_subscription_count()]
    if unheard:
        return f"nobody hears /{target}/tools/{unheard[0]}/pose"
    return f"nobody tells the time on {clock_topic}" if now is None else "nobody tells where the tools are, in a frame"


def _past(scene: Scene, target: str, now: float) -> str:
    return (
        f"nothing played: simulated time is {now:.2f} s, past the {scene.duration:g} s of scene '{scene.name}'; reset the node "
        f"just before (ros2 service call /{target}/reset std_srvs/srv/Trigger), or let it wait with pacing:=lockstep"
    )
