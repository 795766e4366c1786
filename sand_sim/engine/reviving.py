"""Spheres that were taken out come back as they were, into a world that has gone on meanwhile."""

import numpy as np

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.explicit_dem import ExplicitDem
from sand_sim.engine.state import set_back_half_a_step


def revive(solver: ExplicitDem, start: dict[str, np.ndarray], identities: np.ndarray) -> None:
    """Put spheres back; they touch nothing yet.

    Args:
        solver: whose contact lists are valid.
        start: state in which the spheres are as they shall be, before the first step.
        identities: of the spheres, shape (n,), all of them removed; of a rigid body all are given.
    """
    arrays, state = solver.arrays, solver.take_state()
    number = int(state["grains.number"])
    here = np.arange(number, number + len(identities))  # behind the last one that is there
    order = np.argsort(~np.isin(state["grains.identity"][number:], identities), kind="stable")
    source = np.argsort(start["grains.identity"])[state["grains.identity"][number:][order][: len(here)]]
    for name, rows in state.items():
        if name.startswith("grains.") and rows.ndim:
            rows[number:] = rows[number:][order]
            rows[here] = start[name][source]
        elif name.endswith(".starts"):
            rows[here + 1] = rows[number]
    state["grains.number"] = np.array(number + len(here))
    state["grains.came_from"][here] = here
    set_back_half_a_step(arrays, state, "grains", here)
    if arrays.bodies:
        _revive_bodies(arrays, state, start, here)
    solver.put_state(state)
    solver.expect_moves()


def _revive_bodies(arrays: DemArrays, state: dict, start: dict, spheres: np.ndarray) -> None:
    """Put back the bodies that spheres are of."""
    member = state["grains.member"][spheres]
    bodies = np.unique(arrays.bodies.body_of.numpy()[member[member >= 0]])
    for name, rows in state.items():
        if name.startswith("bodies.") and name != "bodies.sphere_at":  # which is found anew with the lists
            rows[bodies] = start[name][bodies]
    set_back_half_a_step(arrays, state, "bodies", bodies)
