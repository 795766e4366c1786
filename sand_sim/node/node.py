"""The ROS 2 node ``sand_sim``: poses in, wrenches and clouds out, around a ``Simulation``."""

import concurrent.futures
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool, Trigger

from msg_adapters.builtin_interfaces import time_to_stamp
from msg_adapters.diagnostic_msgs import health_to_diagnostics
from msg_adapters.geometry_msgs import pose_to_command, report_to_wrench
from msg_adapters.sensor_msgs import grains_to_cloud
from sand_sim.border import CommandError, Observation
from sand_sim.config_folder import find_scene
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.node.parameters import declare_parameters, read_parameters
from sand_sim.report import progress_line
from sand_sim.scene.reading import load_scene
from sand_sim.simulation import Simulation
from sand_sim.sinks.recorder import Recorder
from sand_sim.world import World

OUTPUT = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=5)
COMMANDS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=100)
_DIAGNOSTICS_PERIOD = 1.0  # [s] wall
_PROGRESS_PERIOD = 5.0  # [s] wall
_COARSE_POINTS = 0.01  # resolution of points over the smallest radius


class SandSimNode(Node):
    """Hosts a world.

    Args:
        progress: called with the name of a stage of the preparation and the share of it that is done; may raise to give up.

    Raises:
        SceneError: if the scene cannot be made into a world.
        ValueError: if a parameter has no sensible value.

    Attributes:
        simulation: the running world.
        recorder: what the run leaves behind.
        done: whether the asked duration has been reached, or the run has blown up and shall end then.
    """

    def __init__(self, progress=lambda stage, share: None, **node_arguments):
        super().__init__("sand_sim", **node_arguments)
        try:
            self._prepare(progress)
        except BaseException:
            self.destroy_node()  # else its share of the middleware outlives it
            raise

    def _prepare(self, progress) -> None:
        declare_parameters(self)
        self._settings = settings = read_parameters(self)
        scene = load_scene(find_scene(settings["scene"]))
        if settings["threads"]:
            scene = replace(scene, solver=replace(scene.solver, threads=settings["threads"]))
        world = World(scene, progress)
        self.recorder = Recorder(
            world, _path(settings["recording"]), _path(settings["output"]), settings["view"], settings["particles"]
        )
        self.done = False
        self._next_points, self._told = 0.0, time.monotonic()
        self._last: Observation | None = None
        self.simulation = Simulation(
            world,
            settings["pacing"],
            settings["real_time_factor"],
            on_frame=self._publish,
            on_fault=self._fail,
            on_reject=lambda error: self.get_logger().warning(f"rejected: {error}", throttle_duration_sec=1.0),
        )
        self._advertise()
        if world.assembly.time_step.warning:
            self.get_logger().warning(world.assembly.time_step.warning)
        self._warn_of_coarse_points(world)
        self.simulation.pause(settings["paused"])
        self.simulation.start()
        self.get_logger().info(f"scene '{scene.name}' is ready, pacing {settings['pacing']}")

    def close(self) -> None:
        """Stop stepping and finish all files."""
        self.simulation.stop()
        for path in self.recorder.close():
            self.get_logger().info(f"written {path}")

    def _advertise(self) -> None:
        options = {"qos_overriding_options": QoSOverridingOptions.with_default_policies()}
        self._clock_publisher = self.create_publisher(Clock, "/clock", OUTPUT, **options)
        self._points = self.create_publisher(PointCloud2, "~/points", OUTPUT, **options)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", OUTPUT, **options)
        self._wrenches = {}
        for tool in self.simulation.world.scene.tools:
            topic = f"~/tools/{tool.name}"
            self._wrenches[tool.name] = self.create_publisher(WrenchStamped, f"{topic}/wrench", OUTPUT, **options)

            def hear(message: PoseStamped, name: str = tool.name) -> None:
                self._hear_pose(message, name)

            self.create_subscription(PoseStamped, f"{topic}/pose", hear, COMMANDS, **options)
        self.create_service(Trigger, "~/reset", self._reset)
        self.create_service(SetBool, "~/pause", self._pause)
        self.create_service(Trigger, "~/step", self._step)
        self.create_timer(_DIAGNOSTICS_PERIOD, self._diagnose)

    def _hear_pose(self, message: PoseStamped, tool: str) -> None:
        frame = self._settings["frame_id"]
        try:
            if message.header.frame_id != frame:
                raise CommandError(
                    "unknown_frame",
                    f"tool '{tool}': header.frame_id '{message.header.frame_id}' is unknown; give the pose in '{frame}'",
                )
            self.simulation.submit(pose_to_command(message, tool))
        except CommandError as error:
            self.simulation.reject(error)

    def _publish(self, observation: Observation) -> None:
        """Called in the stepping thread at the end of each frame."""
        self._last = observation
        if observation.steps == 0:
            self._next_points = 0.0
        self._publish_state(observation)
        rate = self.get_parameter("points_rate").value
        if rate > 0.0 and observation.time >= self._next_points - 1e-9:
            self._next_points = max(self._next_points + 1.0 / rate, observation.time)
            self._publish_points(observation)
        self.recorder.write(observation)
        if time.monotonic() - self._told > _PROGRESS_PERIOD:
            self._told = time.monotonic()
            self.get_logger().info(progress_line(self.recorder.log))
        duration = self._settings["duration"]
        self.done = self.done or bool(duration and observation.time > duration - 0.5 * self.simulation.frame)

    def _warn_of_coarse_points(self, world: World) -> None:
        """Messages hold points in single precision, which far from the origin is coarser than the simulation."""
        lattice, smallest = world.assembly.lattice, min(world.assembly.smallest.values())
        resolution = float(np.spacing(np.float32(np.abs([lattice.low, lattice.high]).max())))
        if resolution > _COARSE_POINTS * smallest:
            self.get_logger().warning(
                f"this far from the origin ~/points are rounded to {resolution:.2g} m, the simulation is not; "
                "put the scene nearer to the origin of its frame"
            )

    def _publish_state(self, observation: Observation) -> None:
        self._clock_publisher.publish(Clock(clock=time_to_stamp(observation.time)))
        for report in observation.tools:
            self._wrenches[report.name].publish(report_to_wrench(report, observation.time))

    def _publish_points(self, observation: Observation) -> None:
        decimation = self.get_parameter("points_decimation").value
        cloud = grains_to_cloud(observation.spheres, observation.time, self._settings["frame_id"], decimation)
        self._points.publish(cloud)

    def _fail(self, error: Exception) -> None:
        """Called in the stepping thread; the world is back in its last good state."""
        if isinstance(error, UnstableError):
            self._last = self.simulation.world.observe()
        self.recorder.log.fault = str(error)
        self.get_logger().error(f"stepping has stopped: {error}")
        self.done = self.done or self._settings["end_on_fault"]

    def _diagnose(self) -> None:
        if self._last is None:
            return
        simulation, log = self.simulation, self.recorder.log
        further = {
            "real-time factor": f"{log.real_time_factor:.4f}",
            "poses slowed to max_speed": str(simulation.courses.limited),
            "commands rejected": str(sum(simulation.rejected.values())),
            "last rejection": simulation.last_rejection,
        } | {f"commands rejected: {reason}": str(count) for reason, count in simulation.rejected.items()}
        device = simulation.world.assembly.solver.device.label
        message = health_to_diagnostics(self._last.health, self._last.time, f"{self.get_name()}: world", device, further)
        if simulation.fault is not None:
            message.status[0].level = DiagnosticStatus.ERROR
            message.status[0].message = f"stepping has stopped: {simulation.fault}"
            # Whoever comes now still sees the last good state.
            self._publish_state(self._last)
            self._publish_points(self._last)
        self._diagnostics.publish(message)

    async def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return await self._answer(self.simulation.reset(), response)

    async def _step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return await self._answer(self.simulation.step(), response)

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.simulation.pause(request.data)
        response.success, response.message = True, "paused" if request.data else "running"
        return response

    async def _answer(self, request: concurrent.futures.Future, response: Trigger.Response) -> Trigger.Response:
        """Answer a service when the stepping thread has done what it asks; other callbacks run meanwhile."""
        finished = Future(executor=self.executor)
        request.add_done_callback(lambda done: finished.set_result(None if done.cancelled() else done.exception() or True))
        outcome = await finished
        response.success = outcome is True
        response.message = f"t = {self._last.time:.6f} s" if response.success else str(outcome or "shutting down")
        return response


def _path(text: str) -> Path | None:
    return Path(text).expanduser() if text else None
