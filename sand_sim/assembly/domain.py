"""How far the world reaches."""

import numpy as np

from sand_sim.assembly.terrain import Ground
from sand_sim.assembly.tool_model import ToolModel
from sand_sim.engine.lattice import Lattice
from sand_sim.grain_table import GrainTable
from sand_sim.precision import Precision
from sand_sim.scene.types import Scene, SceneError
from sand_sim.scene.walls import Wall

_MARGIN = 0.25  # of the scene's largest edge, free around everything in it
_COARSEST = 0.1  # resolution over the smallest radius; beyond, kernels lose count of cells


def make_lattice(
    scene: Scene, table: GrainTable, walls: list[Wall], tools: list[ToolModel], grounds: list[Ground], precision: Precision
) -> Lattice:
    """The lattice over the domain that a scene gives, or over all that is in it and a margin.

    Raises:
        SceneError: if a grain starts outside of it, a terrain has its middle there, or it is so large that grains get lost in it.
    """
    lattice = _lattice(scene, table, walls, tools, grounds, precision)
    smallest = float(table.radius.min(initial=np.inf))
    if not lattice.quantum < _COARSEST * smallest:  # nor if it is not a number
        remedy = "make it smaller" if scene.domain is not None else "give one: it reaches as far as all that is in it"
        raise SceneError(
            f"domain: positions are resolved to {lattice.quantum:.2g} m, but the smallest radius is {smallest:.2g} m; {remedy}"
        )
    return lattice


def _lattice(
    scene: Scene, table: GrainTable, walls: list[Wall], tools: list[ToolModel], grounds: list[Ground], precision: Precision
) -> Lattice:
    reserve = 1.05 * max([tool.extent for tool in tools] + [float(np.linalg.norm(table.offset, axis=1).max(initial=0.0))])
    if scene.domain is not None:
        low, high = (np.asarray(corner, float) for corner in scene.domain)
        for ground in grounds:
            if not np.all((ground.place > low) & (ground.place < high)):
                raise SceneError(f"domain: must contain the middle of terrain '{ground.name}', {ground.place.round(3).tolist()}")
        _check_inside(table, low, high)
        return Lattice(low, high, precision, reserve)
    corners = [table.position - table.radius[:, None], table.position + table.radius[:, None]]
    for fill in scene.fills:
        if fill.low is not None:
            corners.append(np.array([fill.low, fill.high]))
    for boundary in scene.boundaries:
        if boundary.kind == "box":
            corners.append(np.array([boundary.low, boundary.high]))
    for wall in walls:
        if wall.kind == "plane":  # where grains would hit it
            corners.append(table.position - wall.distance(table.position)[:, None] * wall.direction)
    for tool in tools:
        track = tool.tool.trajectory
        stops = np.array([tool.tool.pose.position, *(waypoint.pose.position for waypoint in track)])
        swings = np.array([stop.motion.amplitude for stop in track if stop.motion] or np.zeros((1, 3)))
        room = tool.extent + 2.0 * np.abs(swings).max(axis=0)  # a motion may end anywhere on its sine
        corners += [stops - room, stops + room]
    corners += [wall.corners for wall in walls if wall.corners is not None]
    corners += [ground.mesh.bounds + ground.place for ground in grounds]
    corners = np.concatenate(corners)
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = _MARGIN * float(np.max(high - low))
    return Lattice(low - margin, high + margin, precision, reserve)


def _check_inside(table: GrainTable, low: np.ndarray, high: np.ndarray) -> None:
    centres = np.concatenate([table.position[table.lone], table.bodies.position])
    outside = np.any((centres < low) | (centres > high), axis=1)
    if outside.any():
        raise SceneError(
            f"domain: {outside.sum()} of {len(centres)} grains start outside of it, the first at "
            f"{(centres[outside][0].round(6) + 0.0).tolist()} m; enlarge 'domain' or move them"  # without -0.0
        )
