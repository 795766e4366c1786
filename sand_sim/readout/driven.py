"""What tools, plungers and pushes have done to the grains, read from device arrays that the solver has just measured."""

import numpy as np

from sand_sim import rotation
from sand_sim.assembly.assemble import Assembly
from sand_sim.integrator import VERLET


def work_of_tools(assembly: Assembly) -> np.ndarray:
    """Work of each tool on the grains up to now, for the energy balance, shape (tools,) [J].

    The solver has summed it up to the middle of the last step; what is left of that belongs to the force at its end, which is
    known only now.
    """
    tools = assembly.solver.arrays.tools
    if tools is None:
        return np.zeros(0)
    done = np.einsum("ijk,ijk->i", tools.wrench.numpy(), tools.way.numpy())
    return tools.work.numpy() - 0.5 * done * (assembly.recipe.integrator == VERLET)


def work_of_plungers(assembly: Assembly) -> np.ndarray:
    """Work of each plunger on the grains up to now, shape (plungers,) [J]; its last half step as that of tools."""
    arrays, dt = assembly.solver.arrays, assembly.time_step.value
    if arrays.plungers is None:
        return np.zeros(0)
    states, walls = arrays.plungers.states.numpy(), arrays.walls.numpy()
    driven = walls["plunger"] >= 0
    along = np.einsum("ij,ij->i", forces_on_walls(assembly), walls["direction"])[driven]
    force = np.zeros(len(states))
    force[walls["plunger"][driven]] = along
    return states["work"] - 0.5 * dt * force * states["velocity"] * (assembly.recipe.integrator == VERLET)


def work_of_pushes(assembly: Assembly) -> np.ndarray:
    """Work of what pushes each of the scene's bodies up to now, shape (bodies,) [J]; its last half step as that of tools."""
    bodies = assembly.solver.arrays.bodies
    if bodies is None or bodies.pushes is None:
        return np.zeros(0)
    rows, axes = bodies.pushes.numpy(), rotation.to_matrices(bodies.turn.numpy()[bodies.unpushed :])
    force = rows["acted_force"]
    torque = rows["acted_torque"] + np.cross(np.einsum("nij,nj->ni", axes, rows["lever"]), force)
    last = np.einsum("ij,ij->i", force, rows["way"]) + np.einsum("ij,ij->i", torque, rows["turn"])
    return rows["work"] + 0.5 * last * (assembly.recipe.integrator == VERLET)


def driven_speed(assembly: Assembly) -> float:
    """Speed of the fastest point of all tools and plungers over the last step [m/s]."""
    arrays, speeds = assembly.solver.arrays, [0.0]
    if arrays.tools:
        turns = arrays.tools.states.numpy()["rotation"]
        for tool, (velocity, spin), turn in zip(assembly.tools, arrays.tools.twist.numpy(), turns, strict=False):  # grounds rest
            speeds.append(np.linalg.norm(velocity) + tool.reach.swing(rotation.rotate(rotation.inverse(turn), spin)))
    if arrays.plungers:
        speeds += np.abs(arrays.plungers.states.numpy()["velocity"]).tolist()
    return max(speeds)


def forces_on_walls(assembly: Assembly) -> np.ndarray:
    """Forces of the grains on all analytic walls, shape (walls, 3) [N]."""
    arrays = assembly.solver.arrays
    contacts, number = arrays.wall_list, arrays.wall_list.pairs.get()
    wall = wall_numbers(assembly, contacts.partner.numpy()[:number])
    force = contacts.force.numpy()[:number, :3].astype(float)
    return -np.column_stack([np.bincount(wall, force[:, k], len(assembly.walls)) for k in range(3)]).astype(float)


def wall_numbers(assembly: Assembly, partner: np.ndarray) -> np.ndarray:
    """Numbers of the analytic walls that contacts are with, from the partners they are listed under, of the same shape."""
    return np.searchsorted(assembly.solver.arrays.walls.numpy()["first"], partner, side="right") - 1
