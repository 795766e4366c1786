"""The node's parameters: one table, declared with descriptions and ranges."""

from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from sand_sim.simulation import PACINGS


@dataclass(frozen=True)
class Declaration:
    """One parameter.

    Attributes:
        name: of the parameter.
        default: gives its type, too.
        description: shown by ``ros2 param describe``.
        low, high: inclusive range of a number.
        choices: allowed texts.
        changeable: while the node runs.
    """

    name: str
    default: Any
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    changeable: bool = False


DECLARATIONS = (
    Declaration("scene", "dig", "Scene file, or the name of one of the package's own scenes."),
    Declaration("pacing", "realtime", "How simulated time advances: realtime, fast or lockstep.", choices=PACINGS),
    Declaration("real_time_factor", 1.0, "Simulated over wall seconds in realtime pacing [1].", 0.001, 1000.0),
    Declaration("frame_id", "world", "Name of the world frame in all messages."),
    Declaration("points_rate", 25.0, "Point clouds per simulated second [1/s]; 0 for none.", 0.0, 1000.0, changeable=True),
    Declaration("points_decimation", 1, "Publish the grains whose id is a multiple of this [1].", 1, 1_000_000, changeable=True),
    Declaration("paused", False, "Start held; go on with the pause service."),
    Declaration("duration", 0.0, "End after this simulated time [s]; 0 for never.", 0.0, 1.0e9),
    Declaration("end_on_fault", False, "End with exit code 1 when the run blows up; otherwise wait for a reset."),
    Declaration("recording", "", "Rerun recording to write (.rrd); empty for none."),
    Declaration("view", False, "Open the Rerun viewer."),
    Declaration("particles", False, "Draw the particles of tools in Rerun."),
    Declaration("output", "", "Folder for summary, history and figure at the end; empty for none."),
    Declaration("threads", 0, "Cores to use; 0 for the scene's choice, which is all by default.", 0, 4096),
)


def declare_parameters(node: Node) -> None:
    """Declare all parameters."""
    for declaration in DECLARATIONS:
        descriptor = ParameterDescriptor(description=declaration.description, read_only=not declaration.changeable)
        if declaration.choices:
            descriptor.additional_constraints = f"One of {', '.join(declaration.choices)}."
        if isinstance(declaration.default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=declaration.low, to_value=declaration.high)]
        elif declaration.low is not None:
            descriptor.integer_range = [IntegerRange(from_value=int(declaration.low), to_value=int(declaration.high), step=1)]
        node.declare_parameter(declaration.name, declaration.default, descriptor)


def read_parameters(node: Node) -> dict[str, Any]:
    """All values by name.

    Raises:
        ValueError: if a text is not among its choices; the message names the parameter.
    """
    values = {declaration.name: node.get_parameter(declaration.name).value for declaration in DECLARATIONS}
    for declaration in DECLARATIONS:
        if declaration.choices and values[declaration.name] not in declaration.choices:
            known = ", ".join(declaration.choices)
            raise ValueError(f"parameter {declaration.name}: unknown '{values[declaration.name]}'; known are {known}")
    return values
