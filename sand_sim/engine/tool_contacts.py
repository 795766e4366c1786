"""Contacts of grains with the particles of tools.

The particles of a tool lie still in the tool's frame, so their cells are laid once. A grain is brought into that frame to find
the particles near it, and moving a tool rebuilds no list but this one. A smooth tool has slots in place of particles, see
``smooth_tools.py``.
"""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_drifting, build_meeting, memory_type
from sand_sim.engine.act import build_act, build_acts
from sand_sim.engine.cells import cell_functions, level_type
from sand_sim.engine.contact_list import build_note
from sand_sim.engine.count import count_of, part_start
from sand_sim.engine.kernel import kernel
from sand_sim.engine.pair_contact import build_direction
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.smooth_tools import SLOTS, Standing
from sand_sim.engine.tools import tool_types
from sand_sim.engine.triangle_tree import TriangleTree, nearest_on_tree
from sand_sim.precision import Precision

SUM_BLOCK = 128  # contacts per partial sum of a wrench; fixed, so that the sum does not depend on the number of shares


@cache
def build_from_tool(precision: Precision) -> wp.Function:
    """Warp function: vector from a tool frame's origin to a grain's centre, world frame [m]."""
    real, vec3, whole4 = precision.real, precision.vec3, precision.whole4
    _, state_type = tool_types(precision)

    @wp.func
    def from_tool(here: whole4, state: state_type, quantum: real) -> vec3:
        at = state.place
        return vec3(real(here[0] - at[0]), real(here[1] - at[1]), real(here[2] - at[2])) * quantum

    return from_tool


@cache
def build_tool_search(recipe: Recipe, filling: bool) -> wp.Kernel:
    """Kernel that counts or, ``filling``, lists the tool particles within reach of each grain.

    Grains are taken where they were when the grain list was made (``origin``): what they may have moved since is in the skin.
    """
    precision, smooth = recipe.precision, recipe.smooth_tools
    real, vec3, whole4 = precision.real, precision.vec3, precision.whole4
    memory_vector = memory_type(recipe.contact, precision)
    shape_type, state_type = tool_types(precision)
    from_tool, note = build_from_tool(precision), build_note(recipe, filling)
    level, (level_of, _) = level_type(precision), cell_functions(precision)

    @kernel
    def tool_search(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        origin: wp.array(dtype=whole4),
        shapes: wp.array(dtype=shape_type),
        states: wp.array(dtype=state_type),
        cell_starts: wp.array(dtype=int),
        particles: wp.array(dtype=vec3),
        trees: wp.array(dtype=TriangleTree),
        boxes: wp.array(dtype=wp.vec3d),
        corners: wp.array(dtype=wp.vec3d),
        standing: wp.array(dtype=Standing),
        quantum: real,
        skin: wp.array(dtype=wp.float64),
        levels: wp.array(dtype=level),
        counts: wp.array(dtype=int),
        starts: wp.array(dtype=int),
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        memory: wp.array(dtype=memory_vector),
        came_from: wp.array(dtype=int),
        old_starts: wp.array(dtype=int),
        old_partner: wp.array(dtype=int),
        old_memory: wp.array(dtype=memory_vector),
    ):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            found = int(0)
            if wp.static(filling):
                found = starts[i]
                if starts[i + 1] == found:
                    continue  # none was counted
            here = origin[i]
            size = place[i][3]
            across = levels[level_of(levels, size)].across
            for tool in range(shapes.shape[0]):
                shape = shapes[tool]
                state = states[tool]
                away = from_tool(here, state, quantum)
                reach = (real(size + here[3]) + across + real(wp.float64(0.5) * skin[0])) * quantum + shape.radius
                farthest = shape.extent + reach
                if wp.dot(away, away) > farthest * farthest:
                    continue
                local = wp.quat_rotate_inv(state.rotation, away)
                if wp.static(smooth):
                    tree = trees[tool]
                    if tree.leaves > 0:
                        at = wp.vec3d(wp.float64(local[0]), wp.float64(local[1]), wp.float64(local[2]))
                        limit = wp.float64(reach)
                        none = wp.mat33d()
                        distance, _n, _t = nearest_on_tree(tree, boxes, corners, at, limit, none, wp.vec3d(), 0)
                        if distance < limit:
                            if wp.static(filling):
                                standing[found] = Standing()
                            for slot in range(wp.static(SLOTS)):
                                found = note(
                                    found,
                                    i,
                                    tree.first_slot + slot,
                                    owner,
                                    partner,
                                    memory,
                                    came_from,
                                    old_starts,
                                    old_partner,
                                    old_memory,
                                )
                        continue
                cell = (local - shape.low) * shape.inverse_cell
                x = int(wp.floor(cell[0]))
                y = int(wp.floor(cell[1]))
                z = int(wp.floor(cell[2]))
                left = wp.max(x - 1, 0)
                right = wp.min(x + 1, shape.nx - 1)
                if left > right:
                    continue
                for row in range(9):
                    v = y + row % 3 - 1
                    w = z + row // 3 - 1
                    if v < 0 or v >= shape.ny or w < 0 or w >= shape.nz:
                        continue
                    line = shape.first_key + (w * shape.ny + v) * shape.nx
                    for j in range(cell_starts[line + left], cell_starts[line + right + 1]):
                        apart = local - particles[j]
                        if wp.dot(apart, apart) < reach * reach:
                            found = note(found, i, j, owner, partner, memory, came_from, old_starts, old_partner, old_memory)
            if wp.static(not filling):
                counts[i] = found

    return tool_search


@cache
def build_tool_forces(recipe: Recipe, measuring: bool = False) -> wp.Kernel:
    """Kernel for the forces between grains and tool particles; the tool is immovable for the law (m* is the grain's mass).

    The surface of a smooth tool is flat for the law (R* is the grain's radius), as that of a wall.
    """
    precision, rotation, materials = recipe.precision, recipe.rotation, recipe.materials
    real, vec3, vec4, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    shape_type, state_type = tool_types(precision)
    from_tool, direction = build_from_tool(precision), build_direction(precision)
    meeting, acts = build_meeting(precision), build_acts(recipe)
    drifting, springs, halves = build_drifting(precision), recipe.springs, recipe.halves
    smooth = recipe.smooth_tools
    act, release = build_act(recipe, measuring)

    @kernel
    def tool_forces(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        half_spin: wp.array(dtype=vec3),
        material: wp.array(dtype=int),
        table: wp.array(dtype=types.pair),
        kinds: int,
        quantum: real,
        dt: real,
        shapes: wp.array(dtype=shape_type),
        states: wp.array(dtype=state_type),
        particles: wp.array(dtype=vec3),
        tool_of: wp.array(dtype=int),
        touch: wp.array(dtype=vec4),
        lever: wp.array(dtype=vec3),
        memory: wp.array(dtype=memory_vector),
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        for contact in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = owner[contact]
            j = partner[contact]
            tool = tool_of[j]
            state = states[tool]
            shape = shapes[tool]
            here = place[i]
            radius = real(here[3]) * quantum
            reach = radius + shape.radius
            arm = vec3(real(0.0))
            apart = from_tool(here, state, quantum)
            touching = False
            if wp.static(smooth):
                touching = touch[contact][3] > real(0.0)
            if shape.radius > real(0.0):
                arm = wp.quat_rotate(state.rotation, particles[j])
                apart -= arm
                touching = wp.dot(apart, apart) < reach * reach
            if acts(contact, touching, memory):
                normal, distance = direction(apart)
                overlap = reach - distance
                half = real(0.5) * overlap
                point = arm + normal * (shape.radius - half)
                law_radius = radius * shape.radius / reach
                least = wp.min(radius, shape.radius)
                if wp.static(smooth):
                    if shape.radius == real(0.0):
                        met_at = touch[contact]
                        normal = wp.quat_rotate(state.rotation, vec3(met_at[0], met_at[1], met_at[2]))
                        overlap = met_at[3]
                        half = overlap  # all of it lies on the grain's side of the contact point
                        point = apart - normal * (radius - overlap)
                        law_radius = radius
                        least = radius
                of_i = motion[i]
                velocity = vec3(of_i[0], of_i[1], of_i[2]) - state.velocity - wp.cross(state.spin, point)
                turning = -state.spin
                if wp.static(rotation):
                    spin_i = vec3(spin[i][0], spin[i][1], spin[i][2])
                    turning += spin_i
                    velocity -= wp.cross(spin_i, normal) * (radius - half)
                met = meeting(normal, overlap, velocity, turning, law_radius, least, radius, of_i[3])
                if wp.static(springs):
                    past = vec3(of_i[0], of_i[1], of_i[2])
                    turned = vec3(spin[i][0], spin[i][1], spin[i][2])
                    if wp.static(halves):
                        past = half_motion[i]
                        turned = half_spin[i]
                    past -= state.velocity
                    lag = wp.cross(state.spin, normal) * (real(0.5) * dt)
                    if shape.radius > real(0.0):
                        lag = past - wp.cross(state.spin, arm)
                        lag = (lag - normal * wp.dot(lag, normal)) * (real(0.5) * dt / reach)
                    past -= wp.cross(state.spin, point) + wp.cross(turned, normal - lag) * (radius - half)
                    met = drifting(met, past, turned - state.spin, lag)
                kind = int(0)
                if wp.static(materials):
                    kind = material[i]
                lever[contact] = point
                act(
                    contact,
                    met,
                    table[kind * kinds + shape.material],
                    dt,
                    half,
                    lane,
                    overlap / radius,
                    memory,
                    force,
                    couple,
                    moment,
                    deepest,
                    energy,
                )
            else:
                lever[contact] = vec3(real(0.0))
                release(contact, memory, force, couple, moment, energy)

    return tool_forces


@cache
def build_wrench_blocks(recipe: Recipe) -> wp.Kernel:
    """Kernel that sums force and torque of the sand on each tool over blocks of contacts: thread = block * tools + tool.

    ``blocks`` has shape (blocks * tools, 2): force [N] and torque [N m] about the tool frame's origin, world frame.
    """
    vec3, vec4, couples = recipe.precision.vec3, recipe.precision.vec4, recipe.contact.couples

    @kernel
    def wrench_blocks(
        lane: int,
        shares: int,
        pair_spans: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        tool_of: wp.array(dtype=int),
        force: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        lever: wp.array(dtype=vec3),
        tools: int,
        blocks: wp.array2d(dtype=wp.vec3d),
    ):
        own = lane + wp.tid()
        pairs = count_of(pair_spans)
        number = (pairs + wp.static(SUM_BLOCK) - 1) // wp.static(SUM_BLOCK)
        for block in range(part_start(number, own, shares), part_start(number, own + 1, shares)):
            for tool in range(tools):
                blocks[block * tools + tool, 0] = wp.vec3d(wp.float64(0.0))
                blocks[block * tools + tool, 1] = wp.vec3d(wp.float64(0.0))
            first = block * wp.static(SUM_BLOCK)
            for contact in range(first, wp.min(first + wp.static(SUM_BLOCK), pairs)):
                felt = force[contact]
                push = vec3(felt[0], felt[1], felt[2])
                torque = wp.cross(lever[contact], push)
                if wp.static(couples):
                    resistance = moment[contact]
                    torque += vec3(resistance[0], resistance[1], resistance[2])
                row = block * tools + tool_of[partner[contact]]
                blocks[row, 0] = blocks[row, 0] - wp.vec3d(wp.float64(push[0]), wp.float64(push[1]), wp.float64(push[2]))
                blocks[row, 1] = blocks[row, 1] - wp.vec3d(wp.float64(torque[0]), wp.float64(torque[1]), wp.float64(torque[2]))

    return wrench_blocks
