"""What drives the tools: poses, velocities, TF or joint states, each from its topic to the simulation."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState

from msg_adapters import tf2_msgs
from msg_adapters.geometry_msgs import pose_to_command, twist_to_command
from msg_adapters.sensor_msgs import joints_to_values
from sand_sim import rotation
from sand_sim.assembly.urdf import parse_robot
from sand_sim.border import CommandError, Frame, Observation, ToolPose
from sand_sim.node.connections import Connections
from sand_sim.node.frames import FrameTree
from sand_sim.node.parameters import Parameters, frame_declarations
from sand_sim.scene.reading_poses import in_degrees
from sand_sim.simulation import Simulation

FOLLOWING = "tf", "joint_states"  # sources that tell frames, one of which is the tool's
_NO_MOVE, _NO_TURN = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])


class ToolInputs:
    """Listens to what shall move the tools.

    Args:
        connections: where subscriptions are made.
        parameters: of the node, those of the tools declared.
        simulation: that gets the commands.
        active: tells whether commands are taken now.
        frames: those that are fixed, from ``fixed_frames``; what TF tells comes to them.
        last: tells what was shown last, None if nothing was.

    Attributes:
        frames: in which poses may be given.

    Raises:
        ValueError: if joint states shall move a tool whose frame is no link of the robot.
    """

    def __init__(
        self,
        connections: Connections,
        parameters: Parameters,
        simulation: Simulation,
        active: Callable[[], bool],
        frames: FrameTree,
        last: Callable[[], Observation | None] = lambda: None,
    ):
        self._parameters, self._simulation, self._active, self._last = parameters, simulation, active, last
        self.frames, self._fixed = frames, frames.names
        self._followers: dict[str, str] = {}
        self._followed: dict[str, float | list[float]] = {}
        names = [tool.name for tool in simulation.world.scene.tools]
        simulation.courses.placed = frozenset(name for name in names if parameters[f"tools.{name}.start"] == "first_pose")
        for name in names:
            self._connect(connections, name)
        if by_joints := [name for name in names if parameters[f"tools.{name}.source"] == "joint_states"]:
            self._robot, self._joints = parse_robot(simulation.world.scene.robot_description), ({}, {})
            for name in by_joints:
                if (link := self._followers[name]) not in self._robot.links:
                    raise ValueError(f"parameter tools.{name}.frame: '{link}' is no link of the robot, so no joint moves it")
            connections.subscription(JointState, "/joint_states", self._hear_joints)
        if tf2_msgs.TFMessage is not None:
            connections.subscription(tf2_msgs.TFMessage, "/tf", lambda message: self._hear_frames(message, False))
            connections.subscription(tf2_msgs.TFMessage, "/tf_static", lambda message: self._hear_frames(message, True), True)

    def _connect(self, connections: Connections, tool: str) -> None:
        source = self._parameters[f"tools.{tool}.source"]
        if source in FOLLOWING:
            self._followers[tool] = self._parameters[f"tools.{tool}.frame"]
        elif source == "twist":
            self._listen(connections, TwistStamped, tool, "twist", self._velocity)
        else:
            self._listen(connections, PoseStamped, tool, "pose", self._pose)

    def _listen(self, connections: Connections, kind: type, tool: str, topic: str, read: Callable) -> None:
        def hear(message) -> None:
            self._submit(lambda: read(message, tool), tool)

        connections.subscription(kind, f"~/tools/{tool}/{topic}", hear)

    def _submit(self, read: Callable, tool: str) -> None:
        try:
            if not self._active():
                raise CommandError("inactive", f"tool '{tool}': the node is inactive; activate it (ros2 lifecycle set)")
            with np.errstate(over="ignore", invalid="ignore"):  # what comes of huge numbers is refused
                command = read()
            if self._parameters["stamps"] == "ignored":
                command = replace(command, time=None)
            self._simulation.submit(command)
        except CommandError as error:
            self._simulation.reject(error)

    def _pose(self, message: PoseStamped, tool: str) -> ToolPose:
        command = pose_to_command(message, tool)
        try:
            position, orientation = self.frames.in_root(message.header.frame_id, command.position, command.orientation)
        except CommandError as error:
            raise CommandError(error.reason, f"tool '{tool}': header.frame_id: {error}") from None
        return replace(command, position=position, orientation=orientation)

    def _velocity(self, message: TwistStamped, tool: str):
        frame = message.header.frame_id
        own = frame in (tool, self._parameters[f"tools.{tool}.frame"])
        command = twist_to_command(message, tool, own)
        if own:
            return command
        try:
            _, turn = self.frames.in_root(frame, _NO_MOVE, _NO_TURN)
        except CommandError as error:
            raise CommandError(error.reason, f"tool '{tool}': header.frame_id: {error}") from None
        return replace(command, linear=rotation.rotate(turn, command.linear), angular=rotation.rotate(turn, command.angular))

    def _hear_frames(self, message, fixed: bool) -> None:
        self._heed(tf2_msgs.message_to_frames(message, fixed))

    def _hear_joints(self, message: JointState) -> None:
        """Joint states may come in parts, from several publishers."""
        told, time = joints_to_values(message)
        own, (values, times) = {joint.name for joint in self._robot.joints.values()}, self._joints
        values |= {name: value for name, value in told.items() if name in own}
        times |= dict.fromkeys(own & told.keys(), time)
        self._heed(self._robot.frames_at(values, times))

    def _heed(self, frames: list[Frame]) -> None:
        told = set()
        for frame in frames:
            if frame.name in self._fixed:
                continue  # what the parameters and the robot description fix stays
            try:
                self.frames.put(frame)
                told.add(frame.name)
            except CommandError as error:
                self._simulation.reject(error)
        for tool, name in self._followers.items():
            self._follow(tool, name, told)

    def _follow(self, tool: str, name: str, told: set[str]) -> None:
        """Command the pose of a frame if news concern it, at the time that they are of."""
        try:
            chain = list(self.frames.chain(name))
        except CommandError:
            return  # not told yet
        times = [frame.time or 0.0 for frame in chain] or [0.0]
        latest = self._newest(times)
        # Of joints, which several may tell of with one stamp, any news count.
        news = times if self._parameters[f"tools.{tool}.source"] == "joint_states" else latest
        if told & {frame.name for frame in chain} and not (latest and news == self._followed.get(tool)):
            self._followed[tool] = news
            self._submit(lambda: ToolPose(tool, *self.frames.in_root(name, _NO_MOVE, _NO_TURN), time=latest or None), tool)

    def _newest(self, times: list[float]) -> float:
        """The newest of the times of frames that hang on each other [s]; those ahead of now do not count beside others.

        Localisation stamps the frame of the odometry a second ahead, because it holds until then, twice a second; with that stamp
        nothing that the arm tells meanwhile would be newer. In lockstep, and by another clock, nobody knows what is ahead.
        """
        last = self._last()
        if last is None or self._simulation.pacing == "lockstep" or self._parameters["stamps"] != "simulated":
            return max(times)
        return max([time for time in times if time <= last.time + self._simulation.frame] or times)


def check_sources(parameters: Parameters, tools: Sequence[str]) -> None:
    """See that all tools can be driven as the parameters ask.

    Raises:
        ValueError: if one is to follow TF and its messages are not installed, or to begin at poses that do not come.
    """
    for tool in tools:
        if parameters[f"tools.{tool}.source"] == "tf" and tf2_msgs.TFMessage is None:
            raise ValueError(f"parameter tools.{tool}.source: 'tf' needs the package tf2_msgs, which is not installed")
        if parameters[f"tools.{tool}.source"] == "joint_states" and not (
            parameters["robot_description"] or parameters["robot_description_topic"]
        ):
            raise ValueError(
                f"parameter tools.{tool}.source: 'joint_states' needs a robot; give robot_description_topic or robot_description"
            )
        if parameters[f"tools.{tool}.source"] == "twist" and parameters[f"tools.{tool}.start"] == "first_pose":
            raise ValueError(f"parameter tools.{tool}.start: 'first_pose' needs poses, and its source is 'twist'; take 'scene'")


def fixed_frames(parameters: Parameters, of_robot: Sequence[Frame] = ()) -> FrameTree:
    """The frames that are where they are from the start.

    Args:
        parameters: of the node.
        of_robot: those of the robot, parents first; what parameters fix, too, is as the parameters say.

    Raises:
        ValueError: if one cannot be.
    """
    tree = FrameTree(parameters["frame_id"])
    names = [name for name in parameters["frame_names"] if name]
    for frame in of_robot:
        if frame.name in names:
            continue
        try:
            tree.put(frame)
        except CommandError as error:
            raise ValueError(f"robot description: {error}") from None
    for name in names:
        parameters.declare(frame_declarations(name))
        pose = np.array(parameters[f"frames.{name}.pose"])
        if doubt := in_degrees(pose[3:].tolist()):
            raise ValueError(f"parameter frames.{name}.pose: roll pitch yaw {doubt}")
        parent = parameters[f"frames.{name}.parent"] or tree.root
        try:
            tree.put(Frame(name, parent, pose[:3], rotation.from_rpy(*pose[3:])))
        except CommandError as error:
            raise ValueError(f"parameter frames.{name}: {error}") from None
    for name in names:
        try:
            list(tree.chain(name))
        except CommandError as error:
            raise ValueError(f"parameter frames.{name}.parent: {error}") from None
    return tree
