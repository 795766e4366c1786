"""A world in the middle of a motion, and what must stay the same in it when it is changed."""

import numpy as np
from scenes import write_small_scene

from sand_sim import ToolPose, World, load_scene

NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def drawn(tmp_path, **further):
    """The small scene in the middle of a motion: the plate pressed into the bed and drawn along it."""
    world = World(load_scene(write_small_scene(tmp_path, **further)))
    for at, position in ((0.1, [0.015, 0.015, 0.0222]), (0.2, [0.025, 0.015, 0.0222])):
        world.apply(ToolPose("plate", np.array(position), NO_TURN, at))
        world.step(round((min(at, 0.15) - world.time) / world.time_step))
    return world


def memories(world):
    """What contacts remember, by the identities of the two and the engine's list; pairs in the order of identities."""
    state, found = world._solver.take_state(), {}
    identity = state["grains.identity"]
    points = world._solver.arrays.tools.particles.numpy()
    for name in ("pair", "wall", "tool"):
        for owner, partner, memory in zip(*(state[f"{name}.{part}"] for part in ("owner", "partner", "memory")), strict=True):
            if not np.any(memory):
                continue
            one, other, sign = identity[owner], partner, 1.0
            if name == "pair":
                other = identity[partner]
                if other < one:
                    one, other, sign = other, one, -1.0
            if name == "tool":
                other = points[partner].tobytes()
            found[name, one, other] = sign * memory
    return found


def same_state(one, other):
    """To the bit, but for the peak of dissipation, which depends on when somebody looked."""
    one, other = one | {"start": one["start"][:5]}, other | {"start": other["start"][:5]}
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)
