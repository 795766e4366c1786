"""A ROS client that drives the tools of a node along the trajectories of a scene, a little ahead of its clock."""

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_pose
from sand_sim.interruption import Interruption
from sand_sim.playing import commands_at, frame_times
from sand_sim.scene.types import Scene

_AHEAD = 0.2  # [s] of simulated time by which poses are sent before they are due
_FRAME_ID = "world"


def play(scene: Scene, target: str, interruption: Interruption) -> int:
    """Send all poses of a scene's trajectories, stamped with simulated time.

    Args:
        scene: with trajectories.
        target: name of the node, which is waited for.
        interruption: the user's wish to stop.

    Returns:
        Exit code: 0 when all has been played or the node has gone, 130 when interrupted.
    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("sand_sim_player")
    try:
        clock = [None]

        def hear(message: Clock) -> None:
            clock[0] = stamp_to_time(message.clock)

        node.create_subscription(Clock, "/clock", hear, 10)
        topics = {tool.name: f"/{target}/tools/{tool.name}/pose" for tool in scene.tools if tool.trajectory}
        publishers = {name: node.create_publisher(PoseStamped, topic, QoSProfile(depth=100)) for name, topic in topics.items()}
        times = frame_times(scene)
        due, heard = next(times, None), False
        while not interruption.asked:
            rclpy.spin_once(node, timeout_sec=0.05)
            # Matched, not only known: what is sent before that is lost, and the node would wait for it.
            present = all(publisher.get_subscription_count() for publisher in publishers.values())
            heard = heard or (present and clock[0] is not None)
            if heard and (not present or clock[0] > scene.duration - 0.5 / scene.frame_rate):
                return 0
            while heard and due is not None and due < clock[0] + _AHEAD:
                for command in commands_at(scene, due):
                    publishers[command.tool].publish(command_to_pose(command, _FRAME_ID))
                due = next(times, None)
        return 130
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
