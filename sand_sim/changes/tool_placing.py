"""A tool put somewhere else at once, between two steps."""

import numpy as np

from sand_sim.assembly.assemble import Assembly
from sand_sim.border import CommandError, GrainCloud, ToolPose
from sand_sim.changes.clearance import find_cut
from sand_sim.readout.driven import work_of_tools

_FAR = 1000.0  # widths of the domain that cannot be meant


def check_place(assembly: Assembly, index: int, now: tuple, place: ToolPose, spheres: GrainCloud) -> None:
    """See that a tool can be put somewhere.

    Args:
        assembly: the world's.
        index: number of the tool.
        now: position [m] and orientation that it has.
        place: where it shall be.
        spheres: from ``observe_spheres``.

    Raises:
        CommandError: if it would cut deeper into grains by more than ``DEEP`` of a radius, or lies far out of all bounds.
    """
    lattice, name = assembly.lattice, f"tool '{place.tool}'"
    if not np.all(np.abs(place.position - lattice.centre) < _FAR * np.max(lattice.high - lattice.low)):
        box = f"{np.round(lattice.low, 3).tolist()} to {np.round(lattice.high, 3).tolist()} m"
        raise CommandError("outside", f"{name}: {place.position.tolist()} m is far from the domain, {box}; is it in metres?")
    model = assembly.tools[index]
    fault = find_cut((model, *now), (model, place.position, place.orientation), spheres)
    if fault:
        remedy = "put it elsewhere, or give it that pose in the scene, so that the bed settles around it"
        raise CommandError("blocked", f"{name} {fault}, if it is put there; {remedy}")


def forget_motion(assembly: Assembly, index: int) -> None:
    """Let a tool rest where its track will have it now, with all the work it has done, and grains forget what they felt of it.

    Args:
        assembly: the world's, measured.
        index: number of the tool.
    """
    solver = assembly.solver
    state, own = solver.take_state(), solver.arrays.tools.tool_of.numpy() == index
    state["tool.partner"][own[state["tool.partner"]]] = -1
    state["tools.work"][index] = work_of_tools(assembly)[index]
    for name in ("tools.twist", "tools.way"):
        state[name][index] = 0.0
    solver.put_state(state)
    solver.expect_moves()
