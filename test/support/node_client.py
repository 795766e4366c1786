"""An independent ROS node that drives the plate of the small scene and hears everything."""

import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_pose
from sand_sim import ToolPose
from sand_sim.tool_motion.playing import commands_at, frame_times

START = np.array([0.015, 0.015, 0.06])
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
PATIENCE = 60.0


class Client:
    """An independent ROS node that drives the plate and hears everything."""

    def __init__(self):
        self.node = rclpy.create_node("test_client")
        self.clocks, self.wrenches, self.clouds, self.diagnostics = [], [], [], []
        for kind, topic, heard in (
            (Clock, "/clock", self.clocks),
            (WrenchStamped, "/sand_sim/tools/plate/wrench", self.wrenches),
            (PointCloud2, "/sand_sim/points", self.clouds),
            (DiagnosticArray, "/diagnostics", self.diagnostics),
        ):
            self.node.create_subscription(kind, topic, heard.append, 100)
        self.poses = self.node.create_publisher(PoseStamped, "/sand_sim/tools/plate/pose", 100)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def wait_for(self, condition, patience=PATIENCE):
        end = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < end, "nothing came of it"
            self.executor.spin_once(timeout_sec=0.02)

    def connect(self):
        """Wait until the node hears us and we hear the node."""
        self.wait_for(lambda: self.poses.get_subscription_count() and self.node.count_publishers("/sand_sim/points"))

    def send(self, position, at=None, frame="world", orientation=NO_TURN):
        self.poses.publish(command_to_pose(ToolPose("plate", np.asarray(position, float), orientation, at), frame))

    def ask(self, kind, name, request=None):
        client = self.node.create_client(kind, f"/sand_sim/{name}")
        self.wait_for(client.service_is_ready)
        return client.call_async(request or kind.Request())

    def call(self, kind, name, request=None):
        future = self.ask(kind, name, request)
        self.wait_for(future.done)
        return future.result()

    @property
    def time(self):
        return stamp_to_time(self.clocks[-1].clock) if self.clocks else -1.0

    def diagnosed(self, key):
        values = {entry.key: entry.value for entry in self.diagnostics[-1].status[0].values} if self.diagnostics else {}
        return values.get(key)

    def close(self):
        self.executor.shutdown()  # it holds on to what it waits for
        self.node.destroy_node()


def ask(client, name, /, **arguments):
    """Ask for a change of the world by its service; whether it was made, and what was said."""
    parameters = [Parameter(argument, value=value).to_parameter_msg() for argument, value in arguments.items()]
    request = SetParametersAtomically.Request(parameters=parameters)
    result = client.call(SetParametersAtomically, name, request).result
    return result.successful, result.reason


def drive(client, scene, begin=0.0, end=None):
    """Send the trajectory of the scene, stamped, frame by frame; what comes back is kept for five frames only."""
    for at in frame_times(scene, end):
        if at < begin + 1e-6:
            continue
        for command in commands_at(scene, at):
            client.poses.publish(command_to_pose(command, "world"))
        client.wait_for(lambda: client.time > at - 1e-6)  # noqa: B023
        client.wait_for(lambda: client.wrenches and stamp_to_time(client.wrenches[-1].header.stamp) > at - 1e-6)  # noqa: B023
