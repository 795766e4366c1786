"""The robot that the node is told of, by a parameter or by a topic."""

import time
from collections.abc import Callable

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import String

from sand_sim.assembly.urdf import Robot, parse_robot
from sand_sim.scene.types import SceneError
from sand_sim.showing import shown

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
_PERIOD = 0.05  # [s] between two looks at what else is wanted


def read_robot(node, progress: Callable[[str, float], None]) -> tuple[str, Robot | None]:
    """The robot that the node's parameters describe or name a topic for, and its description; empty and None without.

    Args:
        node: with ``parameters``.
        progress: called with the stage and the share of the time that is over; may raise to give up.

    Raises:
        ValueError: if both are given, or nothing is heard in time.
        SceneError: if what is given is no robot description.
    """
    parameters = node.parameters
    source = "robot_description_topic" if parameters["robot_description_topic"] else "robot_description"
    if source == "robot_description_topic":
        description = _wait_for_description(node, progress)
    else:
        description = parameters["robot_description"]
        if not description:
            return "", None
    try:
        robot = parse_robot(description)
    except SceneError as error:
        raise SceneError(f"parameter {source}: the robot description {error}") from None
    if robot.root not in (parameters["frame_id"], *parameters["frame_names"]):
        root = shown(robot.root)
        node.get_logger().warning(
            f"where the robot's root '{root}' lies in '{parameters['frame_id']}' is not known unless TF tells it; put it into "
            f"the parameter frame_names and give frames.{root}.pose to take poses in the robot's frames"
        )
    return description, robot


def _wait_for_description(node, progress: Callable[[str, float], None]) -> str:
    parameters, name = node.parameters, node.parameters["robot_description_topic"]
    if parameters["robot_description"]:
        raise ValueError("parameter robot_description_topic: give either this one or robot_description, not both")
    try:
        validate_topic_name(name)
    except NameValidationException as error:
        raise ValueError(f"parameter robot_description_topic: {' '.join(str(error).split())}") from None
    topic, patience = node.resolve_topic_name(name), parameters["robot_description_timeout"]
    node.get_logger().info(f"waiting up to {patience:g} s for the robot description on {topic}")
    heard = _hear(node, topic, patience, progress)
    if not heard:
        raise ValueError(
            f"parameter robot_description_topic: nothing was heard on {topic} for {patience:g} s; start robot_state_publisher "
            "before, give another topic, or raise robot_description_timeout"
        )
    return heard[0].data


def _hear(node: Node, topic: str, patience: float, progress: Callable[[str, float], None]) -> list[String]:
    """The first message, if one comes; heard by a node of its own, because the node's executor is busy with us."""
    heard: list[String] = []
    listener = rclpy.create_node(
        f"{node.get_name()}_listener",
        context=node.context,
        namespace=node.get_namespace(),
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
    )
    executor = SingleThreadedExecutor(context=node.context)
    try:
        listener.create_subscription(String, topic, heard.append, _LATCHED)
        executor.add_node(listener)
        begin = time.monotonic()
        while not heard and (waited := time.monotonic() - begin) < patience:
            progress("waiting for the robot description", waited / patience)
            executor.spin_once(timeout_sec=min(_PERIOD, patience - waited))
        return heard
    finally:
        executor.shutdown()
        listener.destroy_node()
