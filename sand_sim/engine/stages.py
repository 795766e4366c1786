"""The stages of explicit DEM: what each launches, in which order. This file knows no physics, only who needs which arrays."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import warp as wp

from sand_sim.engine import (
    body_motion,
    finish,
    motion,
    neighbours,
    pair_forces,
    pair_tiles,
    plungers,
    surface_contacts,
    tool_contacts,
)
from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.cells import build_cell_keys, build_find_corners, build_join_corners, build_lay_cells
from sand_sim.engine.chunks import CHUNK
from sand_sim.engine.contact_list import ContactList, record_count, record_fill
from sand_sim.engine.skin import begin_lifetime, build_allow, build_note_travel, build_remember, end_lifetime, set_pace
from sand_sim.engine.smooth_tools import arguments_of, record_carrying, record_keeping, record_touching
from sand_sim.engine.sorting import record_sort


@dataclass(frozen=True)
class Stage:
    """A named part of a step.

    Attributes:
        name: shown in plans and profiles.
        record: ``record(arrays, recorder)`` launches the stage on a recorder.
    """

    name: str
    record: Callable


@dataclass(frozen=True)
class Stages:
    """The stages that a scene needs.

    Attributes:
        listing: when a grain has moved as far as it is allowed to.
        tool_listing: when a tool has.
        step: at every step.
    """

    listing: tuple[Stage, ...]
    tool_listing: tuple[Stage, ...]
    step: tuple[Stage, ...]


def choose_stages(arrays: DemArrays) -> Stages:
    """Keep the stages that the scene's arrays call for."""
    step = [Stage("pair forces", pair_stage)]
    if arrays.walls:
        step.append(Stage("wall forces", wall_stage))
    if arrays.tools:
        step.append(Stage("tool forces", tool_stage))
    step.append(Stage("move grains", move_stage))
    if arrays.bodies:
        step.append(Stage("move bodies", body_stage))
    step += [Stage("finish step", finish_stage)]
    return Stages(
        listing=(Stage("sort grains", sort_stage), Stage("list contacts", list_stage)),
        tool_listing=(Stage("list tool contacts", tool_list_stage),) if arrays.tools else (),
        step=tuple(step),
    )


def record_lists(arrays: DemArrays, stages: Stages, recorder) -> None:
    """Record the renewal of the lists that are no longer valid."""
    recorder.when(arrays.flags.grains_moved, partial(_play, arrays, stages.listing, recorder))
    if stages.tool_listing:
        recorder.when(arrays.flags.tools_moved, partial(_play, arrays, stages.tool_listing, recorder))


def record_run(arrays: DemArrays, stages: Stages, recorder) -> None:
    """Record the loop over steps: renew the lists where needed, then step, until ``flags.running`` falls.

    Without ``flags.stepping`` it renews the lists alone.
    """
    flags = arrays.flags

    def one_step():
        record_lists(arrays, stages, recorder)
        step, end = partial(_play, arrays, stages.step, recorder), partial(recorder.once, finish.lower_flag, [flags.running])
        recorder.when(flags.stepping, step, end)

    if arrays.tools:
        place_tools(arrays, recorder, since=0.0)  # where the last step has left them, but others may have told them another way
    recorder.repeat(flags.running, one_step)


def sort_stage(arrays: DemArrays, recorder) -> None:
    """Renumber the grains in the order of their cells; those that have left fall off the end."""
    grains, cells, precision = arrays.grains, arrays.cells, arrays.recipe.precision
    active = grains.active
    recorder.share(build_find_corners(precision), [active.spans, grains.place, cells.corners])
    recorder.share(build_join_corners(precision), [cells.corners])
    recorder.once(build_lay_cells(precision), [cells.corners, cells.levels, cells.low, cells.bins.spans, cells.bins.capacity])
    recorder.each(build_cell_keys(precision), active, [grains.place, cells.levels, cells.low, cells.bins.spans, arrays.keys])
    record_sort(recorder, arrays.keys, cells.bins, active, arrays.in_cells, order_last=False)
    for array in grains.sorted_arrays:
        spare = arrays.spare[array.dtype]
        recorder.each(neighbours.build_take_in_order(array.dtype), active, [arrays.in_cells.order, array, spare])
        recorder.each(neighbours.build_put_back(array.dtype), active, [spare, array])
    recorder.once(neighbours.count_active, [arrays.in_cells.starts, cells.bins.spans, active.spans])
    if arrays.bodies:
        recorder.each(body_motion.find_members, active, [grains.member, arrays.bodies.sphere_at])


def list_stage(arrays: DemArrays, recorder) -> None:
    """Find what each grain may touch among grains and walls; count first, so that nothing is written unless all of it fits."""
    grains, flags, cells = arrays.grains, arrays.flags, arrays.cells
    active, skin = grains.active, arrays.skin
    precision = arrays.recipe.precision
    chunk = 1 if recorder.wide or grains.capacity < CHUNK else CHUNK

    def pairs(filling):
        inputs = [grains.place, cells.levels, cells.low, arrays.in_cells.starts, arrays.allowed]
        inputs += [grains.member, arrays.bodies.body_of if arrays.bodies else None, arrays.hits]
        inputs += _list_arguments(arrays, arrays.pair_list)
        recorder.each(neighbours.build_search(arrays.recipe, filling, chunk), active, inputs)

    def walls(filling):
        inputs = [grains.place, arrays.walls, arrays.plunger_states, skin.widest, cells.levels]
        inputs += _list_arguments(arrays, arrays.wall_list)
        recorder.each(surface_contacts.build_surface_search(arrays.recipe, filling), active, inputs)

    def fill():
        record_fill(recorder, arrays.pair_list, arrays.every_start, partial(pairs, True))
        record_sort(recorder, arrays.pair_list.partner, active, arrays.pair_list.pairs, arrays.met)
        if arrays.walls:
            record_fill(recorder, arrays.wall_list, arrays.every_start, partial(walls, True))
        if arrays.tools:
            recorder.once(finish.raise_flag, [flags.tools_moved])
        else:
            recorder.each(neighbours.number_anew, active, [grains.came_from])
        recorder.each(build_remember(precision), active, [grains.place, arrays.allowed, grains.origin])
        recorder.once(begin_lifetime, [flags.steps_done, skin.renewed_at], wait=False)
        if arrays.plungers:
            recorder.once(plungers.forget_plunger_travel, [arrays.plungers.states], wait=False)
        recorder.once(finish.lower_flag, [flags.grains_moved])

    moved, paced = [grains.place, grains.origin, grains.came_from], [skin.lifetime, skin.pace]
    timed = [skin.radius, skin.widest, flags.steps_done, skin.renewed_at]
    recorder.share(build_note_travel(precision), [active.spans, *moved, skin.widest, skin.travel])
    recorder.once(set_pace, [active.spans, skin.travel, *timed, *paced])
    recorder.each(build_allow(precision), active, [*moved, skin.widest, skin.pace, arrays.allowed])
    record_count(recorder, arrays.pair_list, active, partial(pairs, False), flags)
    if arrays.walls:
        record_count(recorder, arrays.wall_list, active, partial(walls, False), flags)
    recorder.when(flags.proceed, fill)


def tool_list_stage(arrays: DemArrays, recorder) -> None:
    """Find what each grain may touch among tool particles."""
    grains, tools, flags = arrays.grains, arrays.tools, arrays.flags

    def search(filling):
        inputs = [
            grains.place,
            grains.origin,
            tools.shapes,
            tools.states,
            tools.cell_starts,
            tools.particles,
            *arguments_of(tools.smooth),
            arrays.standing,
        ]
        inputs += [arrays.lattice.quantum, arrays.skin.widest, arrays.cells.levels, *_list_arguments(arrays, arrays.tool_list)]
        recorder.each(tool_contacts.build_tool_search(arrays.recipe, filling), grains.active, inputs)

    def fill():
        record_keeping(arrays, recorder)
        record_fill(recorder, arrays.tool_list, arrays.every_start, partial(search, True))
        record_carrying(arrays, recorder)
        recorder.each(neighbours.number_anew, grains.active, [grains.came_from])
        recorder.once(finish.forget_travel, [tools.travelled], wait=False)
        recorder.once(finish.lower_flag, [flags.tools_moved])

    record_count(recorder, arrays.tool_list, grains.active, partial(search, False), flags)
    recorder.when(flags.proceed, fill)


def pair_stage(arrays: DemArrays, recorder, measuring: bool = False) -> None:
    """Forces between grains."""
    contacts = arrays.pair_list
    inputs = [*_grain_arguments(arrays, contacts), *_act_arguments(arrays, "pair")]
    recipe, last = arrays.recipe, not (arrays.walls or arrays.tools)
    if recorder.vectors and not measuring:
        kernel = pair_tiles.build_pair_tiles(recipe)
    else:
        kernel = pair_forces.build_pair_forces(recipe, measuring)
    recorder.each(kernel, contacts.pairs, inputs, wait=last)


def wall_stage(arrays: DemArrays, recorder, measuring: bool = False) -> None:
    """Forces of walls on grains, and the sums of those of plungers over blocks of contacts."""
    contacts, summing = arrays.wall_list, arrays.plungers and not measuring
    inputs = [*_grain_arguments(arrays, contacts), arrays.walls, arrays.plunger_states, *_act_arguments(arrays, "wall")]
    last = bool(summing or not arrays.tools)
    recorder.each(surface_contacts.build_surface_forces(arrays.recipe, measuring), contacts.pairs, inputs, wait=last)
    if summing:
        sums = [contacts.pairs.spans, contacts.partner, contacts.force, arrays.walls]
        sums += [arrays.plungers.number, arrays.plunger_blocks]
        recorder.share(plungers.build_plunger_blocks(arrays.recipe), sums, wait=not arrays.tools)


def tool_stage(arrays: DemArrays, recorder, measuring: bool = False) -> None:
    """Forces of tools on grains, and their sums over blocks of contacts."""
    contacts, tools = arrays.tool_list, arrays.tools
    record_touching(arrays, recorder)
    inputs = [*_grain_arguments(arrays, contacts), tools.shapes, tools.states, tools.particles, tools.tool_of]
    inputs += [arrays.touch, arrays.lever, *_act_arguments(arrays, "tool")]
    recorder.each(tool_contacts.build_tool_forces(arrays.recipe, measuring), contacts.pairs, inputs)
    sums = [contacts.pairs.spans, contacts.partner, tools.tool_of, contacts.force, contacts.moment]
    sums += [arrays.lever, tools.number, arrays.wrench_blocks]
    recorder.share(tool_contacts.build_wrench_blocks(arrays.recipe), sums, wait=measuring)


def move_stage(arrays: DemArrays, recorder) -> None:
    """Advance all grains."""
    grains, lattice, setting, precision = arrays.grains, arrays.lattice, arrays.setting, arrays.recipe.precision
    inputs = [grains.place, grains.remainder, grains.motion, grains.spin, grains.half_motion, grains.half_spin]
    inputs += [grains.motion_carry, grains.spin_carry, grains.origin]
    inputs += [*gathered(arrays), grains.member, arrays.felt_force, arrays.felt_torque]
    inputs += [precision.vec3(*setting.gravity), setting.dt, lattice.quantum]
    inputs += [precision.whole3(*lattice.half_extent.tolist()), lattice.end]
    inputs += [arrays.flags.starting, arrays.carried_off, arrays.flags.grains_moved, arrays.flags.fault]
    kernel = motion.build_move_grains(arrays.recipe, walls=bool(arrays.walls), tools=bool(arrays.tools))
    recorder.each(kernel, grains.active, inputs)


def body_stage(arrays: DemArrays, recorder) -> None:
    """Advance all rigid bodies and their spheres."""
    grains, bodies, lattice, setting = arrays.grains, arrays.bodies, arrays.lattice, arrays.setting
    precision, flags = arrays.recipe.precision, arrays.flags
    inputs = [bodies.starts, bodies.sphere_at, bodies.offset, bodies.place, bodies.remainder, bodies.motion]
    inputs += [bodies.half_motion, bodies.motion_carry, bodies.turn, bodies.momentum, bodies.inertia]
    inputs += [grains.place, grains.motion, grains.spin, grains.half_motion, grains.half_spin, grains.origin]
    inputs += [arrays.felt_force, arrays.felt_torque, bodies.pushes, bodies.unpushed]
    inputs += [precision.vec3(*setting.gravity), setting.dt, lattice.quantum]
    inputs += [precision.whole3(*lattice.half_extent.tolist()), lattice.end]
    inputs += [flags.starting, arrays.carried_off, flags.grains_moved, flags.fault]
    recorder.each(body_motion.build_move_bodies(arrays.recipe), bodies.count, inputs)


def finish_stage(arrays: DemArrays, recorder) -> None:
    """Sum the wrenches, move the plungers on, count the step, move the tools on."""
    flags, skin, tools, dt = arrays.flags, arrays.skin, arrays.tools, arrays.setting.dt
    if skin.radius:
        watched = [flags.steps_done, skin.renewed_at, skin.lifetime, flags.grains_moved]
        recorder.once(end_lifetime, watched, wait=False)
    if tools:
        recorder.once(finish.sum_wrenches, [arrays.tool_list.pairs.spans, arrays.wrench_blocks, tools.wrench], wait=False)
        inputs = [dt, tools.tracks, flags.steps_done, tools.wrench, tools.impulse, tools.twist, tools.way, tools.work]
        recorder.once(finish.sum_impulses, inputs, wait=False)
    if arrays.plungers:
        moved = [arrays.wall_list.pairs.spans, arrays.plunger_blocks, arrays.plungers.drives, arrays.plungers.states]
        moved += [arrays.plungers.engaged, dt, 1.0 / arrays.lattice.quantum, arrays.skin.widest, flags.grains_moved]
        recorder.once(plungers.advance_plungers, moved, wait=False)
    ending = [flags.steps_done, flags.steps_left, flags.starting, flags.fault, flags.running]
    recorder.once(finish.finish_step, ending, wait=not tools)
    if tools:
        place_tools(arrays, recorder, since=dt)


def place_tools(arrays: DemArrays, recorder, since: float) -> None:
    """Put the tools where their tracks have them at the present step, so much time after they were put somewhere before [s]."""
    tools, lattice, setting = arrays.tools, arrays.lattice, arrays.setting
    inputs = [tools.tracks, tools.twist, tools.shapes, tools.states, wp.vec3d(*lattice.centre), 1.0 / lattice.quantum]
    inputs += [float(lattice.end), setting.dt, since, arrays.flags.steps_done, tools.travelled, arrays.skin.widest]
    recorder.once(finish.build_place_tools(arrays.recipe.precision), [*inputs, arrays.flags.tools_moved])


def _play(arrays: DemArrays, stages: tuple[Stage, ...], recorder) -> None:
    for stage in stages:
        stage.record(arrays, recorder)


def _list_arguments(arrays: DemArrays, contacts: ContactList) -> list:
    written = [contacts.counts, contacts.starts, contacts.owner, contacts.partner, contacts.memory]
    return [*written, arrays.grains.came_from, contacts.old_starts, contacts.old_partner, contacts.drawer]


def _grain_arguments(arrays: DemArrays, contacts: ContactList) -> list:
    grains = arrays.grains
    return [
        contacts.owner,
        contacts.partner,
        grains.place,
        grains.motion,
        grains.spin,
        grains.half_motion,
        grains.half_spin,
        grains.material,
        arrays.pairs,
        arrays.kinds,
        arrays.lattice.quantum,
        arrays.setting.dt,
    ]


def _act_arguments(arrays: DemArrays, name: str) -> list:
    contacts = arrays.lists[name]
    return [contacts.memory, contacts.force, contacts.couple, contacts.moment, arrays.deepest, arrays.energy[name]]


def gathered(arrays: DemArrays) -> list:
    """What a grain sums over: its contacts in all lists."""
    parts = {name: [None] * 4 for name in ("pair", "wall", "tool")}
    parts |= {name: [one.starts, one.force, one.couple, one.moment] for name, one in arrays.lists.items()}
    return [*parts["pair"], arrays.met.starts, arrays.met.order, *parts["wall"], *parts["tool"]]
