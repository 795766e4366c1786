"""Triangles to draw walls with."""

import numpy as np
import trimesh

from sand_sim.scene.walls import Wall, tangents

_SECTIONS = 64
_FLOOR = 0.5  # cosine of the slope up to which a plane is a floor


def in_outline(wall: Wall, gravity: tuple[float, float, float]) -> bool:
    """Whether only the outline of a wall is drawn: of planes that bear nothing, as several would hide the grains."""
    return wall.kind == "plane" and not -wall.direction @ np.array(gravity) > _FLOOR * np.linalg.norm(gravity)


def wall_mesh(wall: Wall, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A wall, both sides; a plane as far as it lies in the domain, a cylinder without end as long as that.

    Args:
        wall: what to draw.
        low: a corner of the domain, shape (3,) [m].
        high: the opposite one, shape (3,) [m].

    Returns:
        Corners around ``wall.point``, shape (n, 3) [m], and indices of the corners of each triangle, shape (m, 3).
    """
    if wall.kind == "plane":
        corners = plane_outline(wall, low, high)
        fan = np.arange(1, max(len(corners) - 1, 1))
        triangles = np.column_stack([np.zeros_like(fan), fan, fan + 1])
        return corners, np.concatenate([triangles, triangles[:, ::-1]])
    if wall.kind == "cylinder":
        along = (trimesh.bounds.corners([low, high]) - wall.point) @ wall.direction
        return _turned(wall.direction, [(wall.radius, along.min()), (wall.radius, along.max())])
    return _turned(wall.direction, [wall.begin, wall.end])


def plane_outline(wall: Wall, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Corners around ``wall.point`` of what lies of a plane in the domain, shape (n, 3) [m], none if nothing does.

    It is a square wider than the domain, clipped along the faces of that; trimesh would need SciPy for it.
    """
    across, beside = tangents(wall.direction)
    wide = np.linalg.norm(high - low)
    middle = 0.5 * (low + high)
    middle = middle - (middle - wall.point) @ wall.direction * wall.direction
    polygon = [middle + wide * (u * across + v * beside) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    for axis in range(3):
        for inward, level in ((1.0, low[axis] - 1e-9 * wide), (-1.0, high[axis] + 1e-9 * wide)):  # a plane may lie on a face
            inside = [inward * (corner[axis] - level) for corner in polygon]
            kept = []
            for k, (here, depth) in enumerate(zip(polygon, inside, strict=True)):
                there, other = polygon[k - 1], inside[k - 1]
                if (depth < 0.0) != (other < 0.0):
                    kept.append(here + (there - here) * (depth / (depth - other)))
                if depth >= 0.0:
                    kept.append(here)
            polygon = kept
    return np.reshape(polygon, (-1, 3)) - wall.point


def _turned(axis: np.ndarray, line: list) -> tuple[np.ndarray, np.ndarray]:
    """A surface of revolution: a line between two places, distance from the axis and height along it [m], turned about it."""
    across, beside = tangents(axis)
    angle = np.linspace(0.0, 2.0 * np.pi, _SECTIONS, endpoint=False)[:, None]
    radial = np.cos(angle) * across + np.sin(angle) * beside
    corners = np.concatenate([end[0] * radial + end[1] * axis for end in line])
    here, after = np.arange(_SECTIONS), (np.arange(_SECTIONS) + 1) % _SECTIONS
    outer, outer_after = here + _SECTIONS, after + _SECTIONS
    triangles = np.concatenate([np.column_stack([here, after, outer]), np.column_stack([after, outer_after, outer])])
    return corners, np.concatenate([triangles, triangles[:, ::-1]])
