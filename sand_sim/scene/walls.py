"""Boundaries of a scene taken apart into planes, cylinders and surfaces of revolution, with their distances on the host."""

from dataclasses import dataclass

import numpy as np

from sand_sim.scene.types import Boundary, Drive, Rough, unit

_BOX_SIDES = {
    "left": (1, False),  # +y is left, +x is forward (REP-103)
    "right": (1, True),
    "front": (0, False),
    "back": (0, True),
    "bottom": (2, True),
    "top": (2, False),
}


@dataclass(frozen=True)
class Wall:
    """One analytic surface.

    Attributes:
        kind: ``plane``, ``cylinder`` (without end, grains inside) or ``shell``, a line turned about an axis.
        name: of the boundary, with the side of a box.
        material: name.
        point: of the plane or on the axis, shape (3,) [m].
        direction: plane normal towards the grains or axis, unit, shape (3,).
        radius: of the cylinder [m].
        begin, end: of the shell's line, distance from the axis and height above ``point``, shape (2,) [m].
        rough: its virtual spheres.
        drive: how it moves along ``direction``.
        around: whether fills put grains around a shell, not into it.
    """

    kind: str
    name: str
    material: str
    point: np.ndarray
    direction: np.ndarray
    radius: float = 0.0
    begin: np.ndarray | None = None
    end: np.ndarray | None = None
    rough: Rough | None = None
    drive: Drive | None = None
    around: bool = False

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"wall '{self.name}'"

    def gap(self, position: np.ndarray) -> np.ndarray:
        """Distance of points, shape (n, 3) [m], from the surface, shape (n,) [m].

        It is negative behind planes and outside of cylinders without end, which push to one side only. Shells push to both.
        """
        away = position - self.point
        along = away @ self.direction
        thickness = self.rough.radius if self.rough else 0.0
        if self.kind == "plane":
            return along - thickness
        from_axis = np.linalg.norm(away - along[:, None] * self.direction, axis=1)
        if self.kind == "cylinder":
            return self.radius - from_axis - thickness
        line = self.end - self.begin
        here = np.column_stack([from_axis, along]) - self.begin
        share = np.clip(here @ line / (line @ line), 0.0, 1.0)
        return np.linalg.norm(here - share[:, None] * line, axis=1) - thickness

    def distance(self, position: np.ndarray) -> np.ndarray:
        """The same, and positive only where a fill may put grains: both sides of plates and discs, one of cylinders and cones."""
        gap = self.gap(position)
        if self.kind != "shell" or self.end[1] == self.begin[1]:
            return gap
        away = position - self.point
        along = away @ self.direction
        level = (along - self.begin[1]) / (self.end[1] - self.begin[1])
        radius = self.begin[0] + level * (self.end[0] - self.begin[0])
        outside = np.linalg.norm(away - along[:, None] * self.direction, axis=1) > radius
        return np.where((level > 0.0) & (level < 1.0) & (outside != self.around), -np.abs(gap), gap)

    @property
    def corners(self) -> np.ndarray:
        """Box around a shell, shape (2, 3) [m]."""
        middles = self.point + np.array([self.begin[1], self.end[1]])[:, None] * self.direction
        reach = max(self.begin[0], self.end[0]) * np.sqrt(1.0 - np.minimum(self.direction**2, 1.0))
        return np.array([middles.min(axis=0) - reach, middles.max(axis=0) + reach])


def walls_of(boundary: Boundary) -> list[Wall]:
    """The analytic surfaces of a boundary; a box gives one plane for each closed side, a terrain none."""
    if boundary.kind == "terrain":
        return []
    if boundary.kind == "box":
        return _sides(boundary)
    shape = {"kind": "shell"}
    if boundary.kind in ("plane", "plunger") and not boundary.radius:
        shape = {"kind": "plane"}
    elif boundary.kind == "cylinder" and not boundary.height:
        shape = {"kind": "cylinder", "radius": boundary.radius}
    else:
        inner = boundary.radius if boundary.kind == "cylinder" else boundary.hole_radius
        shape |= {"begin": np.array([inner, 0.0]), "end": np.array([boundary.radius, boundary.height])}
    place = {"point": np.asarray(boundary.point, float), "direction": unit(boundary.direction)}
    common = {"name": boundary.name, "material": boundary.material, "rough": boundary.rough, "drive": boundary.drive}
    return [Wall(**shape, **place, **common, around=boundary.around)]


def _sides(boundary: Boundary) -> list[Wall]:
    walls = []
    for side, (axis, lower) in _BOX_SIDES.items():
        if side not in boundary.open_sides:
            normal = np.zeros(3)
            normal[axis] = 1.0 if lower else -1.0
            point = np.asarray(boundary.low if lower else boundary.high, float)
            name = f"{boundary.name}/{side}"
            walls.append(Wall("plane", name, boundary.material, point, normal, rough=boundary.rough))
    return walls
