"""Boundaries of a scene taken apart into planes, rectangles, cylinders and surfaces of revolution, with distances on the host."""

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
        kind: ``plane``, ``cylinder`` (without end, grains inside), ``shell`` (line turned about an axis), ``panel`` (rectangle).
        name: of the boundary, with the side of a box.
        material: name.
        point: of the plane, a corner of the panel or on the axis, shape (3,) [m].
        direction: plane normal towards the grains, panel normal into its bin, or axis, unit, shape (3,).
        radius: of the cylinder [m].
        begin, end: of the shell's line, distance from the axis and height above ``point``; of the panel, from ``point`` along
            each of ``tangents(direction)``; shape (2,) [m].
        joined: edges of the panel that another one stands on: 1 and 2 at begin and end along the first, 4 and 8 along the second.
        answers: those of them at which it is this one that grains outside of the corner touch.
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
    joined: int = 0
    answers: int = 0
    rough: Rough | None = None
    drive: Drive | None = None
    around: bool = False

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"wall '{self.name}'"

    def gap(self, position: np.ndarray) -> np.ndarray:
        """Distance of points, shape (n, 3) [m], from the surface, shape (n,) [m].

        It is negative behind planes and outside of cylinders without end, which push to one side only. Others push to both.
        """
        away = position - self.point
        along = away @ self.direction
        thickness = self.rough.radius if self.rough else 0.0
        if self.kind == "plane":
            return along - thickness
        if self.kind == "panel":
            here = away @ tangents(self.direction).T
            beyond = here - np.clip(here, self.begin, self.end)
            return np.linalg.norm(np.column_stack([along, beyond]), axis=1)
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
    def corners(self) -> np.ndarray | None:
        """Box around a shell or panel, shape (2, 3) [m]; None for what has no end."""
        if self.kind == "panel":
            ends = self.point + np.array([self.begin, self.end]) @ tangents(self.direction)
            return np.array([ends.min(axis=0), ends.max(axis=0)])
        if self.kind != "shell":
            return None
        middles = self.point + np.array([self.begin[1], self.end[1]])[:, None] * self.direction
        reach = max(self.begin[0], self.end[0]) * np.sqrt(1.0 - np.minimum(self.direction**2, 1.0))
        return np.array([middles.min(axis=0) - reach, middles.max(axis=0) + reach])


def tangents(direction: np.ndarray) -> np.ndarray:
    """Two unit vectors at right angles to a unit vector and to each other, shape (2, 3).

    The first is as near as can be to the coordinate axis that is farthest from the direction, the second is their cross product.
    """
    axis = np.eye(3)[np.argmin(np.abs(direction))]
    across = axis - (axis @ direction) * direction
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(direction, across)])


def walls_of(boundary: Boundary) -> list[Wall]:
    """The analytic surfaces of a boundary; one for each closed side of a box or a bin, none for a terrain."""
    if boundary.kind == "terrain":
        return []
    if boundary.low is not None:
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
    closed = [side for side in _BOX_SIDES if side not in boundary.open_sides]
    walls = []
    for side in closed:
        axis, lower = _BOX_SIDES[side]
        normal = np.zeros(3)
        normal[axis] = 1.0 if lower else -1.0
        point = np.asarray(boundary.low if lower else boundary.high, float)
        place = {"name": f"{boundary.name}/{side}", "material": boundary.material, "point": point, "direction": normal}
        if boundary.kind == "box":
            walls.append(Wall("plane", **place, rough=boundary.rough))
        else:
            walls.append(Wall("panel", **place, **_edges(boundary, side, closed)))
    return walls


def _edges(boundary: Boundary, side: str, closed: list[str]) -> dict:
    """How far a side of a bin reaches, and which others stand on its edges; the first of two answers at the one they share."""
    axis, lower = _BOX_SIDES[side]
    normal = np.eye(3)[axis] * (1.0 if lower else -1.0)
    begin, end, joined, answers = np.zeros(2), np.zeros(2), 0, 0
    for k, along in enumerate(tangents(normal)):
        other = int(np.argmax(np.abs(along)))
        size = boundary.high[other] - boundary.low[other]
        forward = along[other] > 0.0  # along the axis, from the corner that the side is measured from
        begin[k], end[k] = (0.0, size) if forward == lower else (-size, 0.0)
        for bit, low in ((1, forward), (2, not forward)):
            neighbour = next(name for name, (its_axis, its_lower) in _BOX_SIDES.items() if (its_axis, its_lower) == (other, low))
            if neighbour in closed:
                joined |= bit << 2 * k
                answers |= (bit << 2 * k) * (closed.index(side) < closed.index(neighbour))
    return {"begin": begin, "end": end, "joined": joined, "answers": answers}
