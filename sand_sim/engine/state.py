"""The whole state of a world as plain arrays: put back, it goes on to the bit as if nothing had happened."""

import numpy as np
import warp as wp

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.count import Count
from sand_sim.integrator import VERLET


def take_state(arrays: DemArrays) -> dict[str, np.ndarray]:
    """Copy everything that the next step depends on, and what has been summed up so far, to the host."""
    state = {name: _on_host(array) for name, array in _whole_arrays(arrays).items()}
    state |= {f"{name}.number": np.array(count.get()) for name, count in _counts(arrays).items()}
    for name, (array, count) in _filled_arrays(arrays).items():
        state[name] = _on_host(array[: count.get()])
    state["deepest"] = arrays.deepest.numpy().max(keepdims=True)
    state["carried_off"] = arrays.carried_off.numpy().sum(keepdims=True)
    return state


def put_state(arrays: DemArrays, state: dict[str, np.ndarray]) -> bool:
    """Put a state of the same scene back.

    Args:
        arrays: of a world made from the same scene, on any number of lanes.
        state: from ``take_state``.

    Returns:
        Whether lists had to be enlarged, so that programs must be recorded anew.
    """
    grown = False
    for name, contacts in arrays.lists.items():
        number = int(state[f"{name}.number"])
        if number > contacts.pairs.capacity:
            contacts.wanted.fill_(number)
            grown = True
    if grown:
        arrays.make_room()
    for name, count in _counts(arrays).items():
        count.set(int(state[f"{name}.number"]))
    for name, array in _whole_arrays(arrays).items():
        array.assign(state[name])
    for name, (array, _) in _filled_arrays(arrays).items():
        if len(state[name]):
            wp.copy(array, wp.array(state[name], dtype=array.dtype, device=arrays.device), count=len(state[name]))
    for name in ("deepest", "carried_off"):
        lanes = getattr(arrays, name)
        lanes.zero_()
        wp.copy(lanes, wp.array(state[name], dtype=lanes.dtype, device=arrays.device), count=1)
    return grown


def set_back_half_a_step(arrays: DemArrays, state: dict[str, np.ndarray], kind: str, rows) -> None:
    """Give newcomers, whose velocities are of now, those of half a step ago, where the integrator asks for them.

    Args:
        arrays: of the world.
        state: of that world, in which they are.
        kind: ``grains`` or ``bodies``.
        rows: theirs.
    """
    if arrays.recipe.integrator == VERLET and not state["flags.starting"][0]:
        velocity, setting = state[f"{kind}.half_motion"], arrays.setting
        velocity[rows] -= (0.5 * setting.dt * np.asarray(setting.gravity)).astype(velocity.dtype)


def _on_host(array: wp.array) -> np.ndarray:
    """A copy on the host; from a GPU ``numpy`` brings one."""
    values = array.numpy()
    return values.copy() if array.device.is_cpu else values


def _counts(arrays: DemArrays) -> dict[str, Count]:
    return {"grains": arrays.grains.active} | {name: contacts.pairs for name, contacts in arrays.lists.items()}


def _whole_arrays(arrays: DemArrays) -> dict[str, wp.array]:
    """Arrays whose length does not change."""
    grains, flags, tools = arrays.grains, arrays.flags, arrays.tools
    names = (
        "place",
        "remainder",
        "motion",
        "spin",
        "half_motion",
        "half_spin",
        "motion_carry",
        "spin_carry",
        "member",
        "material",
        "identity",
        "came_from",
        "origin",
    )
    found = {f"grains.{name}": getattr(grains, name) for name in names}
    found |= {f"flags.{name}": getattr(flags, name) for name in ("grains_moved", "tools_moved", "starting", "steps_done")}
    found |= {f"skin.{name}": getattr(arrays.skin, name) for name in ("lifetime", "renewed_at")}
    found |= {f"{name}.starts": contacts.starts for name, contacts in arrays.lists.items()}
    found["met.starts"] = arrays.met.starts
    if arrays.bodies:
        names = ("sphere_at", "place", "remainder", "motion", "half_motion", "motion_carry", "turn", "momentum")
        found |= {f"bodies.{name}": getattr(arrays.bodies, name) for name in names}
        found["pushes"] = arrays.bodies.pushes
    if tools:
        names = ("tracks", "states", "travelled", "wrench", "impulse", "twist", "way", "work")
        found |= {f"tools.{name}": getattr(tools, name) for name in names}
    if arrays.plungers:
        found |= {f"plungers.{name}": getattr(arrays.plungers, name) for name in ("drives", "states", "engaged")}
    return {name: array for name, array in found.items() if array is not None}


def _filled_arrays(arrays: DemArrays) -> dict[str, tuple[wp.array, Count]]:
    """Arrays of which only the first items mean something."""
    found = {"met.order": (arrays.met.order, arrays.pair_list.pairs)}
    for name, contacts in arrays.lists.items():
        for part in ("owner", "partner", "memory"):
            if getattr(contacts, part) is not None:
                found[f"{name}.{part}"] = (getattr(contacts, part), contacts.pairs)
    if arrays.touch is not None:  # what is known holds only beside what was touched then
        found |= {f"tool.{name}": (getattr(arrays, name), arrays.tool_list.pairs) for name in ("touch", "standing", "near")}
    return found
