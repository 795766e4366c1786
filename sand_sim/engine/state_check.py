"""Whether plain arrays can be the state of a world: kernels trust the numbers in them as places in memory."""

import numpy as np

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.smooth_tools import SLOTS
from sand_sim.engine.triangle_tree import FEW


class StateError(ValueError):
    """Arrays that are no state of this world."""


def check_layout(state: dict[str, np.ndarray], like: dict[str, np.ndarray]) -> None:
    """See that all arrays are there, of the right types and shapes.

    Args:
        state: arrays by name.
        like: a state of the world; contact lists, and only those, may be longer or shorter.

    Raises:
        StateError: naming the first array that does not fit, or if the state is of another scene.
    """
    if "scene" in like and not np.array_equal(state.get("scene"), like["scene"]):
        raise StateError(
            "state: is of another scene: a material, law, wall, mesh or other field differs that decides where grains go; "
            "a bed goes into other scenes by a file of its grains, see 'fills'"
        )
    if state.keys() != like.keys():
        raise StateError(f"array '{min(state.keys() ^ like.keys())}' is missing or not wanted")
    for name, array in state.items():
        shape = (_length(state, name, like[name]), *like[name].shape[1:]) if like[name].ndim else ()
        if array.dtype != like[name].dtype or array.shape != shape:
            raise StateError(f"array '{name}' is {array.dtype} {array.shape}, {like[name].dtype} {shape} is wanted")
        for part in [array[field] for field in array.dtype.names] if array.dtype.names else [array]:
            if part.dtype.kind == "f" and not np.all(np.isfinite(part)):
                raise StateError(f"array '{name}' has values that are not finite")
        if name.endswith(".shape") and not np.array_equal(array, like[name]):
            raise StateError(f"array '{name}' is {array}, {like[name]} is wanted")


def check_numbers(arrays: DemArrays, state: dict[str, np.ndarray]) -> None:
    """See that all numbers that kernels look things up by lie where there is something.

    Args:
        arrays: of the world.
        state: of the right layout.

    Raises:
        StateError: naming the first array that does not fit.
    """
    spheres, pairs = arrays.grains.capacity, int(state["pair.number"])
    active = int(state["grains.number"])
    partners = {"pair": spheres, "wall": np.iinfo(np.int32).max, "tool": arrays.tools.particles.shape[0] if arrays.tools else 0}
    ends = {"grains.came_from": spheres, "met.order": pairs, "grains.material": arrays.kinds}
    for name in arrays.lists:
        ends |= {f"{name}.owner": spheres, f"{name}.partner": partners[name]}
    _within("grains.number", np.array(active), spheres + 1)
    for name, end in ends.items():
        if name in state:
            _within(name, state[name], end)
    for name in [*arrays.lists, "met"]:
        starts, number = state[f"{name}.starts"][: active + 1], pairs if name == "met" else int(state[f"{name}.number"])
        if starts[0] != 0 or starts[-1] != number or np.any(np.diff(starts) < 0):
            raise StateError(f"array '{name}.starts' does not divide its list")
    if not np.array_equal(np.sort(state["grains.identity"]), np.arange(spheres)):
        raise StateError("array 'grains.identity' does not name each grain once")
    if arrays.bodies:
        _within("bodies.sphere_at", state["bodies.sphere_at"], spheres)
        member = state["grains.member"]
        if member.min() < -1 or member.max() >= arrays.bodies.members:
            raise StateError("array 'grains.member' points outside")
    if arrays.standing is not None:
        standing, triangles = state["tool.standing"], arrays.tools.smooth.corners.shape[0] // 4
        _within("tool.standing", standing["over"] + 1, triangles + 1)
        _within("tool.standing", standing["few"] + 1, FEW + 2)
        _within("tool.near", state["tool.near"], triangles)
        _check_slots(state["tool.partner"], arrays.tools.smooth.trees.numpy())
    if min(int(state["flags.steps_done"][0]), int(state["observed_steps"])) < 0:
        raise StateError("array 'flags.steps_done' is negative")


def _check_slots(partner: np.ndarray, trees: np.ndarray) -> None:
    """See that all slots of a grain and a smooth tool are listed one behind the other."""
    for first in trees["first_slot"][trees["leaves"] > 0]:
        rows = np.flatnonzero(partner == first)[:, None] + np.arange(SLOTS)
        if rows.size and (rows.max() >= len(partner) or np.any(partner[rows] != first + np.arange(SLOTS))):
            raise StateError("array 'tool.partner' lacks slots of a smooth tool")


def _length(state: dict[str, np.ndarray], name: str, like: np.ndarray) -> int:
    """How long an array must be."""
    kind, _, part = name.partition(".")
    if part in ("owner", "partner", "memory", "touch", "standing", "near") or name == "met.order":
        return int(state["pair.number" if kind == "met" else f"{kind}.number"])
    return len(like)


def _within(name: str, numbers: np.ndarray, end: int) -> None:
    if numbers.size and (numbers.min() < 0 or numbers.max() >= end):
        raise StateError(f"array '{name}' points outside")
