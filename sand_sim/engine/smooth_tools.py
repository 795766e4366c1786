"""Smooth tools: grains touch the true surface of the mesh, not the particles that it was sampled into.

A grain near a smooth tool is listed with it once for each of ``SLOTS`` contacts. Before the forces of a step the nearest place of
the surface is found, then the nearest that does not belong to it, then the nearest that belongs to neither: as many contacts as a
grain has in a corner of three walls. Each goes into the slot whose normal was like its own in the step before, so that friction
remembers what it should.

A grain looks through the whole surface only once in a while. That it is far from all, or which triangles are near, holds until it
has moved as far as it may; over a face those that rise above it are enough, which are none on flat ground.
"""

from functools import cache

import numpy as np
import warp as wp

from sand_sim.contact.response import memory_type
from sand_sim.engine.contact_list import listed_at
from sand_sim.engine.kernel import kernel
from sand_sim.engine.neighbours import build_put_back
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.tools import ToolTrack, rotation_at, tool_types
from sand_sim.engine.triangle_tree import TriangleTree, list_near, nearest_of_few, nearest_on_tree, plant_tree, stands_on
from sand_sim.precision import Precision

SLOTS = 3  # contacts of a grain with a smooth tool
_SAME = 0.8  # cosine of the angle by which the normal of a contact may turn in one step
_FAR, _NEAR = 0.25, 0.05  # of a grain's radius beyond its reach: how far is looked, and where triangles are noted
_ROUNDING = 1e-6  # of the reach, from the sides of a face: there it is nearer than its neighbours, however that is rounded


@wp.struct
class Standing:
    """What a grain is near to, kept with its first slot for a tool; rows of ``near`` from there on name the triangles."""

    at: wp.vec3d  # [m] centre of the grain when that was found, in the tool's frame
    free: wp.float64  # [m] from there it may move so far before it is looked anew
    over: int  # triangle that it is over, on which it may stand; -1 if it is beside all
    few: int  # triangles that are noted; -1 where there are too many, and the whole surface is searched each step


class SmoothTools:
    """Surfaces of the tools that have one.

    Attributes:
        trees: structs, shape (tools,), without leaves for a rough tool.
        boxes: lower and upper corner of each node, tree after tree, vec3d, shape (2 nodes,) [m].
        corners: three of each triangle [m] and its unit normal, in the tool's frame, vec3d, shape (4 triangles,).
    """

    def __init__(self, surfaces: list[np.ndarray | None], first_slots: list[int], device: str):
        trees, boxes, corners = [], [], []
        for triangles, slot in zip(surfaces, first_slots, strict=True):
            tree = TriangleTree()
            if triangles is not None:
                ordered, nodes = plant_tree(triangles)
                tree.leaves, tree.triangles, tree.first_slot = len(nodes) // 2, len(ordered), slot
                tree.first_node, tree.first_triangle = sum(map(len, boxes)), sum(map(len, corners))
                boxes.append(nodes)
                corners.append(ordered)
            trees.append(tree)
        self.trees = wp.array(trees, dtype=TriangleTree, device=device)
        self.boxes = wp.array(np.concatenate(boxes).reshape(-1, 3), dtype=wp.vec3d, device=device)
        self.corners = wp.array(np.concatenate(corners).reshape(-1, 3), dtype=wp.vec3d, device=device)


@cache
def build_in_tool_frame(precision: Precision) -> wp.Function:
    """Warp function ``(here, state, rotation, quantum) -> centre of a grain`` in a tool's frame [m]."""
    whole4 = precision.whole4
    _, state_type = tool_types(precision)

    @wp.func
    def in_tool_frame(here: whole4, state: state_type, rotation: wp.quatd, quantum: wp.float64) -> wp.vec3d:
        at = state.place
        x = wp.float64(here[0] - at[0])
        y = wp.float64(here[1] - at[1])
        z = wp.float64(here[2] - at[2])
        return wp.quat_rotate_inv(rotation, wp.vec3d(x, y, z) * quantum)

    return in_tool_frame


@wp.func
def holds(known: Standing, corners: wp.array(dtype=wp.vec3d), centre: wp.vec3d, reach: wp.float64) -> bool:
    """Whether what is known of a grain that is somewhere else now is all that matters still."""
    moved = centre - known.at
    good = wp.dot(moved, moved) < known.free * known.free
    if good and known.over >= 0:
        above = wp.dot(corners[4 * known.over + 3], centre - corners[4 * known.over]) >= wp.float64(0.0)
        good = above and stands_on(corners, known.over, centre, reach * wp.float64(wp.static(_ROUNDING)))
    return good


@wp.func
def look_around(
    tree: TriangleTree,
    boxes: wp.array(dtype=wp.vec3d),
    corners: wp.array(dtype=wp.vec3d),
    near: wp.array2d(dtype=int),
    row: int,
    centre: wp.vec3d,
    radius: wp.float64,
    reach: wp.float64,
) -> Standing:
    """What a grain is near to; the triangles are noted from a row of ``near`` on."""
    margin = radius * wp.float64(wp.static(_NEAR))
    far = reach + radius * wp.float64(wp.static(_FAR))
    distance, _n, nearest = nearest_on_tree(tree, boxes, corners, centre, far, wp.mat33d(), wp.vec3d(), 0)
    found = Standing()
    found.at = centre
    found.free = distance - reach
    found.over = -1
    if found.free < margin:
        found.free = margin
        found.few = -1
        # A grain whose centre is inside the tool may be farther from the nearest face than what would be noted.
        if distance >= wp.float64(0.0):
            if stands_on(corners, nearest, centre, reach * wp.float64(wp.static(_ROUNDING))):
                found.over = nearest
            found.few = list_near(tree, boxes, corners, centre, reach + margin, found.over, near, row)
            if found.few < 0:
                found.over = -1
    return found


@cache
def build_touch_smooth(recipe: Recipe) -> wp.Kernel:
    """Kernel that finds the contacts of grains with the surfaces of smooth tools.

    ``touch`` has shape (contacts,): normal in the tool's frame and overlap [m]; zero where a slot holds no contact.
    """
    precision, history = recipe.precision, recipe.history
    real, vec4, whole4 = precision.real, precision.vec4, precision.whole4
    memory_vector = memory_type(recipe.contact, precision)
    _, state_type = tool_types(precision)
    in_tool_frame = build_in_tool_frame(precision)

    @kernel
    def touch_smooth(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        tool_of: wp.array(dtype=int),
        states: wp.array(dtype=state_type),
        tracks: wp.array(dtype=ToolTrack),
        trees: wp.array(dtype=TriangleTree),
        boxes: wp.array(dtype=wp.vec3d),
        corners: wp.array(dtype=wp.vec3d),
        steps_done: wp.array(dtype=wp.int64),
        dt: wp.float64,
        quantum: wp.float64,
        across: wp.float64,
        standing: wp.array(dtype=Standing),
        near: wp.array2d(dtype=int),
        touch: wp.array(dtype=vec4),
        memory: wp.array(dtype=memory_vector),
    ):
        turned = int(-1)  # the tool whose rotation it is
        rotation = wp.quatd()
        for contact in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            tool = tool_of[partner[contact]]
            tree = trees[tool]
            if tree.leaves > 0 and partner[contact] == tree.first_slot:
                here = place[owner[contact]]
                if turned != tool:
                    turned = tool
                    rotation = rotation_at(tracks[tool], wp.float64(steps_done[0]) * dt)
                centre = in_tool_frame(here, states[tool], rotation, quantum)
                radius = wp.float64(here[3]) * quantum
                reach = radius + across
                known = standing[contact]
                if not holds(known, corners, centre, reach):
                    known = look_around(tree, boxes, corners, near, contact, centre, radius, reach)
                    standing[contact] = known
                elif known.over < 0 and known.few == 0:
                    continue
                normals = wp.mat33d()
                distances = wp.vec3d()
                number = int(0)
                searching = int(1)
                while searching > 0:
                    distance = reach
                    normal = wp.vec3d()
                    if known.few >= 0:
                        distance, normal = nearest_of_few(
                            corners, near, contact, known.few, known.over, centre, reach, normals, distances, number
                        )
                    else:
                        distance, normal, _t = nearest_on_tree(tree, boxes, corners, centre, reach, normals, distances, number)
                    searching = 0
                    if distance < reach:
                        normals[number] = normal
                        distances[number] = distance
                        number += 1
                        # Something else is nearer than the face below: what lies in the plane of that counts, and was not noted.
                        if number == 1 and known.over >= 0 and known.few > 0:
                            k = 4 * known.over
                            if distance < wp.dot(corners[k + 3], centre - corners[k]):
                                known.few = -1
                        # A grain whose centre is inside the tool has left all but the nearest face.
                        if number < wp.static(SLOTS) and distance >= wp.float64(0.0) and known.few != 0:
                            searching = 1
                taken = wp.vec3i(-1, -1, -1)  # contact in each slot
                chosen = wp.vec3i(-1, -1, -1)  # slot of each contact
                if wp.static(history):
                    for k in range(number):
                        most = wp.float64(wp.static(_SAME))
                        for slot in range(wp.static(SLOTS)):
                            old = touch[contact + slot]
                            before = wp.vec3d(wp.float64(old[0]), wp.float64(old[1]), wp.float64(old[2]))
                            like = wp.dot(before, normals[k])
                            if taken[slot] < 0 and like > most:
                                most = like
                                chosen[k] = slot
                        if chosen[k] >= 0:
                            taken[chosen[k]] = k
                    for slot in range(wp.static(SLOTS)):
                        if taken[slot] < 0:
                            memory[contact + slot] = memory_vector()
                for slot in range(wp.static(SLOTS)):
                    touch[contact + slot] = vec4(real(0.0))
                for k in range(number):
                    if chosen[k] < 0:
                        for turn in range(wp.static(SLOTS)):
                            slot = wp.static(SLOTS) - 1 - turn
                            if taken[slot] < 0:
                                chosen[k] = slot
                        taken[chosen[k]] = k
                    normal = wp.vec3d(normals[k, 0], normals[k, 1], normals[k, 2])
                    overlap = real(radius - distances[k])
                    touch[contact + chosen[k]] = vec4(real(normal[0]), real(normal[1]), real(normal[2]), overlap)

    return touch_smooth


@cache
def build_carry_touch(precision: Precision) -> wp.Kernel:
    """Kernel that takes over into a new list what the slots held in the last one."""
    vec4 = precision.vec4

    @kernel
    def carry_touch(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        came_from: wp.array(dtype=int),
        old_starts: wp.array(dtype=int),
        old_partner: wp.array(dtype=int),
        old_touch: wp.array(dtype=vec4),
        touch: wp.array(dtype=vec4),
    ):
        for contact in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            kept = vec4()
            old = listed_at(old_starts, old_partner, came_from[owner[contact]], partner[contact])
            if old >= 0:
                kept = old_touch[old]
            touch[contact] = kept

    return carry_touch


def arguments_of(smooth: SmoothTools | None) -> list:
    """Kernel arguments, also where there are none."""
    return [smooth.trees, smooth.boxes, smooth.corners] if smooth else [None] * 3


def record_touching(arrays, recorder) -> None:
    """Record the search for the contacts of a step on the ``DemArrays`` of a world."""
    contacts, tools = arrays.tool_list, arrays.tools
    if tools.smooth:
        inputs = [contacts.owner, contacts.partner, arrays.grains.place, tools.tool_of, tools.states, tools.tracks]
        inputs += [*arguments_of(tools.smooth), arrays.flags.steps_done, arrays.setting.dt, arrays.lattice.quantum]
        inputs += [arrays.widest_reach, arrays.standing, arrays.near, arrays.touch, contacts.memory]
        recorder.each(build_touch_smooth(arrays.recipe), contacts.pairs, inputs)


def record_keeping(arrays, recorder) -> None:
    """Record that what the slots hold is put aside before a new list is made."""
    if arrays.old_touch is not None:
        recorder.each(build_put_back(arrays.touch.dtype), arrays.tool_list.pairs, [arrays.touch, arrays.old_touch])


def record_carrying(arrays, recorder) -> None:
    """Record that a new list takes it over."""
    contacts = arrays.tool_list
    if arrays.old_touch is not None:
        inputs = [contacts.owner, contacts.partner, arrays.grains.came_from, contacts.old_starts, contacts.old_partner]
        recorder.each(build_carry_touch(arrays.recipe.precision), contacts.pairs, [*inputs, arrays.old_touch, arrays.touch])
