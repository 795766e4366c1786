"""Where the grains of a fill start: loosely packed in their region, or as a file says."""

import csv
from pathlib import Path

import numpy as np

from sand_sim.grain_table import GrainTable
from sand_sim.scene.types import Fill, Material, SceneError, SizeDistribution
from sand_sim.scene.walls import Wall

_GAP = 1.06  # lattice spacing over the largest diameter
_JITTER = 0.4  # of the gap
_POURED_FRACTION = 0.61  # of solid in a settled bed, a little high so that a fill by height can be struck off


def fill_grains(fill: Fill, material: Material, index: int, walls: list[Wall]) -> GrainTable:
    """Place the grains of a fill.

    Args:
        fill: what the scene asks for.
        material: of the grains.
        index: of the material in the scene.
        walls: surfaces that no grain may cut.

    Raises:
        SceneError: if the region cannot hold them, or the file is unreadable.
    """
    if fill.file is not None:
        return _read_positions(fill, material, index)
    random = np.random.default_rng(fill.seed)
    largest = _largest(fill.size)
    points = _lattice(np.asarray(fill.low, float), np.asarray(fill.high, float), largest, random)
    for wall in walls:
        points = points[wall.distance(points) > largest]
    wanted = fill.count or _count_for_height(fill, walls, random)
    if wanted > len(points):
        raise SceneError(
            f"fills: '{fill.name}' has room for {len(points)} loosely packed grains but {wanted} are wanted; "
            "enlarge 'region' or ask for fewer grains"
        )
    return _table(points[:wanted], _draw(fill.size, wanted, random), fill, material, index)


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


def _lattice(low: np.ndarray, high: np.ndarray, radius: float, random: np.random.Generator) -> np.ndarray:
    """Jittered cubic lattice points at least a radius inside the region, lowest first, shape (n, 3) [m]."""
    spacing = 2.0 * radius * _GAP
    counts = np.floor((high - low - 2.0 * radius) / spacing + 1e-9).astype(int) + 1
    if np.any(high - low < 2.0 * radius):
        return np.zeros((0, 3))
    axes = [low[k] + radius + (high[k] - low[k] - 2.0 * radius) * _even(counts[k]) for k in range(2)]
    axes.append(low[2] + radius + spacing * np.arange(counts[2]))
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    slack = _JITTER * (spacing - 2.0 * radius)
    points += random.uniform(-slack, slack, points.shape)
    return np.clip(points, low + radius, high - radius)


def _even(count: int) -> np.ndarray:
    return np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])


def _count_for_height(fill: Fill, walls: list[Wall], random: np.random.Generator) -> int:
    """Grains for a bed of the asked height; the cross section is what the walls leave of the region, by random points."""
    low, high = np.asarray(fill.low), np.asarray(fill.high)
    samples = random.uniform(low, [high[0], high[1], low[2] + fill.height], (200_000, 3))
    inside = np.ones(len(samples), bool)
    for wall in walls:
        inside &= wall.distance(samples) > 0.0
    volume = inside.mean() * float(np.prod(high[:2] - low[:2])) * fill.height
    grain = float(np.mean(4.0 / 3.0 * np.pi * _draw(fill.size, 100_000, random) ** 3))
    return max(1, round(_POURED_FRACTION * volume / grain))


def _table(position: np.ndarray, radius: np.ndarray, fill: Fill, material: Material, index: int) -> GrainTable:
    number = len(radius)
    return GrainTable(
        position=position,
        velocity=np.tile(np.asarray(fill.velocity, float), (number, 1)),
        spin=np.zeros((number, 3)),
        radius=radius,
        density=np.full(number, material.density),
        material=np.full(number, index),
    )


def _read_positions(fill: Fill, material: Material, index: int) -> GrainTable:
    """Grains from an npz (position, radius, optionally velocity, spin) or csv file (x, y, z, radius, vx, vy, vz, wx, wy, wz)."""
    path = Path(fill.file)
    where = f"fills: file '{path.name}' of '{fill.name}'"
    try:
        columns = dict(np.load(path)) if path.suffix == ".npz" else _read_csv(path)
    except OSError as error:
        raise SceneError(f"{where} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise SceneError(f"{where} is not a readable npz or csv file: {error}") from None
    for name in ("position", "radius"):
        if name not in columns:
            raise SceneError(f"{where} has no '{name}'; it has {', '.join(columns) or 'nothing'}")
    position, radius = np.asarray(columns["position"], float), np.asarray(columns["radius"], float)
    if position.ndim != 2 or position.shape[1] != 3 or not len(position):
        raise SceneError(f"{where}: 'position' must have shape (n, 3) with n > 0, got {position.shape}")
    number = len(position)
    if radius.shape != (number,):
        raise SceneError(f"{where}: 'radius' must have shape ({number},), got {radius.shape}")
    table = _table(position, radius, fill, material, index)
    for name in ("velocity", "spin"):
        if name in columns:
            values = np.asarray(columns[name], float)
            if values.shape != (number, 3):
                raise SceneError(f"{where}: '{name}' must have shape ({number}, 3), got {values.shape}")
            getattr(table, name)[:] = values
    for name in ("position", "radius", "velocity", "spin"):
        if not np.all(np.isfinite(getattr(table, name))):
            raise SceneError(f"{where}: '{name}' has values that are not finite")
    if np.any(radius <= 0.0):
        raise SceneError(f"{where}: 'radius' must be positive [m], the smallest is {radius.min():g}")
    return table


def _read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        return {}
    names = {name.strip(): name for name in rows[0]}

    def column(*wanted):
        return np.column_stack([[float(row[names[name]]) for row in rows] for name in wanted])

    columns = {}
    for key, wanted in (("position", ("x", "y", "z")), ("velocity", ("vx", "vy", "vz")), ("spin", ("wx", "wy", "wz"))):
        if all(name in names for name in wanted):
            columns[key] = column(*wanted)
    if "radius" in names:
        columns["radius"] = column("radius")[:, 0]
    return columns
