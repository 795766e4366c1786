"""The angle at which grains of a scene come to rest: the way to choose friction and rolling resistance after real sand.

A bed 70 grains long, 6 wide and 24 deep lies on rough ground between two frictionless sides. One of its ends is taken away, sand
flows over the ledge that is left, and the slope that stays is measured: an experiment for which a box will do. Angles of heaps,
drums and ledges differ by some degrees for one sand, so compare like with like. Layers of a few grains on rough ground stand
steeper (Pouliquen 1999), so the foot of the slope does not count.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sand_sim.border import GrainCloud
from sand_sim.scene.types import Boundary, Fill, PairRule, Rough, Scene, SceneError, Settle, SizeDistribution
from sand_sim.world import World

SIZE = 70.0, 6.0, 24.0  # of a bed, in diameters
_SIDE = "frictionless side"
_LOOSE = 5.0  # times the height of the bed, up to which it is filled loosely
_SETTLED, _PATIENCE = 0.02, 20.0  # how slow it is then, times sqrt(g d), and how long that may take, times sqrt(h/g)
_PART, _FIRST, _PARTS = 0.25, 8, 100  # how long it flows until the next look, times sqrt(l/g); looks at least and at most
_CALM, _RESTS = 4, 0.002  # it rests when in so many looks no larger share falls over the ledge; single spheres roll on for long
_SQUARE = 2.0  # the highest grain of each square so wide is the surface, in diameters
_FOOT, _CREST = 0.3, 0.8  # the slope is measured between these shares of the height
_LEVEL = 0.85  # share of the height that must be left behind the slope; else it reaches the end, and only layers are measured
_LEAST = 3  # rows of squares that make a slope


@dataclass(frozen=True)
class Repose:
    """Where one bed came to rest.

    Attributes:
        angle: between its slope and the horizontal [degrees].
        slope: way from the ledge and height above the ground of what was measured, shape (n, 2) [m].
        grains: that were there at first.
        doubts: why it should not be trusted.
    """

    angle: float
    slope: np.ndarray
    grains: int
    doubts: tuple[str, ...]


def find_repose(
    scene: Scene,
    fill: str,
    seed: int,
    folder: Path,
    progress: Callable[[str, float], None] = lambda stage, share: None,
    size: tuple[float, float, float] = SIZE,
) -> Repose:
    """Let a bed of a scene's grains flow over a ledge and see where it comes to rest.

    Args:
        scene: whose materials, contact laws, solver and grains are taken.
        fill: name of the grains.
        seed: of the bed.
        folder: for a file of grains.
        progress: called with the name of a stage and the share of it that is done, 0 to 1; may raise to give up.
        size: length, width and height of the bed, in diameters of a grain of the mean volume.

    Raises:
        SceneError: if there is no such fill, its grains are read from a file, there is no gravity, or no slope stays.
    """
    own = next((one for one in scene.fills if one.name == fill), None)
    if own is None:
        raise SceneError(f"fills: there is no '{fill}'; the scene has {', '.join(one.name for one in scene.fills) or 'none'}")
    if own.size is None:
        raise SceneError(f"fills: '{fill}' is read from a file; take one with a 'radius', of which any bed can be made")
    gravity, diameter = float(np.linalg.norm(scene.gravity)), 2.0 * _typical(own.size)
    if not gravity:
        raise SceneError("gravity: nothing comes to rest without it")
    closed = _bed(scene, replace(own, seed=seed), diameter * np.array(size), diameter, gravity)
    before = World(closed, progress).observe().grains
    density = scene.materials[scene.material_index(own.material)].density
    radius = np.cbrt(before.mass / (4.0 / 3.0 * np.pi * density))  # of clumps, too, that of a sphere as large
    np.savez(folder / "bed.npz", position=before.position, radius=radius, orientation=before.orientation)
    same = replace(closed.fills[0], file=folder / "bed.npz", size=None, height=None)
    world = World(replace(closed, fills=(same,), boundaries=closed.boundaries[1:], settle=Settle()))
    part = round(_PART * math.sqrt(size[0] * diameter / gravity) / world.time_step)
    left = [len(before)]
    while len(left) <= _PARTS:
        world.step(part)
        seen = world.observe()
        left.append(len(seen.grains))
        progress("flowing", len(left) / _PARTS)
        if len(left) > _FIRST and left[-1 - _CALM] - left[-1] <= _RESTS * left[-1]:
            break
    else:
        raise SceneError(f"fills: '{fill}' still flows after {world.time:.2g} s")
    progress("flowing", 1.0)
    slope, level = _slope(seen.grains, diameter)
    if len(slope) < _LEAST:
        raise SceneError(f"fills: '{fill}' stands too steep at the ledge to measure a slope, or has none left")
    doubts = seen.health.doubts
    if level < _LEVEL * size[2] * diameter:
        doubts += ("the slope reaches the end of the bed, so it is flatter than that; sand so slippery is not measured here",)
    return Repose(math.degrees(math.atan(np.polyfit(*slope.T, 1)[0])), slope, len(before), doubts)


def _typical(size: SizeDistribution) -> float:
    """Radius of a grain of the mean volume [m]."""
    if size.kind == "table":
        return float(np.average(np.power(size.radii, 3.0), weights=size.weights) ** (1.0 / 3.0))
    if size.kind == "uniform":
        return (0.25 * (size.high**2 + size.low**2) * (size.high + size.low)) ** (1.0 / 3.0)
    return size.mean


def _bed(scene: Scene, fill: Fill, size: np.ndarray, diameter: float, gravity: float) -> Scene:
    """A settled bed of a scene's grains behind a wall, its first boundary, at the ledge, which is the plane x = 0."""
    length, width, height = map(float, size)
    own = scene.materials[scene.material_index(fill.material)]
    rule = scene.pair(own.name, own.name)
    slippery = PairRule((own.name, _SIDE), rule.numbers | {"friction": 0.0, "rolling_friction": 0.0})
    walls = (
        Boundary("plane", own.name, "gate", direction=(1.0, 0.0, 0.0)),
        Boundary("plane", own.name, "end", point=(length, 0.0, 0.0), direction=(-1.0, 0.0, 0.0)),
        Boundary("plane", own.name, "ground", direction=(0.0, 0.0, 1.0), rough=Rough(0.5 * diameter, diameter)),
        Boundary("plane", _SIDE, "right", direction=(0.0, 1.0, 0.0)),
        Boundary("plane", _SIDE, "left", point=(0.0, width, 0.0), direction=(0.0, -1.0, 0.0)),
    )
    loose = {"low": (0.0, 0.0, 0.5 * diameter), "high": (length, width, _LOOSE * height)}
    return replace(
        scene,
        materials=(own, replace(own, name=_SIDE)),
        pairs=(rule, slippery),
        fills=(replace(fill, **loose, count=None, height=height, velocity=(0.0, 0.0, 0.0)),),
        boundaries=walls,
        tools=(),
        bodies=(),
        gravity=(0.0, 0.0, -gravity),
        domain=((-diameter, -diameter, -diameter), (length + diameter, width + diameter, (_LOOSE + 1.0) * height)),
        settle=Settle(time=_PATIENCE * math.sqrt(height / gravity), speed=_SETTLED * math.sqrt(gravity * diameter)),
    )


def _slope(grains: GrainCloud, diameter: float) -> tuple[np.ndarray, float]:
    """Way from the ledge and height of the surface, shape (n, 2) [m], where a bed slopes; and how high it is at most [m]."""
    square = np.floor(grains.position[:, :2] / (_SQUARE * diameter)).astype(int).clip(0)
    highest = np.zeros(square.max(axis=0) + 1)
    np.maximum.at(highest, tuple(square.T), grains.position[:, 2] + grains.radius)
    height = highest.mean(axis=1)
    way = (np.arange(len(height)) + 0.5) * _SQUARE * diameter
    full = height.max()
    crest = np.flatnonzero(height > _CREST * full)[0]
    return np.column_stack([way, height])[:crest][height[:crest] > _FOOT * full], float(full)
