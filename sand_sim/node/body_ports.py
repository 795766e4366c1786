"""What is told of free rigid bodies every frame, and what pushes them."""

import re
from collections.abc import Callable
from concurrent.futures import Future

import numpy as np
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry

from msg_adapters.geometry_msgs import wrench_to_arrays
from msg_adapters.nav_msgs import body_to_odometry
from sand_sim import rotation
from sand_sim.assembly.body_model import BodyModel
from sand_sim.border import BodyReport, CommandError, Frame, Observation
from sand_sim.node.connections import Connections
from sand_sim.node.frames import FrameTree
from sand_sim.node.parameters import Parameters
from sand_sim.simulation import Simulation

_NO_MOVE, _NO_TURN = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])


class BodyPorts:
    """Publishes for one body, and listens to what shall push it.

    Args:
        connections: where publisher and subscription are made.
        parameters: of the node, those of the tools declared.
        simulation: whose world it is in.
        active: tells whether commands are taken now.
        frames: in which pushes may be given.
        model: the body.
    """

    follows = False  # nobody else tells its frame

    def __init__(
        self,
        connections: Connections,
        parameters: Parameters,
        simulation: Simulation,
        active: Callable[[], bool],
        frames: FrameTree,
        model: BodyModel,
    ):
        self._parameters, self._simulation, self._active, self._frames = parameters, simulation, active, frames
        self._model, self._turn, name = model, np.asarray(model.body.pose.orientation), model.body.name
        of_tools = (parameters[f"tools.{tool.name}.frame"] for tool in simulation.world.scene.tools)
        taken = {parameters["frame_id"], *frames.names, *of_tools}
        self._frame_id = f"bodies/{name}" if name in taken else name
        topic = f"~/bodies/{topic_part(name)}"
        self._odometry = connections.publisher(Odometry, f"{topic}/odometry")
        connections.subscription(WrenchStamped, f"{topic}/push", self._hear)

    def publish(self, observation: Observation) -> None:
        """Tell where it is and how it moves, unless it has left the domain; called in the stepping thread once a frame."""
        if report := self._report(observation):
            self._turn = report.orientation
            velocity = report.velocity - self._model.lead(report.spin, report.orientation)
            twist = rotation.rotate(rotation.inverse(report.orientation), np.array([velocity, report.spin]))
            world = self._parameters["frame_id"]
            self._odometry.publish(body_to_odometry(report, twist, observation.time, world, self._frame_id))

    tell_pose = publish

    def frame(self, observation: Observation) -> Frame | None:
        """Where it is, for TF; None once it has left the domain."""
        if report := self._report(observation):
            world = self._parameters["frame_id"]
            return Frame(self._frame_id, world, report.position, report.orientation, observation.time)
        return None

    def _report(self, observation: Observation) -> BodyReport | None:
        return next((report for report in observation.bodies if report.name == self._model.body.name), None)

    def _hear(self, message: WrenchStamped) -> None:
        name, frame = self._model.body.name, message.header.frame_id
        try:
            if not self._active():
                raise CommandError("inactive", f"body '{name}': the node is inactive; activate it (ros2 lifecycle set)")
            turn = None if frame == self._frame_id else self._turn_of(frame)
        except CommandError as error:
            self._simulation.reject(error)
            return
        wrench = np.array(wrench_to_arrays(message))

        def act() -> None:
            if self._simulation.fault is not None:
                raise CommandError("stopped", f"body '{name}': stepping has stopped, reset to go on")
            # The body's own axes as they are now: only this thread turns them.
            self._simulation.world.push_body(name, *rotation.rotate(self._turn if turn is None else turn, wrench))

        self._simulation.request(act).add_done_callback(self._heed)

    def _turn_of(self, frame: str) -> np.ndarray:
        try:
            return self._frames.in_root(frame, _NO_MOVE, _NO_TURN)[1]
        except CommandError as error:
            raise CommandError(error.reason, f"body '{self._model.body.name}': header.frame_id: {error}") from None

    def _heed(self, done: Future) -> None:
        if not done.cancelled() and isinstance(error := done.exception(), CommandError):
            self._simulation.reject(error)


def body_ports(
    connections: Connections, parameters: Parameters, simulation: Simulation, active: Callable[[], bool], frames: FrameTree
) -> list[BodyPorts]:
    """Ports for each body of the scene; arguments as of ``BodyPorts``.

    Raises:
        ValueError: if two bodies would share their topics, naming both.
    """
    models, of_part = simulation.world.assembly.bodies, {}
    for name in (model.body.name for model in models):
        if (first := of_part.setdefault(topic_part(name), name)) != name:
            raise ValueError(f"scene: bodies '{first}' and '{name}' would share '~/bodies/{topic_part(name)}'; rename one")
    return [BodyPorts(connections, parameters, simulation, active, frames, model) for model in models]


def topic_part(name: str) -> str:
    """A name as a part of topics: what is no letter of ASCII, digit or underscore becomes an underscore."""
    part = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{part}" if part[:1].isdigit() or not part else part
