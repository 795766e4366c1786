"""Where the grains of a fill start: loosely packed in their region, or as a file says."""

import csv
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from sand_sim import rotation
from sand_sim.grain_table import GrainTable
from sand_sim.scene.clumps import place_clumps
from sand_sim.scene.npz import read_npz
from sand_sim.scene.overlapping import TooManyPairsError, overlapping
from sand_sim.scene.shapes import Shape, shape_named
from sand_sim.scene.types import Fill, Material, SceneError, SizeDistribution
from sand_sim.scene.walls import Wall

_GAP = 1.06  # lattice spacing over the largest diameter
_JITTER = 0.4  # of the gap
_FINEST = 4  # halvings of a place of the lattice
_SPARE = 100  # places beyond what is needed, because chance deals them out
_MOST_PLACES = 30_000_000  # in a region: 3 GB while they are laid out, and many times what a bed has been run with
_HIGHER = 10.0  # times, beyond which a region is most likely meant otherwise
_POURED_FRACTION = 0.61  # of solid in a settled bed, a little high so that a fill by height can be struck off
# What files of grains hold: arrays of an npz file, and the columns of a csv file that make them.
_COLUMNS = {
    "position": ("x", "y", "z"),
    "radius": ("radius",),
    "velocity": ("vx", "vy", "vz"),
    "spin": ("wx", "wy", "wz"),
    "orientation": ("qx", "qy", "qz", "qw"),
}


def fill_grains(
    fill: Fill, material: Material, index: int, walls: list[Wall], others: Sequence[tuple[str, GrainTable]] = ()
) -> GrainTable:
    """Place the grains of a fill.

    Args:
        fill: what the scene asks for.
        material: of the grains.
        index: of the material in the scene.
        walls: surfaces that no grain may cut.
        others: names and grains of fills that none may overlap, unless a file says where it lies.

    Raises:
        SceneError: if the region cannot hold them, or the file is unreadable.
    """
    shape = shape_named(fill.shape, f"fills: '{fill.name}'")
    if fill.file is not None:
        columns = _read_file(fill)
        position, radius, turns = (columns.pop(name) for name in ("position", "radius", "orientation"))
        if shape:
            turns = rotation.multiply(turns, rotation.from_matrix(shape.axes))
        return _table(position, radius, fill, material, index, shape, turns, **columns)
    random = np.random.default_rng(fill.seed)
    reach = shape.bounding_radius / shape.equal_radius if shape else 1.0
    largest = _largest(fill.size) * reach
    points = _lattice(fill, largest, random)
    lattice, places, taken = points, len(points), []
    obstacles = [(wall.label, partial(_clear, wall)) for wall in walls]
    obstacles += [(f"fill '{name}'", partial(_clear_of_grains, table)) for name, table in others]
    for label, is_clear in obstacles:
        try:
            clear = is_clear(points, largest)
        except TooManyPairsError as error:
            raise SceneError(f"fills: '{fill.name}' shares too large a region with {label}: {error}") from None
        taken.append((label, len(points) - clear.sum()))
        points = points[clear]
    wanted = fill.count or _count_for_height(fill, walls, random)
    radius = _draw(fill.size, min(wanted, _MOST_PLACES), random)
    try:
        position, room = _seat(points, radius * reach, largest, [is_clear for _, is_clear in obstacles], random)
    except TooManyPairsError as error:
        raise SceneError(f"fills: '{fill.name}' shares too large a region with other fills: {error}") from None
    if wanted > room:
        alone = [(wall.label, places - int(_clear(wall, lattice, largest).sum())) for wall in walls]  # whatever others take
        taken[: len(walls)] = alone
        cause = "".join(f"; {what} takes {some} of its {places} places" for what, some in taken if 2 * some > places)
        times = wanted / room + 0.1 if room and not cause else np.inf
        enough = f", about {times:.1f} times as high," if times < _HIGHER else ""
        remedy = f"enlarge 'region'{enough} or ask for fewer grains"
        if any((wall.label, places) in taken for wall in walls if getattr(wall, "kind", "") == "plane"):
            remedy = "'region' lies behind it: planes and sides of a 'box' have no end, those of a 'bin' have"
        raise SceneError(
            f"fills: '{fill.name}' has room for {room} loosely packed grains but {wanted} are wanted{cause}; {remedy}"
        )
    turns = rotation.at_random(wanted, random) if shape else None
    return _table(position, radius, fill, material, index, shape, turns)


def own_frames(fills: Iterable[Fill], tables: Iterable[GrainTable], bodies: int) -> np.ndarray:
    """Rotations from the frames of the clumps' files to their principal frames, none for other bodies, shape (bodies, 4)."""
    turns, first = np.tile([0.0, 0.0, 0.0, 1.0], (bodies, 1)), 0
    for fill, table in zip(fills, tables, strict=True):
        if shape := shape_named(fill.shape, f"fills: '{fill.name}'"):
            turns[first : first + table.grains] = rotation.from_matrix(shape.axes.T)
            first += table.grains
    return turns


def smallest_sphere(fills: Iterable[Fill]) -> float | None:
    """Radius of the smallest sphere, a grain or part of one, that fills can put into a scene [m]; None without fills.

    Raises:
        SceneError: if a file is unreadable.
    """
    return min(map(_smallest, fills), default=None)


def smallest_of_materials(fills: Iterable[Fill], table: GrainTable, order: list[str]) -> dict[str, float]:
    """Smallest radius of each grain material [m]; of radii that are drawn, the smallest that any seed could draw."""
    drawn = {order[k]: float(table.radius[table.material == k].min()) for k in np.unique(table.material)}
    fills = [fill for fill in fills if fill.file is None]
    limits = {name: smallest_sphere(fill for fill in fills if fill.material == name) for name in drawn}
    return {name: min(radius, limits[name] or radius) for name, radius in drawn.items()}


def _smallest(fill: Fill) -> float:
    shape = shape_named(fill.shape, f"fills: '{fill.name}'")
    share = float(shape.radii.min()) / shape.equal_radius if shape else 1.0
    if fill.file is not None:
        return share * float(_read_file(fill)["radius"].min())
    return share * (min(fill.size.radii) if fill.size.radii else fill.size.low or fill.size.mean)


def _clear(solid, points: np.ndarray, gap: float) -> np.ndarray:
    """Whether points are a gap or more from a solid, shape (n,); where it has a box, only points near that are measured."""
    gap *= 1.0 - 1e-6  # a region that ends at a wall has places that are as far, but for rounding
    if not hasattr(solid, "box"):
        return solid.distance(points) > gap
    low, high = solid.box
    near = np.all((points > low - gap) & (points < high + gap), axis=1)
    clear = ~near
    clear[near] = solid.distance(points[near]) > gap
    return clear


def _clear_of_grains(table: GrainTable, points: np.ndarray, gap: float) -> np.ndarray:
    """Whether points are a gap or more from the surfaces of all spheres of a table, shape (n,)."""
    clear = np.ones(len(points), bool)
    for one, _ in overlapping(points, np.full(len(points), gap), table.position, table.radius):
        clear[one] = False
    return clear


def _largest(size: SizeDistribution) -> float:
    return {"constant": size.mean, "table": max(size.radii, default=0.0)}.get(size.kind, size.high)


def _draw(size: SizeDistribution, number: int, random: np.random.Generator) -> np.ndarray:
    if size.kind == "constant":
        return np.full(number, size.mean)
    if size.kind == "uniform":
        return random.uniform(size.low, size.high, number)
    if size.kind == "table":
        weights = np.asarray(size.weights)
        return random.choice(np.asarray(size.radii), number, p=weights / weights.sum())
    radii = random.normal(size.mean, size.deviation, number)
    outside = (radii < size.low) | (radii > size.high)
    while outside.any():
        radii[outside] = random.normal(size.mean, size.deviation, outside.sum())
        outside = (radii < size.low) | (radii > size.high)
    return radii


def _lattice(fill: Fill, radius: float, random: np.random.Generator) -> np.ndarray:
    """Jittered cubic lattice points at least a radius inside the region, lowest first, shape (n, 3) [m]."""
    low, high = np.asarray(fill.low, float), np.asarray(fill.high, float)
    spacing = 2.0 * radius * _GAP
    if np.any(high - low < 2.0 * radius):
        return np.zeros((0, 3))
    counts = np.floor((high - low - 2.0 * radius) / spacing + 1e-9) + 1.0
    if counts.prod() > _MOST_PLACES:
        raise SceneError(
            f"fills: '{fill.name}' has a region with places for {counts.prod():.2g} grains of {radius:.2g} m, at most "
            f"{_MOST_PLACES:.0e} are laid out; make 'radius' larger, as is usual for models of fine sand, or 'region' smaller"
        )
    counts = counts.astype(int)
    axes = [low[k] + radius + (high[k] - low[k] - 2.0 * radius) * _even(counts[k]) for k in range(2)]
    axes.append(low[2] + radius + spacing * np.arange(counts[2]))
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    slack = _JITTER * (spacing - 2.0 * radius)
    points += random.uniform(-slack, slack, points.shape)
    return np.clip(points, low + radius, high - radius)


def _seat(
    points: np.ndarray, radius: np.ndarray, largest: float, obstacles: Sequence[Callable], random: np.random.Generator
) -> tuple[np.ndarray, int]:
    """Where grains of some sizes go: a place of the lattice holds one, or eight of at most half the largest size, and so on.

    Args:
        points: places with room for the largest, lowest first, shape (m, 3) [m].
        radius: that each grain reaches, shape (n,) [m].
        largest: that they may reach [m].
        obstacles: each tells which of some points are at least a gap away from it; all of ``points`` are so by ``largest``.
        random: where chance comes from.

    Returns:
        Positions, shape (n, 3) [m], of use only if there is room for all; about how many grains there is room for.
    """
    level = np.clip(np.floor(np.log2(largest / radius)), 0, _FINEST).astype(int)
    number = np.bincount(level)
    if len(number) == 1:
        return points[: len(radius)], len(points)
    places = np.ceil(number / 8.0 ** np.arange(len(number)))  # that each size needs, mixed at random
    points = points[: int(2.0 * places.sum()) + _SPARE]
    kind = random.choice(len(number), len(points), p=places / places.sum())
    position, share = np.zeros((len(radius), 3)), np.inf
    for one in np.flatnonzero(number):
        seats = points[kind == one]
        for half in 0.5 ** np.arange(1, one + 1):
            corner = half * largest * (2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1.0)
            seats = (seats[:, None] + corner).reshape(-1, 3)
        for is_clear in obstacles if one else ():
            seats = seats[is_clear(seats, largest / 2.0**one)]
        share = min(share, len(seats) / number[one])
        if share >= 1.0:
            position[level == one] = seats[: number[one]]
    return position, int(share * len(radius))


def _even(count: int) -> np.ndarray:
    return np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])


def _count_for_height(fill: Fill, walls: list[Wall], random: np.random.Generator) -> int:
    """Number of grains for a bed of the asked height; random points tell how much of the region the walls leave."""
    low, high = np.asarray(fill.low), np.asarray(fill.high)
    top = np.array([high[0], high[1], low[2] + fill.height])
    samples = random.uniform(low, top, (200_000, 3))
    corners = np.stack(np.meshgrid(*zip(low, top, strict=True)), -1).reshape(-1, 3)
    inside = np.ones(len(samples), bool)
    for wall in walls:
        if getattr(wall, "kind", "") == "plane" and np.all(wall.distance(corners) >= 0.0):
            continue  # all of it lies before the plane
        inside &= _clear(wall, samples, 0.0)
    volume = inside.mean() * float(np.prod(high[:2] - low[:2])) * fill.height
    grain = float(np.mean(4.0 / 3.0 * np.pi * _draw(fill.size, 100_000, random) ** 3))
    return max(1, round(_POURED_FRACTION * volume / grain))


def _table(position, radius, fill: Fill, material: Material, index: int, shape: Shape | None, turns, spin=None, velocity=None):
    number = len(radius)
    velocity = np.tile(np.asarray(fill.velocity, float), (number, 1)) if velocity is None else velocity
    spin = np.zeros((number, 3)) if spin is None else spin
    if shape:
        return place_clumps(shape, position, turns, radius, velocity, spin, material.density, index)
    density, kind = np.full(number, material.density), np.full(number, index)
    return GrainTable.of_spheres(position, velocity, spin, radius, density, kind)


def _read_file(fill: Fill) -> dict[str, np.ndarray]:
    """What a file tells of grains, of which only position and radius must be there, see ``_COLUMNS``."""
    path = Path(fill.file)
    where = f"fills: file '{path.name}' of '{fill.name}'"
    try:
        columns = (_read_arrays if path.suffix == ".npz" else _read_csv)(path)
    except OSError as error:
        raise SceneError(f"{where} cannot be read: {error.strerror or error}") from None
    except (ValueError, csv.Error) as error:
        raise SceneError(f"{where} is not a readable npz or csv file: {error}") from None
    for name in ("position", "radius"):
        if name not in columns:
            raise SceneError(f"{where} has no '{name}'; it has {', '.join(columns) or 'nothing'}")
    position, radius = columns["position"], columns["radius"]
    if position.ndim != 2 or position.shape[1] != 3 or not len(position):
        raise SceneError(f"{where}: 'position' must have shape (n, 3) with n > 0, got {position.shape}")
    number = len(position)
    if radius.shape != (number,):
        raise SceneError(f"{where}: 'radius' must have shape ({number},), got {radius.shape}")
    for name, values in columns.items():
        if name != "radius" and values.shape != (number, width := len(_COLUMNS[name])):
            raise SceneError(f"{where}: '{name}' must have shape ({number}, {width}), got {values.shape}")
    for name, values in columns.items():
        if not np.all(np.isfinite(values)):
            raise SceneError(f"{where}: '{name}' has values that are not finite")
    if np.any(radius <= 0.0):
        raise SceneError(f"{where}: 'radius' must be positive [m], the smallest is {radius.min():g}")
    turns = columns.setdefault("orientation", np.tile([0.0, 0.0, 0.0, 1.0], (number, 1)))
    lengths = np.linalg.norm(turns, axis=1)
    if np.any(lengths < 1e-6):
        raise SceneError(f"{where}: 'orientation' must not be the zero quaternion; 0, 0, 0, 1 is no rotation")
    return columns | {"orientation": turns / lengths[:, None]}


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    columns = read_npz(path)
    _refuse_unknown(columns, _COLUMNS)
    return {name: np.asarray(values, float) for name, values in columns.items()}


def _read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        rows = list(csv.DictReader(file, restkey="", restval=""))
    known = sum(_COLUMNS.values(), ())
    if not rows:
        raise ValueError(f"it has no line below the first, which names the columns: {', '.join(known)}")
    names = {name.strip(): name for name in rows[0]}
    _refuse_unknown(names, known)
    columns = {}
    for key, wanted in _COLUMNS.items():
        missing = [name for name in wanted if name not in names]
        if not missing:
            columns[key] = np.column_stack([[float(row[names[name]]) for row in rows] for name in wanted])
        elif len(missing) < len(wanted):
            raise ValueError(f"of the columns {', '.join(wanted)} it lacks {', '.join(missing)}")
    if "radius" in columns:
        columns["radius"] = columns["radius"][:, 0]
    return columns


def _refuse_unknown(names: Iterable[str], known: Iterable[str]) -> None:
    """A column of which the name is misspelt would be left out in silence."""
    unknown = [name for name in names if name not in known]
    if unknown and unknown[0].replace(".", "").strip("+-").isdigit():
        raise ValueError(f"the first line, with {unknown[0]} in it, must name the columns; known are {', '.join(known)}")
    if unknown:
        raise ValueError(f"unknown column '{unknown[0]}'; known are {', '.join(known)}; rename it or leave it out")
