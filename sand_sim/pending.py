"""What the tools of a simulation have been told and have still to do, as plain values for a checkpoint."""

from collections import Counter
from dataclasses import fields

import numpy as np

from sand_sim.border import CommandError, ToolPose, ToolVelocity
from sand_sim.courses import Course, Courses
from sand_sim.tool_motion.commands import Command
from sand_sim.world import World

_KINDS = {"pose": ToolPose, "velocity": ToolVelocity}
_TIMES = [one.name for one in fields(Course) if one.name != "waiting"]


def pack_told(courses: Courses, rejected: Counter[str], frame_end: float) -> dict:
    """In the types that JSON gives back, numbers to the bit; no time yet is None.

    Args:
        courses: of the tools.
        rejected: number of rejected commands by reason.
        frame_end: when the next observation is due [s].
    """
    by_tool = {
        name: {
            "waiting": [_pack_command(command) for command in course.waiting],
            **{time: None if np.isinf(getattr(course, time)) else float(getattr(course, time)) for time in _TIMES},
        }
        for name, course in courses.by_tool.items()
    }
    return {"courses": by_tool, "rejected": dict(rejected), "limited": int(courses.limited), "frame_end": frame_end}


def unpack_told(packed: dict, world: World) -> tuple[dict[str, Course], Counter[str], int, float]:
    """Courses by tool, rejected commands by reason, number of slowed ones, and when the next observation is due [s].

    Args:
        packed: from ``pack_told``; empty after a run that was stepped by hand.
        world: in the state that goes with it.

    Raises:
        ValueError: if it cannot be that of this world.
    """
    by_tool = {tool.name: Course() for tool in world.scene.tools}
    try:
        for name, entry in packed.get("courses", {}).items():
            course = by_tool[name]
            course.waiting.extend(_unpack_command(values, name, world) for values in entry["waiting"])
            for time in _TIMES:
                setattr(course, time, -np.inf if entry[time] is None else float(entry[time]))
        rejected = Counter({str(reason): int(number) for reason, number in packed.get("rejected", {}).items()})
        frame_end, limited = float(packed.get("frame_end", 0.0)), int(packed.get("limited", 0))
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, CommandError) as error:
        raise ValueError(f"commands: {error!r}") from None
    now, frame = world.time, world.frame_steps * world.time_step
    # The frame rate may be another one now.
    return by_tool, rejected, limited, frame_end if 0.0 < frame_end - now < 1.5 * frame else now + frame


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
