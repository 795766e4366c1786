"""The ROS 2 node ``sand_sim``: a lifecycle node around a ``Simulation``."""

import time
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rosgraph_msgs.msg import Clock

from msg_adapters import simulation_interfaces, tf2_msgs
from msg_adapters.builtin_interfaces import time_to_stamp
from sand_sim.border import Observation
from sand_sim.checkpoints import CheckpointFolder
from sand_sim.config_folder import find_scene
from sand_sim.courses import StampRules
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.node.bed_outputs import BedOutputs, coarse_points
from sand_sim.node.body_ports import body_ports
from sand_sim.node.change_services import ChangeServices
from sand_sim.node.connections import Connections
from sand_sim.node.diagnosis import Diagnosis
from sand_sim.node.frames import FrameTree
from sand_sim.node.graph_watch import GraphWatch
from sand_sim.node.managed_node import ManagedNode
from sand_sim.node.parameters import Parameters, tool_declarations
from sand_sim.node.robot import read_robot
from sand_sim.node.run_files import RunFiles
from sand_sim.node.services import Services
from sand_sim.node.shape_outputs import ShapeOutputs
from sand_sim.node.simulation_services import SimulationServices
from sand_sim.node.tool_inputs import ToolInputs, check_sources, fixed_frames
from sand_sim.node.tool_outputs import ToolOutputs
from sand_sim.report import progress_line
from sand_sim.scene.reading import load_scene
from sand_sim.simulation import Simulation
from sand_sim.sinks.recorder import Recorder, require_rerun
from sand_sim.world import World

_DIAGNOSTICS_PERIOD = 1.0  # [s] wall
_PROGRESS_PERIOD = 5.0  # [s] wall
_DONE, _REFUSED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class SandSimNode(ManagedNode):
    """Hosts a world while it is configured; the world moves while the node is active.

    Args:
        progress: called with the name of a stage of the preparation and the share of it that is done; may raise to give up.

    Raises:
        ValueError: if a parameter has no sensible value.

    Attributes:
        configured: whether there is a world.
        done: whether the asked duration has been reached, or the run has blown up and shall end then.
        incomplete: whether files were asked for that could not be written, or not whole.
        failure: why the last transition failed, None if it did not.
        simulation, recorder: the running world and what it leaves behind, while the node is configured.
    """

    def __init__(self, progress=lambda stage, share: None, **node_arguments):
        super().__init__("sand_sim", **node_arguments)
        self.configured = self.done = self.incomplete = self._active = self._held = self._starting = False
        self.failure: Exception | None = None
        self._progress, self._endings, self._files = progress, ExitStack(), RunFiles(self.get_logger().info)
        try:
            self.parameters = Parameters(self)
        except BaseException:
            self.destroy_node()  # else its share of the middleware outlives it
            raise

    def start(self) -> None:
        """Configure and activate.

        Raises:
            SceneError: if the scene cannot be made into a world.
            ValueError: if a parameter has no sensible value.
            Exception: whatever ``progress`` raises.
        """
        self._starting = True
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != _DONE:
                raise self.failure
        self._starting = False

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the scene, compile, settle, connect."""
        self.failure = None
        try:
            self._configure()
        except Exception as error:
            self.failure = error
            if not self._starting:  # else it is raised
                self.get_logger().error(f"cannot be configured: {error}")
            self._tear_down()
            return _REFUSED
        return _DONE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Step, unless the run is paused."""
        self._active = True
        self.hold(self._held)
        return _DONE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hold the world and take no commands."""
        self._active = False
        self.hold(self._held)
        return _DONE

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Finish all files and let go of the world."""
        self._tear_down()
        return _DONE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As cleaning up; the process ends then."""
        self._tear_down()
        self.done = True
        return _DONE

    def destroy_node(self) -> None:
        """Finish all files, then go."""
        self._tear_down()
        super().destroy_node()
        self._state_machine = None  # it keeps the node in the graph, and cycles keep it

    @property
    def refusal(self) -> str:
        """Why services do nothing now, empty while the node is active."""
        return "" if self._active else "the node is inactive; activate it (ros2 lifecycle set)"

    def hold(self, paused: bool) -> None:
        """Hold stepping or go on; it is also held while the node is inactive."""
        self._held, still = paused, paused or not self._active
        if still and not self.simulation.paused:
            self._still_since = time.monotonic()
        elif self.simulation.paused and not still:
            self.recorder.log.leave_out(self._still_since)
        self.simulation.pause(still)

    def parameters_changed(self) -> None:
        """Called after parameters have been set."""
        if self.configured:
            self.simulation.set_pacing(self.parameters["pacing"], self.parameters["real_time_factor"])
            self.simulation.courses.rules = self._rules()

    def _rules(self) -> StampRules:
        names = {"oldest": "stamp_oldest", "furthest": "stamp_furthest", "gap": "stream_gap", "hold": "velocity_hold"}
        numbers = {field: self.parameters[name] for field, name in names.items()}
        return StampRules(**numbers, relative=self.parameters["stamps"] == "relative")

    def _configure(self) -> None:
        parameters = self.parameters
        for warning in filter(None, (parameters.unsaid(), parameters.unfollowed())):
            self.get_logger().warning(warning)
        scene = load_scene(find_scene(parameters["scene"]))
        if parameters["threads"]:
            scene = replace(scene, solver=replace(scene.solver, threads=parameters["threads"]))
        for tool in scene.tools:
            parameters.declare(tool_declarations(tool.name, tool.link))
        # What can be refused is refused before meshes are sampled and the bed settles, which may take minutes.
        tools = [tool.name for tool in scene.tools]
        parameters.check_frames(tools)
        check_sources(parameters, tools)
        description, robot = read_robot(self, self._progress)
        checkpoints = self._open_checkpoints(scene.name)
        if parameters["recording"] or parameters["view"]:
            require_rerun()
        frames = fixed_frames(parameters, robot.fixed_frames() if robot else [])
        scene = replace(scene, robot_description=description, mesh_roots=tuple(parameters["mesh_roots"]))
        world = World(scene, self._progress)
        recording, output = self._files.places(parameters, scene.name)
        self.recorder = Recorder(world, recording, output, parameters["view"], parameters["particles"], self.get_logger().warning)
        self._endings.callback(self._finish_files)
        self.simulation = Simulation(
            world,
            parameters["pacing"],
            parameters["real_time_factor"],
            on_frame=self._show,
            on_fault=self._fail,
            on_reject=lambda error: self.get_logger().warning(f"rejected: {error}", throttle_duration_sec=1.0),
            rules=self._rules(),
            checkpoints=checkpoints,
            pack_history=lambda: self.recorder.log.pack(),  # noqa: PLW0108 - the log is another one after a reset
            unpack_history=lambda packed: self.recorder.log.unpack(packed),  # noqa: PLW0108
        )
        self._last = self._diagnosed = None
        self._told = time.monotonic()
        self._connect(world, frames)
        self._endings.callback(self.simulation.stop)  # before what it publishes to goes
        if parameters["resume"]:
            self.simulation.resume()
        for warning in (*world.warnings, *coarse_points(world)):
            self.get_logger().warning(warning)
        for name, similar in parameters.misspelt().items():
            self.get_logger().warning(f"there is no parameter '{name}'" + (f"; is '{similar}' meant?" if similar else ""))
        self.configured = True
        self.hold(parameters["paused"])
        self.simulation.start()
        self.get_logger().info(f"scene '{scene.name}' is ready, pacing {parameters['pacing']}")

    def _open_checkpoints(self, scene: str) -> CheckpointFolder | None:
        parameters = self.parameters
        if not (parameters["checkpoints"] or parameters["resume"]):
            return None
        period = parameters["checkpoint_period"] if parameters["checkpoints"] else np.inf
        folder, logger = Path(expanduser(parameters["states"])), self.get_logger()
        checkpoints = CheckpointFolder(folder, scene, period, logger.info, logger.warning)
        self._endings.callback(checkpoints.close)
        if checkpoints.files() and not parameters["resume"]:
            logger.warning(
                f"{folder} holds checkpoints of an earlier run, which this one replaces; resume:=true goes on from them"
            )
        return checkpoints

    def _connect(self, world: World, frames: FrameTree) -> None:
        parameters, connections = self.parameters, Connections(self, in_haste=lambda: self.simulation.pacing == "lockstep")
        self._endings.callback(connections.close)
        self._clock_publisher = connections.publisher(Clock, "/clock") if parameters["publish_clock"] else None
        self._diagnostics = connections.publisher(DiagnosticArray, "/diagnostics")
        self._frames = connections.publisher(tf2_msgs.TFMessage, "/tf") if tf2_msgs.TFMessage else None
        tools = [ToolOutputs(connections, parameters, world, tool.name) for tool in world.scene.tools]
        self._shapes = ShapeOutputs(connections, parameters, world)
        self._bed = BedOutputs(connections, parameters, world, self._complain)
        self._endings.callback(self._bed.close)
        shared = connections, parameters, self.simulation, lambda: self._active, frames
        ToolInputs(*shared, lambda: self._last)
        self._movers = [*tools, *body_ports(*shared)]
        self.answering = Services(self, connections, self.simulation, self.hold)
        ChangeServices(connections, self.answering, self.simulation, Path(expanduser(parameters["states"])))
        if simulation_interfaces.srv is None:
            self.get_logger().info("simulation_interfaces is not installed: its services are absent", once=True)
        else:
            SimulationServices(self, connections, self.answering, self.simulation, frames, lambda: self._last)
        name = self.get_fully_qualified_name().lstrip("/")
        self._diagnosis = Diagnosis(self.simulation, name, self.get_logger().warning)
        self._watch = GraphWatch(self, parameters, [tool.name for tool in world.scene.tools])
        connections.timer(_DIAGNOSTICS_PERIOD, self._diagnose)

    def _tear_down(self) -> None:
        """Stop stepping, finish all files, and let go of everything that belongs to a world."""
        self._active = self.configured = False
        self._endings.close()
        # The node may go on for long: what it still held would keep the world's memory and its threads.
        self.simulation = self.recorder = self.answering = self._last = self._diagnosed = None
        self._movers, self._shapes, self._bed, self._diagnosis, self._watch = [], None, None, None, None

    def _finish_files(self) -> None:
        for path in self.recorder.close():
            self._files.add(path)
            self.get_logger().info(f"written {path}")
        self.incomplete = self.incomplete or bool(self.recorder.failed)

    def _show(self, observation: Observation) -> None:
        """Called in the stepping thread at the end of each frame."""
        self._last = observation
        self._publish_state(observation)
        self._bed.publish(observation)
        self.recorder.write(observation)
        if time.monotonic() - self._told > _PROGRESS_PERIOD:
            self._told = time.monotonic()
            self.get_logger().info(progress_line(self.recorder.log))
        duration = self.parameters["duration"]
        if duration and observation.time > duration - 0.5 * self.simulation.frame:
            self.done = True
            self.hold(True)  # else it goes on until the process ends, now so far and now so far

    def _publish_clock(self, observation: Observation) -> None:
        if self._clock_publisher:
            self._clock_publisher.publish(Clock(clock=time_to_stamp(observation.time)))

    def _publish_state(self, observation: Observation) -> None:
        self._publish_clock(observation)
        for mover in self._movers:
            mover.publish(observation)
        self._shapes.publish(observation)
        self._publish_frames(observation)

    def _publish_frames(self, observation: Observation) -> None:
        if self._frames:
            self._frame_readers = self._frames.get_subscription_count()
            frames = [mover.frame(observation) for mover in self._movers if not mover.follows]
            self._frames.publish(tf2_msgs.frames_to_message(filter(None, frames)))

    def _complain(self, error: Exception) -> None:
        if self.context.ok():
            self.get_logger().error(f"a cloud could not be told: {error}", throttle_duration_sec=10.0)

    def _fail(self, error: Exception) -> None:
        """Called in the stepping thread; the world is back in its last good state."""
        if isinstance(error, UnstableError):
            self._last = self.simulation.world.observe()
        elif not self.context.ok():
            return  # whoever hosts the node has shut ROS down: nobody hears any more, and the run is none the worse
        self.recorder.log.fault = str(error)
        self.get_logger().error(f"stepping has stopped: {error}")
        self.done = self.done or self.parameters["end_on_fault"]

    def _diagnose(self) -> None:
        if self._last is None:
            return
        self._diagnostics.publish(self._diagnosis.tell(self._last, self._bed.dropped, self.recorder.troubles))
        self._watch.look()
        self._shapes.tell(self._last)
        # Whoever comes while nothing moves still sees where it stands.
        if self.simulation.fault is not None:
            self._publish_state(self._last)
            self._bed.tell(self._last)
        elif self._last is self._diagnosed:
            self.simulation.request(partial(self._repeat, self._last))  # where what follows is told: time never runs back
        self._diagnosed = self._last

    def _repeat(self, observation: Observation) -> None:
        """Tell again the time, the bed and where the tools are, but no wrenches, of which each stamp is told once.

        Frames are told again only to new readers, because TF complains of each that it has heard already.
        """
        if observation is self._last:
            self._publish_clock(observation)
            for mover in self._movers:
                mover.tell_pose(observation)
            if self._frames and self._frames.get_subscription_count() != self._frame_readers:
                self._publish_frames(observation)
            self._bed.tell(observation)
