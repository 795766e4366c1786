"""What the tools of a simulation have been told and have still to do, as plain values for a checkpoint."""

from dataclasses import fields

import numpy as np

from sand_sim.border import CommandError, ToolPose, ToolVelocity
from sand_sim.commands import Command
from sand_sim.courses import Course, Courses
from sand_sim.world import World

_KINDS = {"pose": ToolPose, "velocity": ToolVelocity}
_TIMES = [one.name for one in fields(Course) if one.name != "waiting"]


def pack_courses(courses: Courses) -> dict:
    """In the types that JSON gives back, numbers to the bit; no time yet is None."""
    return {
        name: {
            "waiting": [_pack_command(command) for command in course.waiting],
            **{time: None if np.isinf(getattr(course, time)) else float(getattr(course, time)) for time in _TIMES},
        }
        for name, course in courses.by_tool.items()
    }


def unpack_courses(packed: dict, world: World) -> dict[str, Course]:
    """Courses by tool, from what ``pack_courses`` gave; nothing waits for tools that are not there.

    Raises:
        ValueError: if they cannot be those of this world.
    """
    by_tool = {tool.name: Course() for tool in world.scene.tools}
    try:
        for name, entry in packed.items():
            course = by_tool[name]
            course.waiting.extend(_unpack_command(values, name, world) for values in entry["waiting"])
            for time in _TIMES:
                setattr(course, time, -np.inf if entry[time] is None else float(entry[time]))
    except (KeyError, TypeError, ValueError, AttributeError, CommandError) as error:
        raise ValueError(f"commands: {error!r}") from None
    return by_tool


def _pack_command(command: Command) -> dict:
    values = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(command).items()}
    return values | {"kind": "velocity" if isinstance(command, ToolVelocity) else "pose"}


def _unpack_command(values: dict, tool: str, world: World) -> Command:
    arrays = {name: np.array(value, float) if isinstance(value, list) else value for name, value in values.items()}
    command = _KINDS[arrays.pop("kind")](**arrays)
    world.check(command)
    if command.tool != tool or command.time is None:
        raise ValueError("a command of another tool, or without a time")
    return command
