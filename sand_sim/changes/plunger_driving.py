"""Plungers that get another force or velocity in a running world, as a servo or an operator gives them."""

import numpy as np
import warp as wp

from sand_sim.assembly.assemble import Assembly
from sand_sim.border import CommandError
from sand_sim.engine.plungers import Plunger, PlungerState
from sand_sim.integrator import VERLET
from sand_sim.readout.driven import forces_on_walls
from sand_sim.scene.reading_boundaries import FASTEST


def drive(assembly: Assembly, name: str, force: float | None, velocity: float | None, max_speed: float | None) -> None:
    """Press or move a plunger otherwise from the next step on.

    Args:
        assembly: the world's, measured.
        name: of the plunger.
        force: [N] along its normal.
        velocity: instead of it [m/s] along its normal.
        max_speed: of a force [m/s]; as it is if None.

    Raises:
        CommandError: if there is no such plunger or the numbers make no sense; nothing is changed then.
    """
    label, arrays = f"plunger '{name}'", assembly.solver.arrays
    names = [wall.name for wall in assembly.walls if wall.drive]
    if name not in names:
        raise CommandError("unknown_plunger", f"{label} is unknown; known are {', '.join(names) or 'none'}")
    if (force is None) == (velocity is None):
        raise CommandError("misshapen", f"{label}: give exactly one of 'force' [N] and 'velocity' [m/s]")
    if velocity is not None and max_speed is not None:
        raise CommandError("misshapen", f"{label}: max_speed goes with 'force'; a velocity is kept as it is given")
    index, drives = names.index(name), arrays.plungers.drives.numpy().copy()
    row, before = drives[index], drives[index].copy()
    given = {"force": force, "velocity": velocity, "max_speed": max_speed}
    for field, value in given.items():
        if value is not None:
            row[field] = _number(f"{label}: {field}", value)
    if abs(row["velocity"]) > FASTEST:
        raise CommandError("too_fast", f"{label}: velocity must be at most {FASTEST:g} m/s")
    if force is not None and not 0.0 < row["max_speed"] <= FASTEST:
        raise CommandError("misshapen", f"{label}: a force needs a max_speed [m/s] greater than 0 and at most {FASTEST:g}")
    row["pressed"] = force is not None
    _turn_over(assembly, index, before, row)
    arrays.plungers.drives.assign(wp.array(drives, dtype=Plunger, device="cpu"))


def _turn_over(assembly: Assembly, index: int, before: np.ndarray, after: np.ndarray) -> None:
    """Complete the step before with what has driven the plunger until now, and let the next one begin with what drives it then.

    A mass keeps the velocity of half a step ago, to which the solver adds a whole step of the new force; and of work it adds half
    the way of the step before, which was that at the old velocity.
    """
    arrays, dt = assembly.solver.arrays, assembly.time_step.value
    states, walls = arrays.plungers.states.numpy().copy(), arrays.walls.numpy()
    state, old = states[index], float(states[index]["velocity"])
    if arrays.plungers.engaged.numpy()[0] == 1:  # no step has been done, and a mass begins at rest
        state["velocity"] = state["seen"] = 0.0 if after["pressed"] else after["velocity"]
    else:
        here = walls["plunger"] == index
        felt = float((forces_on_walls(assembly)[here] * walls["direction"][here]).sum())
        if after["pressed"]:
            was = before["force"] if before["pressed"] else -felt  # what kept its velocity bore what the grains did
            state["velocity"] -= 0.5 * dt * (after["force"] - was) / after["mass"]
        else:
            state["velocity"] = state["seen"] = after["velocity"]
        if assembly.recipe.integrator == VERLET:
            state["work"] += 0.5 * dt * felt * (state["velocity"] - old)
    arrays.plungers.states.assign(wp.array(states, dtype=PlungerState, device="cpu"))


def _number(label: str, value) -> float:
    try:
        value = float(value)
    except (TypeError, ValueError):
        raise CommandError("misshapen", f"{label} must be a number") from None
    if not np.isfinite(value):
        raise CommandError("not_finite", f"{label} must be finite")
    return value
