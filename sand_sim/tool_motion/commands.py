"""Whether a command makes sense by itself, and where a velocity leads."""

from dataclasses import replace
from numbers import Integral

import numpy as np

from sand_sim import rotation
from sand_sim.border import CommandError, ToolPose, ToolVelocity

Command = ToolPose | ToolVelocity


def check_command(command: Command, label: str = "") -> Command:
    """The command, its orientation brought to length one.

    Args:
        command: to a tool.
        label: what messages call that, if not a tool.

    Raises:
        CommandError: if pose, velocity or time are no finite numbers, not of their shape, or the quaternion is zero.
    """
    tool = label or f"tool '{command.tool}'"
    moving = isinstance(command, ToolVelocity)
    names = ("linear", "angular") if moving else ("position", "orientation")
    try:
        values = {name: np.asarray(getattr(command, name), float) for name in names}
        finite = all(np.isfinite(value).all() for value in (*values.values(), command.time or 0.0))
    except (TypeError, ValueError):
        raise CommandError("misshapen", f"{tool}: {names[0]}, {names[1]} and time must be numbers") from None
    for name, value in values.items():
        shape = (4,) if name == "orientation" else (3,)
        if value.shape != shape:
            raise CommandError("misshapen", f"{tool}: {name} must be of shape {shape}, not {value.shape}")
    if not finite:
        raise CommandError("not_finite", f"{tool}: {names[0]}, {names[1]} and time must be finite")
    if not moving:
        try:
            values["orientation"] = rotation.unit(values["orientation"])
        except ValueError as error:
            raise CommandError("zero_quaternion", f"{tool}: orientation is {error}") from None
    return replace(command, **values)


def check_steps(steps: int) -> None:
    """See that a world can take so many steps.

    Raises:
        CommandError: if the number is not whole, as that of seconds, or negative.
    """
    if not isinstance(steps, Integral):
        raise CommandError("steps", f"must be a whole number, got {steps!r}; for t seconds give 'round(t / world.time_step)'")
    if steps < 0:
        raise CommandError("steps", f"a world is stepped forward, got {steps} steps; go back by 'restore'")


def pose_after(velocity: ToolVelocity, position: np.ndarray, orientation: np.ndarray, duration: float) -> ToolPose:
    """Where a velocity leads a tool from a pose, in a time [s].

    Raises:
        CommandError: if it is half a turn or more.
    """
    velocity = in_world(velocity, orientation)
    if not np.linalg.norm(velocity.angular) * duration < np.pi:
        least = np.pi / np.linalg.norm(velocity.angular)
        raise CommandError(
            "too_fast",
            f"tool '{velocity.tool}': turns by half a turn or more in {duration:.3g} s, and goes to poses the shorter way round; "
            f"go by less than {least:.3g} s at once",
        )
    turned = rotation.multiply(rotation.from_vector(velocity.angular * duration), orientation)
    return ToolPose(velocity.tool, position + velocity.linear * duration, turned)


def in_world(velocity: ToolVelocity, orientation: np.ndarray) -> ToolVelocity:
    """A velocity in the world frame; ``orientation`` is that of the tool where the command begins."""
    if not velocity.in_tool_frame:
        return velocity
    linear, angular = (rotation.rotate(orientation, vector) for vector in (velocity.linear, velocity.angular))
    return replace(velocity, linear=linear, angular=angular, in_tool_frame=False)
