"""Terrain: ground sampled into particles that never move, from a mesh or from a grid of heights."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from sampler import MeshError, ParticleBody, SignedDistance, locate_mesh, read_mesh, sample_body
from sampler.surface import Surface
from sand_sim import rotation
from sand_sim.scene.heights import read_heights
from sand_sim.scene.types import Boundary, Pose, SceneError, Terrain


@dataclass(frozen=True)
class Ground:
    """A terrain as it lies in the world.

    Attributes:
        name: of the boundary.
        material: name.
        place: world position of the frame that mesh and particles are in, whose axes are those of the world, shape (3,) [m].
        mesh: around the middle of its bounding box [m].
        body: its particles.
    """

    name: str
    material: str
    place: np.ndarray
    mesh: trimesh.Trimesh
    body: ParticleBody

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"terrain '{self.name}'"

    @property
    def pose(self) -> Pose:
        """Of the frame."""
        return Pose(tuple(self.place.tolist()))

    @property
    def extent(self) -> float:
        """Farthest particle surface from the frame's origin [m]."""
        return float(np.linalg.norm(self.body.points, axis=1).max() + self.body.radius)

    def distance(self, position: np.ndarray) -> np.ndarray:
        """Distance of world points, shape (n, 3), from the particles' hull, shape (n,) [m].

        Positive outside a closed mesh, and on the side that the normals of an open one point to.
        """
        local = position - self.place
        if self.mesh.is_watertight:
            return SignedDistance(self.mesh).query(local)[0] - self.body.radius
        surface = Surface(np.asarray(self.mesh.triangles, float), "cpu")
        closest, face = surface.closest(local)
        away = local - closest
        side = np.einsum("ij,ij->i", away, surface.normals[face])
        return np.copysign(np.linalg.norm(away, axis=1), side) - self.body.radius


def model_ground(boundary: Boundary, folder: Path, progress: Callable[[float], None]) -> Ground:
    """Sample a terrain.

    Args:
        boundary: of kind ``terrain``.
        folder: where relative paths start.
        progress: called with the share of the work done, 0 to 1.

    Raises:
        SceneError: if its file cannot be used, or would make too many particles.
    """
    terrain = boundary.terrain
    source = "mesh" if terrain.mesh else "heights"
    try:
        if terrain.mesh:
            mesh = read_mesh(locate_mesh(terrain.mesh, folder), terrain.scale)
        else:
            mesh = _sheet(read_heights(terrain.heights) * terrain.scale, terrain)
        mesh.vertices = rotation.rotate(np.asarray(terrain.pose.orientation), mesh.vertices) + terrain.pose.position
        place = mesh.bounds.mean(axis=0)
        mesh.vertices = mesh.vertices - place
        body = sample_body(mesh, terrain.particle_radius, progress=progress)
    except (MeshError, SceneError) as error:
        raise SceneError(f"boundaries: {source} of terrain '{boundary.name}': {error}") from None
    return Ground(boundary.name, boundary.material, place, mesh, body)


def _sheet(heights: np.ndarray, terrain: Terrain) -> trimesh.Trimesh:
    """Two triangles for each cell of the grid, facing up."""
    rows, columns = heights.shape
    y, x = np.mgrid[:rows, :columns] * terrain.spacing
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (corner.ravel() for corner in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return trimesh.Trimesh(np.column_stack([x.ravel(), y.ravel(), heights.ravel()]), faces, process=False)
