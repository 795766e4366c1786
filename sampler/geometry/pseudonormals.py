"""Angle-weighted pseudonormals of faces, edges and vertices (Baerentzen & Aanaes 2005)."""

import numpy as np

from sampler.geometry.surface import Surface
from sampler.geometry.topology import edges_of, merge_points

_ON = 1e-9  # barycentric distance from an edge or corner that counts as on it


class Pseudonormals:
    """Normals whose sign tells inside from outside at any closest point of a closed manifold surface.

    Args:
        triangles: corners, shape (n, 3, 3) [m].
    """

    def __init__(self, triangles: np.ndarray):
        self._triangles, self._normal = triangles, Surface.normals_of(triangles)
        _, vertex = np.unique(merge_points(triangles.reshape(-1, 3)), return_inverse=True)
        self._faces = vertex.reshape(-1, 3)
        self._at_vertex = np.zeros((int(vertex.max()) + 1, 3))
        for k in range(3):
            p, q = triangles[:, (k + 1) % 3] - triangles[:, k], triangles[:, (k + 2) % 3] - triangles[:, k]
            angle = np.arctan2(np.linalg.norm(np.cross(p, q), axis=1), np.einsum("ij,ij->i", p, q))
            np.add.at(self._at_vertex, self._faces[:, k], angle[:, None] * self._normal)
        edges = edges_of(self._faces)
        at_edge = np.zeros((len(edges.ends), 3))
        np.add.at(at_edge, edges.edge, self._normal[edges.face])
        lookup = edges.ends[:, 0] * len(self._at_vertex) + edges.ends[:, 1]
        tail, head = self._faces, np.roll(self._faces, -1, axis=1)
        wanted = np.minimum(tail, head).astype(np.int64) * len(self._at_vertex) + np.maximum(tail, head)
        self._at_edge = at_edge[np.searchsorted(lookup, wanted)]

    def at(self, points: np.ndarray, face: np.ndarray) -> np.ndarray:
        """Pseudonormal of points on faces.

        Args:
            points: on the surface, shape (n, 3) [m].
            face: the triangle of each, shape (n,).

        Returns:
            Unit vectors, shape (n, 3).
        """
        corner = self._triangles[face]
        normal = self._normal[face].copy()
        for k in range(3):  # edges, then corners, the later winning
            a, along = corner[:, k], corner[:, (k + 1) % 3] - corner[:, k]
            square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
            away = points - a - (np.einsum("ij,ij->i", points - a, along) / square)[:, None] * along
            on = np.einsum("ij,ij->i", away, away) < _ON**2 * square
            normal[on] = self._at_edge[face[on], k]
        for k in range(3):
            scale = np.linalg.norm(corner[:, (k + 1) % 3] - corner[:, k], axis=1)
            on = np.linalg.norm(points - corner[:, k], axis=1) < _ON * scale
            normal[on] = self._at_vertex[self._faces[face[on], k]]
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
