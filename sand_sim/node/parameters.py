"""The node's parameters: one table, declared with descriptions and ranges, and what may change when."""

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from msg_adapters.sensor_msgs import POINT_FIELDS, USUAL_FIELDS
from sand_sim.simulation import PACINGS

_OF_ROS = ("use_sim_time", "start_type_description_service")
SOURCES = ("pose", "twist", "tf", "joint_states")
STARTS = ("scene", "first_pose")
WRENCH_FRAMES = ("tool", "world")
_SCENE = "dig"


@dataclass(frozen=True)
class Declaration:
    """One parameter.

    Attributes:
        name: of the parameter.
        default: gives its type, too.
        description: shown by ``ros2 param describe``.
        low, high: inclusive range of a number.
        choices: allowed texts, of a list for each of its entries.
        changeable: at any time; all others only while the node is unconfigured.
    """

    name: str
    default: Any
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    changeable: bool = False


DECLARATIONS = (
    Declaration("autostart", True, "Configure and activate at once; otherwise wait for lifecycle transitions."),
    Declaration("scene", _SCENE, "Scene file, or the name of one of the package's own scenes."),
    Declaration("pacing", "realtime", "How simulated time advances.", choices=PACINGS, changeable=True),
    Declaration("real_time_factor", 1.0, "Simulated over wall seconds in realtime pacing [1].", 0.001, 1000.0, changeable=True),
    Declaration("frame_id", "world", "Name of the world frame in all messages."),
    Declaration("frame_names", [""], "Names of fixed frames that poses may be given in; each has frames.NAME.pose and .parent."),
    Declaration("robot_description", "", "URDF whose links tools may be and whose fixed frames poses may be given in."),
    Declaration("robot_description_topic", "", "Topic that tells the URDF instead, such as /robot_description."),
    Declaration("robot_description_timeout", 10.0, "How long to wait for the topic when configuring [s].", 0.0, 1.0e6),
    Declaration("mesh_roots", [""], "Folders for meshes of robot descriptions; '' for the usual ones and all ROS packages."),
    Declaration("publish_clock", True, "Publish simulated time on /clock; false beside another source of it."),
    Declaration("stamps", "simulated", "What stamps of commands mean.", choices=("simulated", "relative", "ignored")),
    Declaration("stamp_oldest", 0.5, "How far a stamp may lie behind simulated time [s].", 0.0, 1.0e9, changeable=True),
    Declaration("stamp_furthest", 60.0, "How far a stamp may lie ahead of simulated time [s].", 0.0, 1.0e9, changeable=True),
    Declaration("stream_gap", 0.2, "Commands farther apart than this are two streams [s].", 1.0e-3, 1.0e9, changeable=True),
    Declaration("velocity_hold", 0.2, "How long a velocity lasts unless the next one comes [s].", 1.0e-3, 10.0, changeable=True),
    Declaration("wrench_cutoff", 10.0, "Cut-off of wrench_filtered [Hz] of simulated time.", 1.0e-3, 1.0e6, changeable=True),
    Declaration("points_rate", 25.0, "Point clouds per simulated second [1/s]; 0 for none.", 0.0, 1000.0, changeable=True),
    Declaration("points_decimation", 1, "Publish the grains whose id is a multiple of this [1].", 1, 1_000_000, changeable=True),
    Declaration("points_voxel", 0.0, "One grain of each cube with this edge [m]; 0 for all.", 0.0, 1.0e3, changeable=True),
    Declaration("points_region", [0.0] * 6, "Box of the cloud: low x y z, high x y z [m]; zeros for all.", changeable=True),
    Declaration("points_fields", list(USUAL_FIELDS), "Fields of the cloud.", choices=POINT_FIELDS, changeable=True),
    Declaration("heights_rate", 5.0, "Height maps per simulated second [1/s]; 0 for none.", 0.0, 1000.0, changeable=True),
    Declaration("heights_cell", 0.0, "Edge of a cell of the height map [m]; 0 for the median grain diameter.", 0.0, 1.0e3),
    Declaration("contacts_rate", 25.0, "Contacts of tools per simulated second, if heard [1/s].", 0.0, 1000.0, changeable=True),
    Declaration("force_scale", 0.0, "Length of force markers [m/N]; 0 chosen from the scene.", 0.0, 1.0e6, changeable=True),
    Declaration("paused", False, "Start held; go on with the resume service."),
    Declaration("duration", 0.0, "End after this simulated time [s]; 0 for never.", 0.0, 1.0e9, changeable=True),
    Declaration("end_on_fault", False, "End with code 1 when the run blows up; otherwise wait for a reset.", changeable=True),
    Declaration("recording", "", "Rerun recording to write (.rrd); empty for none."),
    Declaration("view", False, "Open the Rerun viewer."),
    Declaration("particles", False, "Draw the particles of tools in Rerun."),
    Declaration("output", "", "Folder for summary, history and figure at the end; empty for none."),
    Declaration("states", "states", "Folder of saved states and checkpoints."),
    Declaration("checkpoints", False, "Keep the state from time to time, so that a crash loses little."),
    Declaration("checkpoint_period", 30.0, "Wall time between two checkpoints [s]; 0 for one each frame.", 0.0, 1.0e6),
    Declaration("resume", False, "Go on from the newest good checkpoint."),
    Declaration("threads", 0, "Most cores to use; 0 for the scene's choice, which is all by default.", 0, 4096),
)


def tool_declarations(tool: str, link: str = "") -> tuple[Declaration, ...]:
    """The parameters of one tool, which may be a link of a robot."""
    return (
        Declaration(f"tools.{tool}.source", "pose", "Topic that drives the tool.", choices=SOURCES),
        Declaration(f"tools.{tool}.start", "scene", "Where the tool begins, at the start and after a reset.", choices=STARTS),
        Declaration(f"tools.{tool}.frame", link or tool, "Frame that is the tool's, for TF."),
        Declaration(f"tools.{tool}.wrench_frame", "tool", "Axes of the wrench.", choices=WRENCH_FRAMES, changeable=True),
    )


def frame_declarations(frame: str) -> tuple[Declaration, ...]:
    """The parameters of one fixed frame."""
    return (
        Declaration(f"frames.{frame}.pose", [0.0] * 6, "Where the frame is in its parent: x y z [m], roll pitch yaw [rad]."),
        Declaration(f"frames.{frame}.parent", "", "Frame it is given in; empty for the world frame."),
    )


class Parameters(Mapping):
    """The values of all declared parameters, kept up to date.

    Args:
        node: they are declared on; its ``configured`` tells whether what is not changeable is fixed.

    Raises:
        ValueError: if an override is not allowed; the message names the parameter.
    """

    def __init__(self, node: Node):
        self._node, self._values = node, {}
        self._declarations: dict[str, Declaration] = {}
        node.add_on_set_parameters_callback(self._judge)
        node.add_post_set_parameters_callback(self._keep)
        self.declare(DECLARATIONS)

    def declare(self, declarations: tuple[Declaration, ...]) -> None:
        """Declare some more; those that are declared already are only looked at again, as others may have changed.

        Raises:
            ValueError: if a value is not allowed.
        """
        for declaration in declarations:
            name = declaration.name
            if name not in self._declarations:
                self._declare(declaration)
            if refusal := _refusal(declaration, self._values[name]) or self._clash(name):
                raise ValueError(f"parameter {name}: {refusal}")

    def check_frames(self, tools: list[str]) -> None:
        """See that no two tools, and no fixed frame and a tool, share a frame, which TF would show now here and now there.

        Raises:
            ValueError: if they do.
        """
        owners = dict.fromkeys(self._values["frame_names"], "a frame of frame_names")
        for tool in tools:
            frame = self._values[f"tools.{tool}.frame"]
            if frame in owners:
                raise ValueError(f"parameter tools.{tool}.frame: '{frame}' is {owners[frame]} already; give the tool its own")
            owners[frame] = f"the frame of tool '{tool}'"

    def unsaid(self) -> str:
        """What to say where no scene was given, mostly because a file of parameters is for a node of another name; or empty."""
        if "scene" in self._node._parameter_overrides or self._values["scene"] != _SCENE:
            return ""
        name = self._node.get_fully_qualified_name()
        return (
            f"no parameter 'scene' was given: this is the package's own '{_SCENE}'; what a file of parameters says counts only "
            f"under '{name}' or '/**'"
        )

    def unfollowed(self) -> str:
        """What to say where others tell the time, which the node cannot follow; or empty."""
        if self._values["publish_clock"] or not self._node.get_parameter("use_sim_time").value:
            return ""
        return "use_sim_time: the node follows no other /clock; its stamps are of its own simulated time, which begins at zero"

    def misspelt(self) -> dict[str, str]:
        """Parameters that were given but that nobody has declared, and the one that was meant or is missing, or ''."""
        known = [*self._values, *_OF_ROS]
        given = [name for name in self._node._parameter_overrides if not (name in known or self._node.has_parameter(name))]
        strange = [name for name in given if not name.startswith("qos_overrides.")]
        # A fixed frame has its parameters only if it is among those that are named.
        other = {name: "frame_names" if name.startswith("frames.") else "" for name in strange}
        return {name: next(iter(get_close_matches(name, known, 1)), other[name]) for name in strange}

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def __iter__(self):
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def _declare(self, declaration: Declaration) -> None:
        try:
            self._node.declare_parameter(declaration.name, declaration.default, _descriptor(declaration))
        except InvalidParameterTypeException as error:
            hint = ", such as 10.0" if isinstance(declaration.default, float) else ""
            kind = Parameter.Type.from_parameter_value(declaration.default).name.lower().replace("_", " ")
            article = "an" if kind.startswith("int") else "a"
            raise ValueError(f"parameter {declaration.name}: must be {article} {kind}{hint}; {error}") from None
        self._declarations[declaration.name] = declaration
        self._values[declaration.name] = self._node.get_parameter(declaration.name).value

    def _clash(self, name: str) -> str:
        """Why a value does not fit to the others, empty if it does."""
        if name.endswith(".frame") and self._values[name] == self._values["frame_id"]:
            return f"'{self._values[name]}' is the world frame; give the tool a frame of its own"
        return ""

    def _judge(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            declaration = self._declarations.get(parameter.name)
            if declaration is None or parameter.name not in self._values:  # somebody else's, or being declared
                continue
            refusal = _refusal(declaration, parameter.value)
            if not declaration.changeable and self._node.configured:
                refusal = "fixed while the node is configured; clean up (ros2 lifecycle set), change it, and configure again"
            if refusal:
                return SetParametersResult(successful=False, reason=f"{parameter.name}: {refusal}")
        return SetParametersResult(successful=True)

    def _keep(self, parameters: list[Parameter]) -> None:
        changed = {p.name: p.value for p in parameters if p.name in self._values}
        self._values = self._values | changed  # replaced as a whole, because the stepping thread reads it
        if changed:
            self._node.parameters_changed()


def _refusal(declaration: Declaration, value: Any) -> str:
    """Why a value is not allowed, empty if it is."""
    entries = value if isinstance(value, list) else [value]
    unknown = [entry for entry in entries if declaration.choices and entry not in declaration.choices]
    if unknown:
        return f"unknown '{unknown[0]}'; known are {', '.join(declaration.choices)}"
    if isinstance(declaration.default, list) and isinstance(declaration.default[0], float):
        if len(value) != len(declaration.default) or not np.all(np.isfinite(value)):
            return f"must be {len(declaration.default)} finite numbers"
        if declaration.name.endswith("_region") and any(value) and not np.all(np.less(value[:3], value[3:])):
            return "each of the first three numbers must be less than its partner among the last three"
    elif isinstance(value, float) and not np.isfinite(value):
        return "must be finite"
    if (declaration.name == "frame_id" or declaration.name.endswith(".frame")) and (not value or value.startswith("/")):
        return f"must name a frame, without a '/' before it, not '{value}'"
    if declaration.choices and isinstance(value, list) and (not value or len(set(value)) != len(value)):
        return "must name something, and nothing twice"
    return ""


def _descriptor(declaration: Declaration) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=declaration.description)
    fixed = "" if declaration.changeable else "Fixed while the node is configured."
    choices = f"One of {', '.join(declaration.choices)}." if declaration.choices else ""
    descriptor.additional_constraints = " ".join(filter(None, (choices, fixed)))
    if isinstance(declaration.default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=declaration.low, to_value=declaration.high)]
    elif declaration.low is not None:
        descriptor.integer_range = [IntegerRange(from_value=int(declaration.low), to_value=int(declaration.high), step=1)]
    return descriptor
