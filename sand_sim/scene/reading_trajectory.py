"""Trajectories of tools in a scene file."""

import math
from dataclasses import replace

from sand_sim.scene.fields import Field
from sand_sim.scene.motion import Motion
from sand_sim.scene.reading_poses import read_pose
from sand_sim.scene.types import Pose, Vector, Waypoint

_POSE, _MOTION = ("position", "orientation", "rpy"), ("velocity", "spin", "oscillation")
_FASTEST_SPIN = 1e5  # [rad/s]; far beyond, poses to pass would fill memory
_FASTEST_SINE = 1000.0  # [Hz], of which a period still has many time steps


def read_trajectory(entry: Field, start: Pose) -> list[Waypoint]:
    """Waypoints, at a pose or at the end of a motion.

    They keep the position or the orientation of the one before, or of the start, where they name none.
    """
    track, pose, angles = [], start, None
    for stop in entry.entries():
        stop.keys(("time", "phase", *_POSE, *_MOTION), required=("time",))
        time = stop["time"].number(least=0.0, unit="s")
        if track and time <= track[-1].time:
            raise stop["time"].refuse(f"must be later than the waypoint before, at {track[-1].time:g} s")
        motion = None
        if any(key in stop for key in _MOTION):
            if not track:
                raise stop.refuse("a motion begins at the waypoint before; put one with a 'time' and a pose before it")
            if any(key in stop for key in _POSE):
                raise stop.refuse(f"give either a pose ({', '.join(_POSE)}) or a motion to there ({', '.join(_MOTION)})")
            motion = _motion(stop)
            position, orientation = motion.after(pose.position, pose.orientation, time - track[-1].time)
            pose = Pose(tuple(map(float, position)), tuple(map(float, orientation)))
            angles = None if any(motion.spin) else angles
        else:
            widest = {"widest": math.inf} if angles else {}  # on from there, a tool may turn as often as it likes
            named = {key: stop.value[key] for key in _POSE if key in stop.value}
            given = read_pose(Field(named, stop.path), **widest)
            pose = replace(pose, position=given.position) if "position" in named else pose
            if "rpy" in named or "orientation" in named:
                pose = replace(pose, orientation=given.orientation)
                angles = _turn_from(angles, stop["rpy"]) if "rpy" in named else None
        track.append(Waypoint(time, pose, stop.optional("phase", Field.text, ""), motion))
    return track


def _motion(stop: Field) -> Motion:
    still = (0.0, 0.0, 0.0)
    amplitude, frequency = still, 0.0
    if "oscillation" in stop:
        sine = stop["oscillation"]
        sine.keys(("amplitude", "frequency"), required=("amplitude", "frequency"))
        amplitude = sine["amplitude"].direction()
        frequency = sine["frequency"].number(above=0.0, most=_FASTEST_SINE, unit="Hz")
    velocity, spin = (stop.optional(key, Field.vector, still) for key in ("velocity", "spin"))
    if math.hypot(*spin) > _FASTEST_SPIN:
        raise stop["spin"].refuse(f"must be at most {_FASTEST_SPIN:g} [rad/s], got {list(spin)}")
    return Motion(velocity, spin, amplitude, frequency)


def _turn_from(before: Vector | None, rpy: Field) -> Vector:
    """Angles of a waypoint [rad], to which a tool must not have to turn by half a turn: it goes the shorter way round."""
    angles = rpy.vector()
    if before and max(abs(a - b) for a, b in zip(angles, before, strict=True)) >= math.pi:
        raise rpy.refuse(
            f"is half a turn or more from {list(before)} [rad] at the waypoint before, but tools turn the shorter way round; put "
            "waypoints in between, or a 'spin' in place of angles, or if that way is meant, add 2 pi to an angle or take it away"
        )
    return angles
