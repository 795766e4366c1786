"""Polygons of files, cut into triangles; readers cut them like a fan, over their edge and back where they are not convex."""

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.geometry.loops import span_loops


def mesh_of(name: str, vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> trimesh.Trimesh:
    """Mesh of polygons.

    Args:
        name: of the file.
        vertices: shape (n, 3).
        corners: vertex numbers of all polygons, one polygon after the other, shape (k,).
        sizes: number of corners of each polygon, shape (m,).

    Raises:
        MeshError: if a vertex is not there.
    """
    check_corners(name, corners, len(vertices))
    return trimesh.Trimesh(vertices, corners[cut_polygons(vertices[corners], sizes)], process=False)


def check_corners(name: str, corners: np.ndarray, number: int) -> None:
    """Refuse vertex numbers beyond a number of vertices.

    Raises:
        MeshError: with the vertex.
    """
    missing = corners[(corners < 0) | (corners >= number)]
    if len(missing):
        raise MeshError(f"mesh {name}: a face refers to vertex {missing[0]} of {number}; the file is corrupt")


def cut_polygons(points: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Triangles of polygons: a fan where one is convex, else those of least area.

    Args:
        points: corners of all polygons, one polygon after the other, shape (k, 3).
        sizes: number of corners of each polygon, shape (m,); what has fewer than three gets no triangle.

    Returns:
        Numbers of the corners, shape (n, 3).
    """
    triangles = [np.zeros((0, 3), np.int64)]
    for corners, hollow in _alike(points, sizes):
        k = np.arange(1, corners.shape[1] - 1)
        triangles.append(corners[~hollow][:, np.stack([0 * k, k, k + 1], axis=1)].reshape(-1, 3))
        triangles += span_loops(points, corners[hollow])
    return np.concatenate(triangles)


def are_hollow(points: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Which polygons, given as in ``cut_polygons``, do not turn one way all around, shape (m,)."""
    begin = np.cumsum(sizes) - sizes
    found = [corners[hollow, 0] for corners, hollow in _alike(points, sizes)]
    return np.isin(begin, np.concatenate(found)) & (sizes > 2) if found else np.zeros(len(sizes), bool)


def _alike(points: np.ndarray, sizes: np.ndarray):
    """Yield numbers of the corners of all polygons that have as many, shape (m, n), and which are hollow, shape (m,)."""
    begin = np.cumsum(sizes) - sizes
    for size in np.unique(sizes[sizes > 2]):
        corners = begin[sizes == size, None] + np.arange(size)
        polygon = points[corners]
        along = np.roll(polygon, -1, axis=1) - polygon
        turn = np.cross(along, np.roll(along, -1, axis=1))
        normal = np.cross(polygon - polygon[:, :1], along).sum(axis=1)
        yield corners, np.any(np.einsum("mnj,mj->mn", turn, normal) < 0.0, axis=1)
