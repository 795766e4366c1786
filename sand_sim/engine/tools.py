"""Driven tools: where they are between two commanded poses, and how far they have moved since the tool list was made."""

from functools import cache

import warp as wp

from sand_sim.precision import Precision


@wp.struct
class ToolTrack:
    """Last two commanded poses of a tool; between them it moves at constant velocity and angular velocity."""

    begin_time: wp.float64  # [s]
    end_time: wp.float64  # [s]
    begin_position: wp.vec3d  # [m] world frame
    velocity: wp.vec3d  # [m/s] world frame
    begin_rotation: wp.quatd  # [1] tool frame to world frame
    spin: wp.vec3d  # [rad/s] world frame


@cache
def tool_types(precision: Precision):
    """Warp structs ``ToolShape`` (never changes) and ``ToolState`` (pose and twist at the present step)."""
    real, vec3, quat, whole3 = precision.real, precision.vec3, precision.quat, precision.whole3

    @wp.struct
    class ToolShape:
        radius: real  # [m] of each particle, 0 for a smooth tool
        extent: real  # [m] farthest point of its surface from the tool frame's origin
        arms: vec3  # [m] farthest points of its surface from the axes of the tool frame
        material: int
        low: vec3  # [m] tool frame, lower corner of the particle cells
        inverse_cell: real  # [1/m]
        nx: int
        ny: int
        nz: int
        first_key: int

    @wp.struct
    class ToolState:
        place: whole3  # [quantum] tool frame's origin
        rotation: quat  # [1] tool frame to world frame
        velocity: vec3  # [m/s] of the origin over the last step, world frame
        spin: vec3  # [rad/s] over the last step, world frame

    return ToolShape, ToolState


@wp.func
def rotation_at(track: ToolTrack, time: wp.float64) -> wp.quatd:
    """Tool frame to world frame at a time [s]; before and after its track a tool rests."""
    passed = wp.clamp(time, track.begin_time, track.end_time) - track.begin_time
    rotation = track.begin_rotation
    rate = wp.length(track.spin)
    if rate > wp.float64(0.0):
        rotation = wp.quat_from_axis_angle(track.spin / rate, rate * passed) * rotation
    return rotation


@cache
def build_tool_state_at(precision: Precision) -> wp.Function:
    """Warp function ``(track, velocity, spin, time, centre, inverse_quantum, end) -> ToolState``.

    Velocity and spin are those of the last step, so that forces do not depend on where the tool will be sent next, and springs
    grow by the way that it has gone. Before and after its track a tool rests. A tool beyond the lattice is held at its end, too
    far from the domain to touch a grain.
    """
    real, vec3, quat, whole, whole3 = precision.real, precision.vec3, precision.quat, precision.whole, precision.whole3
    _, state_type = tool_types(precision)

    @wp.func
    def tool_state_at(
        track: ToolTrack,
        velocity: wp.vec3d,
        spin: wp.vec3d,
        time: wp.float64,
        centre: wp.vec3d,
        inverse_quantum: wp.float64,
        end: wp.float64,
    ) -> state_type:
        passed = wp.clamp(time, track.begin_time, track.end_time) - track.begin_time
        position = (track.begin_position + track.velocity * passed - centre) * inverse_quantum
        rotation = rotation_at(track, time)
        state = state_type()
        state.place = whole3(
            whole(wp.rint(wp.clamp(position[0], -end, end))),
            whole(wp.rint(wp.clamp(position[1], -end, end))),
            whole(wp.rint(wp.clamp(position[2], -end, end))),
        )
        state.rotation = quat(real(rotation[0]), real(rotation[1]), real(rotation[2]), real(rotation[3]))
        state.velocity = vec3(real(velocity[0]), real(velocity[1]), real(velocity[2]))
        state.spin = vec3(real(spin[0]), real(spin[1]), real(spin[2]))
        return state

    return tool_state_at
