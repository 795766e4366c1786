"""Boundaries of a scene taken apart into planes and cylinders, with their distances on the host."""

from dataclasses import dataclass

import numpy as np

from sand_sim.scene.types import Boundary, unit

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
        kind: ``plane`` or ``cylinder`` (grains inside).
        name: of the boundary, with the side of a box.
        material: name.
        point: of the plane or on the axis, shape (3,) [m].
        direction: plane normal towards the grains or cylinder axis, unit, shape (3,).
        radius: of the cylinder [m].
    """

    kind: str
    name: str
    material: str
    point: np.ndarray
    direction: np.ndarray
    radius: float = 0.0

    def distance(self, position: np.ndarray) -> np.ndarray:
        """Distance of points, shape (n, 3) [m], from the surface, shape (n,) [m]; positive where grains belong."""
        away = position - self.point
        along = away @ self.direction
        if self.kind == "plane":
            return along
        return self.radius - np.linalg.norm(away - along[:, None] * self.direction, axis=1)


def walls_of(boundary: Boundary) -> list[Wall]:
    """The surfaces of a boundary; a box gives one plane for each closed side."""
    if boundary.kind != "box":
        point = np.asarray(boundary.point, float)
        return [Wall(boundary.kind, boundary.name, boundary.material, point, unit(boundary.direction), boundary.radius)]
    walls = []
    for side, (axis, lower) in _BOX_SIDES.items():
        if side not in boundary.open_sides:
            normal = np.zeros(3)
            normal[axis] = 1.0 if lower else -1.0
            point = np.asarray(boundary.low if lower else boundary.high, float)
            walls.append(Wall("plane", f"{boundary.name}/{side}", boundary.material, point, normal))
    return walls
