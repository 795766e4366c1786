"""What is told of the tools every frame: wrenches, poses, what they carry, and their contacts if anyone listens."""

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

from msg_adapters.geometry_msgs import arrays_to_wrench, report_to_pose
from msg_adapters.sensor_msgs import columns_to_cloud
from msg_adapters.visualization_msgs import contacts_to_markers
from sand_sim import rotation
from sand_sim.border import Frame, Observation, ToolContacts, ToolReport
from sand_sim.node.connections import Connections
from sand_sim.node.low_pass import LowPass
from sand_sim.node.parameters import Parameters
from sand_sim.node.rate import Rate
from sand_sim.node.tool_inputs import FOLLOWING
from sand_sim.world import World

_WEIGHTS_PER_DIAMETER = 20.0  # a force of so many grain weights is drawn as long as a grain is wide


class ToolOutputs:
    """Publishes for one tool.

    Args:
        connections: where publishers are made.
        parameters: of the node, those of the tool declared.
        world: it is in.
        tool: its name.
    """

    def __init__(self, connections: Connections, parameters: Parameters, world: World, tool: str):
        topic = f"~/tools/{tool}"
        self._parameters, self._world, self._tool = parameters, world, tool
        self._wrench = connections.publisher(WrenchStamped, f"{topic}/wrench")
        self._filtered = connections.publisher(WrenchStamped, f"{topic}/wrench_filtered")
        self._pose = connections.publisher(PoseStamped, f"{topic}/pose_actual")
        self._carried = connections.publisher(Float64, f"{topic}/carried")
        self._swept = connections.publisher(Float64, f"{topic}/swept")
        self._contacts = connections.publisher(PointCloud2, f"{topic}/contacts")
        self._markers = connections.publisher(MarkerArray, f"{topic}/contact_markers")
        self._contacts_rate = Rate()
        self._filter, self._filtered_at = LowPass(parameters["wrench_cutoff"]), -np.inf
        self._told: Observation | None = None
        cloud = world.observe().grains
        self._diameter = 2.0 * float(np.median(cloud.radius)) if len(cloud) else 0.01
        weight = float(np.median(cloud.mass)) * max(float(np.linalg.norm(world.scene.gravity)), 1.0) if len(cloud) else 1.0
        self._force_scale = self._diameter / (_WEIGHTS_PER_DIAMETER * weight)

    def publish(self, observation: Observation) -> None:
        """Tell all; called in the stepping thread once a frame."""
        time, report = observation.time, observation.tool(self._tool)
        # Where grains are added at the end of a frame it is seen anew, but whoever sums up impulses must not count it again.
        if observation is self._told or time != self._filtered_at:
            self._publish_wrenches(report, time)
        self._told = observation
        self.tell_pose(observation)
        self._carried.publish(Float64(data=report.carried))
        self._swept.publish(Float64(data=report.swept))
        heard = self._contacts.get_subscription_count(), self._markers.get_subscription_count()
        if any(heard) and self._contacts_rate.due(time, self._parameters["contacts_rate"]):
            self._publish_contacts(self._world.tool_contacts(self._tool), time, *heard)

    def tell_pose(self, observation: Observation) -> None:
        """Tell where the tool is."""
        self._pose.publish(report_to_pose(observation.tool(self._tool), observation.time, self._parameters["frame_id"]))

    def frame(self, observation: Observation) -> Frame:
        """Where the tool is, for TF."""
        report = observation.tool(self._tool)
        world = self._parameters["frame_id"]
        return Frame(self._frame_id, world, report.position, report.orientation, observation.time)

    @property
    def follows(self) -> bool:
        """Whether others tell its frame, so that we must not: it follows one, or the frame is that of a link of a robot."""
        link = self._world.scene.tool(self._tool).link
        return self._parameters[f"tools.{self._tool}.source"] in FOLLOWING or self._frame_id == link

    @property
    def _frame_id(self) -> str:
        return self._parameters[f"tools.{self._tool}.frame"]

    def _publish_wrenches(self, report: ToolReport, time: float) -> None:
        """Mean over the frame, and filtered: in the axes of the world, which do not turn, before it is turned into the tool's."""
        wrench = np.array([report.world_force, report.world_torque])
        filtered = self._filter_at(time, wrench)
        frame_id = self._parameters["frame_id"]
        if self._parameters[f"tools.{self._tool}.wrench_frame"] == "tool":
            filtered = rotation.rotate(rotation.inverse(report.orientation), filtered)
            frame_id, wrench = self._frame_id, (report.force, report.torque)
        self._wrench.publish(arrays_to_wrench(*wrench, time, frame_id))
        self._filtered.publish(arrays_to_wrench(*filtered, time, frame_id))

    def _filter_at(self, time: float, wrench: np.ndarray) -> np.ndarray:
        if time < self._filtered_at:
            self._filter.reset()
        self._filter.cutoff = self._parameters["wrench_cutoff"]
        filtered = self._filter.filter(wrench, max(time - self._filtered_at, 0.0))
        self._filtered_at = time
        return filtered

    def _publish_contacts(self, contacts: ToolContacts, time: float, cloud: bool, markers: bool) -> None:
        frame_id = self._parameters["frame_id"]
        if cloud:
            vectors = {"": contacts.point, "f": contacts.force, "n": contacts.normal}
            columns = {f"{head}{axis}": values[:, k] for head, values in vectors.items() for k, axis in enumerate("xyz")}
            columns |= {"overlap": contacts.overlap, "id": contacts.identity.astype(np.uint32)}
            self._contacts.publish(columns_to_cloud(columns, time, frame_id))
        if markers:
            scale = self._parameters["force_scale"] or self._force_scale
            self._markers.publish(contacts_to_markers(contacts, time, frame_id, scale, 0.3 * self._diameter))
