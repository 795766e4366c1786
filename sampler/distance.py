"""Signed distance to a triangle mesh: the exact closest point on the triangles, the sign by generalized winding number."""

from functools import cached_property

import numpy as np
import trimesh

from sampler.geometry.pseudonormals import Pseudonormals
from sampler.geometry.surface import Surface
from sampler.mending.repair import RepairedMesh, repair_mesh
from sampler.sheets import closed_triangles

_NEAR = 1e-5  # of the diagonal; where single precision may blur the winding number the nearest face decides


class SignedDistance:
    """Distance queries against a mesh, on the CPU or a GPU.

    Args:
        mesh: in metres; repaired here unless it already is.
        device: Warp device.
        thickness: of sheets (surfaces modelled without thickness) [m]; at 0 they have a distance but no inside.

    Attributes:
        surface: the closed triangles.
        repaired: what they were made from.

    Raises:
        MeshError: if the mesh cannot be repaired.
    """

    def __init__(self, mesh: trimesh.Trimesh | RepairedMesh, device: str = "cpu", thickness: float = 0.0):
        self.repaired = mesh if isinstance(mesh, RepairedMesh) else repair_mesh(mesh)
        self.device, self.thickness = device, thickness
        triangles, _ = closed_triangles(self.repaired, thickness)
        self.surface = Surface(triangles, device)

    def query(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Query points.

        Args:
            points: shape (n, 3) [m], mesh frame.

        Returns:
            Signed distance, shape (n,) [m], negative inside; closest surface points, shape (n, 3) [m]; normals of the faces
            they lie on, shape (n, 3).
        """
        points = np.asarray(points, float).reshape(-1, 3)
        closest, face = self.surface.closest(points)
        distance = np.linalg.norm(points - closest, axis=1)
        inside = np.abs(self.surface.winding(points)) > 0.5
        near = np.flatnonzero((distance < _NEAR * self.surface.unit) & (distance > 0.0))
        if len(near):
            inside[near] = self._inside_near(points[near], closest[near], face[near], inside[near])
        return np.where(inside, -distance, distance), closest, self.surface.normals[face]

    @cached_property
    def _pseudonormals(self) -> Pseudonormals:
        """Made when the first point comes so near that they are asked for."""
        return Pseudonormals(self.surface.triangles)

    def _inside_near(self, points, closest, face, inside):
        """Sign by pseudonormal (Baerentzen & Aanaes 2005) where the winding number is whole on both sides of the surface."""
        normal = self._pseudonormals.at(closest, face)
        step = 2.0 * _NEAR * self.surface.unit * normal
        before, behind = self.surface.winding(closest + step), self.surface.winding(closest - step)
        usable = (before < 0.1) & (behind > 0.9)
        return np.where(usable, np.einsum("ij,ij->i", points - closest, normal) < 0.0, inside)
