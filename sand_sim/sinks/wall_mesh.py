"""Triangles to draw walls with."""

import numpy as np

from sand_sim.scene.walls import Wall

_SECTIONS = 64


def shell_mesh(wall: Wall) -> tuple[np.ndarray, np.ndarray]:
    """A surface of revolution, both sides.

    Returns:
        Corners around ``wall.point``, shape (n, 3) [m], and indices of the corners of each triangle, shape (m, 3).
    """
    across = np.cross(wall.direction, np.eye(3)[np.argmin(np.abs(wall.direction))])
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, 2.0 * np.pi, _SECTIONS, endpoint=False)[:, None]
    radial = np.cos(angle) * across + np.sin(angle) * np.cross(wall.direction, across)
    corners = np.concatenate([end[0] * radial + end[1] * wall.direction for end in (wall.begin, wall.end)])
    here, after = np.arange(_SECTIONS), (np.arange(_SECTIONS) + 1) % _SECTIONS
    outer, outer_after = here + _SECTIONS, after + _SECTIONS
    triangles = np.concatenate([np.column_stack([here, after, outer]), np.column_stack([after, outer_after, outer])])
    return corners, np.concatenate([triangles, triangles[:, ::-1]])
