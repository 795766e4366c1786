"""Whether things fit where they are asked for: spheres clear of all there is, tools clear of grains."""

from collections.abc import Iterator

import numpy as np

from sand_sim import rotation
from sand_sim.assembly.assemble import Assembly
from sand_sim.assembly.tool_model import ToolModel
from sand_sim.border import CommandError, GrainCloud
from sand_sim.readout.observing import observe_bodies, observe_grains
from sand_sim.scene.overlapping import TooManyPairsError, overlapping
from sand_sim.scene.stable_step import DEEP
from sand_sim.scene.types import Pose

_TOUCH = 1e-6  # of a radius: what may overlap by rounding


def find_obstacles(
    assembly: Assembly, spheres: GrainCloud, poses: list, position: np.ndarray, radius: np.ndarray, of_body: str = ""
) -> dict[str, np.ndarray]:
    """What is in the way of new spheres.

    Args:
        assembly: the world's, measured.
        spheres: from ``observe_spheres``.
        poses: position [m] and orientation of each tool now.
        position: of the new spheres, shape (n, 3) [m].
        radius: shape (n,) [m].
        of_body: name of the body whose spheres they are, and which is in nobody's way, if they are of one.

    Returns:
        For each obstacle by name, which of the new spheres overlap it, shape (k,) int; empty if all are clear.

    Raises:
        CommandError: if far too many spheres are near each other.
    """
    spare = _TOUCH * radius + 2.0 * assembly.lattice.quantum
    grains = (one for one, _ in overlapping(position, radius - spare, spheres.position, spheres.radius.astype(float)))
    pairs = () if of_body else overlapping(position, radius - 0.5 * spare, position, radius - 0.5 * spare)
    each_other = (one[one != other] for one, other in pairs)
    try:
        blocked = {"grains": _gather(grains), "one another": _gather(each_other)}
    except TooManyPairsError as error:
        raise CommandError("crowded", str(error)) from None
    for wall, offset in zip(assembly.walls, _offsets(assembly), strict=True):
        near = wall.gap(position - offset * wall.direction) < radius - spare
        blocked[wall.label] = np.flatnonzero(near)
    solids = [(m, m.tool.pose, pose) for m, pose in zip(assembly.tools, poses, strict=True)]
    solids += [(g, g.pose, (g.place, g.pose.orientation)) for g in assembly.grounds]
    models = {model.body.name: model for model in assembly.bodies}
    for report in observe_bodies(assembly, observe_grains(assembly, spheres)):
        if report.name != of_body:
            model = models[report.name]
            solids.append((model, model.body.pose, (report.position, report.orientation)))
    for solid, start, now in solids:
        blocked[solid.label] = np.flatnonzero(solid.distance(as_at_start(position, start, now)) < radius - spare)
    return {name: np.unique(which) for name, which in blocked.items() if len(which)}


def find_cut(before: tuple[ToolModel, np.ndarray, np.ndarray], after: tuple, spheres: GrainCloud) -> str:
    """How a tool with another mesh, or elsewhere, would cut deeper into grains by more than ``DEEP`` of a radius.

    Args:
        before: the tool, its position, shape (3,) [m], and orientation, shape (4,), now.
        after: the same as it shall be.
        spheres: from ``observe_spheres``.

    Returns:
        What it would do, with how many grains, how deep and where; empty if nothing.
    """
    radius = spheres.radius.astype(float)
    reach = max(before[0].extent, after[0].extent)
    near = np.flatnonzero(np.linalg.norm(spheres.position - after[1], axis=1) < reach + radius)
    was, now = (
        1.0 - model.distance(as_at_start(spheres.position[near], model.tool.pose, pose)) / radius[near]
        for model, *pose in (before, after)
    )
    deeper = now - np.maximum(was, 0.0)
    blocked = deeper > DEEP
    if not blocked.any():
        return ""
    place = spheres.position[near[np.argmax(deeper)]].round(4).tolist()
    return f"cuts into {blocked.sum()} grains by more than {DEEP:g} of a radius, the deepest at {place} m by {deeper.max():.2g}"


def _gather(parts: Iterator[np.ndarray]) -> np.ndarray:
    """All different entries of some arrays of whole numbers, in order."""
    return np.unique(np.concatenate([np.zeros(0, int), *(np.unique(part) for part in parts)]))


def _offsets(assembly: Assembly) -> np.ndarray:
    """How far each wall has moved along its direction, shape (walls,) [m]."""
    arrays, offsets = assembly.solver.arrays, np.zeros(len(assembly.walls))
    if arrays.plungers:
        plunger = arrays.walls.numpy()["plunger"]
        offsets[plunger >= 0] = arrays.plungers.states.numpy()["offset"][plunger[plunger >= 0]]
    return offsets


def as_at_start(position: np.ndarray, start: Pose, now: tuple) -> np.ndarray:
    """World points as a thing saw them from where it started, shape (n, 3) [m]."""
    local = rotation.rotate(rotation.inverse(np.asarray(now[1])), position - np.asarray(now[0]))
    return np.asarray(start.position) + rotation.rotate(np.asarray(start.orientation), local)
