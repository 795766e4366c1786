"""Whether spheres fit where they are asked for: clear of grains, of each other, of walls, tools, terrains and bodies."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from sand_sim import rotation
from sand_sim.assemble import Assembly
from sand_sim.border import CommandError, GrainCloud
from sand_sim.observing import observe_bodies, observe_grains
from sand_sim.scene.types import Pose

_TOUCH = 1e-6  # of a radius: what may overlap by rounding
_MOST_PAIRS = 200_000_000  # that are looked at, some seconds
_PAIRS_AT_ONCE = 1_000_000


def find_obstacles(
    assembly: Assembly, spheres: GrainCloud, poses: list, position: np.ndarray, radius: np.ndarray
) -> dict[str, np.ndarray]:
    """What is in the way of new spheres.

    Args:
        assembly: the world's, measured.
        spheres: from ``observe_spheres``.
        poses: position [m] and orientation of each tool now.
        position: of the new spheres, shape (n, 3) [m].
        radius: shape (n,) [m].

    Returns:
        For each obstacle by name, which of the new spheres overlap it, shape (k,) int; empty if all are clear.
    """
    spare = _TOUCH * radius + 2.0 * assembly.lattice.quantum
    grains = (one for one, _ in overlapping(position, radius - spare, spheres.position, spheres.radius.astype(float)))
    pairs = overlapping(position, radius - 0.5 * spare, position, radius - 0.5 * spare)
    each_other = (one[one != other] for one, other in pairs)
    blocked = {"grains": _gather(grains), "one another": _gather(each_other)}
    for wall, offset in zip(assembly.walls, _offsets(assembly), strict=True):
        near = wall.distance(position - offset * wall.direction) < radius - spare
        blocked[wall.label] = np.flatnonzero(near)
    solids = [(m, m.tool.pose, pose) for m, pose in zip(assembly.tools, poses, strict=True)]
    solids += [(g, g.pose, (g.place, g.pose.orientation)) for g in assembly.grounds]
    models = {model.body.name: model for model in assembly.bodies}
    for report in observe_bodies(assembly, observe_grains(assembly, spheres)):
        model = models[report.name]
        solids.append((model, model.body.pose, (report.position, report.orientation)))
    for solid, start, now in solids:
        blocked[solid.label] = np.flatnonzero(solid.distance(as_at_start(position, start, now)) < radius - spare)
    return {name: np.unique(which) for name, which in blocked.items() if len(which)}


def overlapping(
    position: np.ndarray, radius: np.ndarray, others: np.ndarray, their_radius: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """All pairs of a sphere and one of some others that overlap, by their rows; found in cells as wide as the widest pair.

    Yields:
        Some pairs at a time, so that memory stays small however many there are.

    Raises:
        CommandError: if far too many are near enough to be looked at.
    """
    if not (len(position) and len(others)):
        return
    cell = float(radius.max() + their_radius.max())
    low = position.min(axis=0) - cell
    near = np.flatnonzero(np.all((others > low) & (others < position.max(axis=0) + cell), axis=1))
    size = (np.floor((position.max(axis=0) - low) / cell) + 3).astype(np.int64)

    def key(cells):
        return (cells[:, 2] * size[1] + cells[:, 1]) * size[0] + cells[:, 0]

    keys = key(np.floor((others[near] - low) / cell).astype(np.int64))
    order = np.argsort(keys, kind="stable")
    keys, near = keys[order], near[order]
    home = np.floor((position - low) / cell).astype(np.int64)
    rows = []
    for row in np.ndindex(3, 3):  # the three cells along x follow one another
        left, right = (key(home + np.array([end, row[0] - 1, row[1] - 1])) for end in (-1, 1))
        begin = np.searchsorted(keys, left)
        rows.append((begin, np.searchsorted(keys, right, side="right") - begin))
    pairs = sum(int(number.sum()) for _, number in rows)
    if pairs > _MOST_PAIRS:
        raise CommandError("crowded", f"{pairs:.1e} pairs of grains are near each other; ask for fewer, smaller or farther apart")
    for begin, number in rows:
        for part in _parts(number):
            first = np.repeat(np.arange(part.start, part.stop), number[part])
            ends = np.cumsum(number[part])
            second = near[np.repeat(begin[part] - ends + number[part], number[part]) + np.arange(len(first))]
            apart = position[first] - others[second]
            meet = np.einsum("ij,ij->i", apart, apart) < (radius[first] + their_radius[second]) ** 2
            yield first[meet], second[meet]


def _parts(number: np.ndarray) -> Iterator[slice]:
    """Parts one after the other whose numbers add up to little more than ``_PAIRS_AT_ONCE`` each, or that are one long."""
    part = (np.cumsum(number) - 1) // _PAIRS_AT_ONCE
    ends = [*(np.flatnonzero(np.diff(part)) + 1).tolist(), len(number)]
    return (slice(begin, end) for begin, end in pairwise([0, *ends]))


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
