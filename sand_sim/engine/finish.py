"""The end of a step, on one thread: wrenches summed, tools moved on, counters and flags brought up to date."""

from functools import cache

import warp as wp

from sand_sim.engine.count import count_of
from sand_sim.engine.kernel import kernel
from sand_sim.engine.tool_contacts import SUM_BLOCK
from sand_sim.engine.tools import ToolTrack, build_tool_state_at, rotation_at, tool_types
from sand_sim.precision import Precision

_ON_TIME = 1e-6  # of a step: a velocity that changes less than that after the step has begun changes with it


@cache
def build_place_tools(precision: Precision) -> wp.Kernel:
    """Kernel that puts all tools where they are at the present step, and flags the tool list if one has moved too far since.

    ``travelled`` has shape (tools,): an upper bound of how far any particle of a tool has moved since the list was made [m];
    ``since`` is the time since they were put somewhere before [s].
    """
    shape_type, state_type = tool_types(precision)
    tool_state_at = build_tool_state_at(precision)

    @kernel
    def place_tools(
        tracks: wp.array(dtype=ToolTrack),
        twist: wp.array2d(dtype=wp.vec3d),
        shapes: wp.array(dtype=shape_type),
        states: wp.array(dtype=state_type),
        centre: wp.vec3d,
        inverse_quantum: wp.float64,
        end: wp.float64,
        dt: wp.float64,
        since: wp.float64,
        steps_done: wp.array(dtype=wp.int64),
        travelled: wp.array(dtype=wp.float64),
        skin: wp.array(dtype=wp.float64),
        tools_moved: wp.array(dtype=int),
    ):
        time = wp.float64(steps_done[0]) * dt
        for tool in range(tracks.shape[0]):
            track = tracks[tool]
            if time > track.begin_time and time - dt < track.end_time:
                spin = wp.quat_rotate_inv(track.begin_rotation, track.spin)  # in the tool frame, as all the way
                about = wp.vec3d(shapes[tool].arms)
                swing = wp.dot(about, wp.vec3d(wp.abs(spin[0]), wp.abs(spin[1]), wp.abs(spin[2])))  # as ``Reach.swing``
                swing = wp.min(swing, wp.length(spin) * wp.float64(shapes[tool].extent))
                travelled[tool] = travelled[tool] + (wp.length(track.velocity) + swing) * since
                if travelled[tool] * inverse_quantum > wp.float64(0.5) * skin[0]:
                    tools_moved[0] = 1
            states[tool] = tool_state_at(track, twist[tool, 0], twist[tool, 1], time, centre, inverse_quantum, end)

    return place_tools


@kernel
def sum_wrenches(pair_spans: wp.array(dtype=int), blocks: wp.array2d(dtype=wp.vec3d), wrench: wp.array2d(dtype=wp.vec3d)):
    """Wrench of the sand on each tool now, shape (tools, 2): force and torque about the tool frame's origin, world frame."""
    tools = wrench.shape[0]
    pairs = count_of(pair_spans)
    number = (pairs + wp.static(SUM_BLOCK) - 1) // wp.static(SUM_BLOCK)
    for tool in range(tools):
        force = wp.vec3d(wp.float64(0.0))
        torque = wp.vec3d(wp.float64(0.0))
        for block in range(number):
            force += blocks[block * tools + tool, 0]
            torque += blocks[block * tools + tool, 1]
        wrench[tool, 0] = force
        wrench[tool, 1] = torque


@kernel
def sum_impulses(
    dt: wp.float64,
    tracks: wp.array(dtype=ToolTrack),
    steps_done: wp.array(dtype=wp.int64),
    wrench: wp.array2d(dtype=wp.vec3d),
    impulse: wp.array2d(dtype=wp.vec3d),
    twist: wp.array2d(dtype=wp.vec3d),
    way: wp.array2d(dtype=wp.vec3d),
    work: wp.array(dtype=wp.float64),
):
    """Impulse of the wrenches over the frame, shape (tools, 4), and work of the tools on the sand since the start.

    The work of a wrench is that over half the way of the step before and half that of the step after. ``way`` has shape (tools,
    2): of the frame's origin and turn over the step before, then over the step after; ``twist`` the same, velocity and spin.

    A tool that comes to the end of its track within a step is there until the step ends, and makes up for it in the next one if
    it goes on. Contacts see even motion all the same: a velocity that changes within a step is taken to change at its end, and
    what that leaves out is added to the velocity over the next step, so that both together are the way.
    """
    time = wp.float64(steps_done[0]) * dt
    before = wp.float64(steps_done[0] - wp.int64(1)) * dt
    for tool in range(wrench.shape[0]):
        force = wrench[tool, 0]
        torque = wrench[tool, 1]
        impulse[tool, 0] = impulse[tool, 0] + force * dt
        impulse[tool, 1] = impulse[tool, 1] + torque * dt
        track = tracks[tool]
        rotation = rotation_at(track, time)
        impulse[tool, 2] = impulse[tool, 2] + wp.quat_rotate_inv(rotation, force) * dt
        impulse[tool, 3] = impulse[tool, 3] + wp.quat_rotate_inv(rotation, torque) * dt
        velocity = wp.vec3d(wp.float64(0.0))
        spin = wp.vec3d(wp.float64(0.0))
        moving = wp.float64(0.0)
        changed = track.end_time
        if time >= track.begin_time and time < track.end_time:
            velocity = track.velocity
            spin = track.spin
            moving = wp.min(track.end_time - time, dt)
            changed = track.begin_time
        late = time - changed
        within = changed > before and late > wp.float64(wp.static(_ON_TIME)) * dt
        if within:
            moving += late
        shift = velocity * moving
        turn = spin * moving
        if within:
            velocity += (velocity - twist[tool, 0]) * (late / dt)
            spin += (spin - twist[tool, 1]) * (late / dt)
        done = wp.dot(force, way[tool, 0] + shift) + wp.dot(torque, way[tool, 1] + turn)
        work[tool] = work[tool] - wp.float64(0.5) * done
        way[tool, 0] = shift
        way[tool, 1] = turn
        twist[tool, 0] = velocity
        twist[tool, 1] = spin


@kernel
def finish_step(
    steps_done: wp.array(dtype=wp.int64),
    steps_left: wp.array(dtype=int),
    starting: wp.array(dtype=int),
    fault: wp.array(dtype=int),
    running: wp.array(dtype=int),
):
    """Count the step and decide whether the frame's loop goes on."""
    steps_done[0] = steps_done[0] + wp.int64(1)
    steps_left[0] = steps_left[0] - 1
    starting[0] = 0
    if steps_left[0] <= 0 or fault[0] != 0:
        running[0] = 0


@kernel
def lower_flag(flag: wp.array(dtype=int)):
    """Set a flag to zero."""
    flag[0] = 0


@kernel
def raise_flag(flag: wp.array(dtype=int)):
    """Set a flag to one."""
    flag[0] = 1


@kernel
def forget_travel(travelled: wp.array(dtype=wp.float64)):
    """The tool list is new: no tool has moved since."""
    for tool in range(travelled.shape[0]):
        travelled[tool] = wp.float64(0.0)
