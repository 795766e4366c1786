"""Terrain: ground that never moves, from a mesh or from a grid of heights, as particles or as the surface itself."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from sampler import MeshError, ParticleBody, SignedDistance, locate_mesh, read_mesh, sample_body
from sampler.geometry.surface import Surface
from sand_sim import rotation
from sand_sim.assembly.true_surface import outward_triangles, reach_of_touched
from sand_sim.scene.heights import read_heights
from sand_sim.scene.types import SMOOTH, Boundary, Pose, SceneError, Terrain

_DEPTH = 4.0  # of the solid below the lowest height of a smooth ground, in particle radii


@dataclass(frozen=True)
class Ground:
    """A terrain as it lies in the world.

    Attributes:
        name: of the boundary.
        material: name.
        place: world position of the frame that mesh and particles are in, whose axes are those of the world, shape (3,) [m].
        mesh: around the middle of its bounding box [m].
        body: its particles.
        surface: what grains touch of a smooth one instead, shape (n, 3, 3) [m].
    """

    name: str
    material: str
    place: np.ndarray
    mesh: trimesh.Trimesh
    body: ParticleBody
    surface: np.ndarray | None = None

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
        """Farthest point of what grains touch from the frame's origin [m]."""
        return reach_of_touched(self.body, self.surface).extent

    @property
    def smooth(self) -> bool:
        """Whether grains touch the surface itself."""
        return self.surface is not None

    def distance(self, position: np.ndarray) -> np.ndarray:
        """Distance of world points, shape (n, 3), from what grains touch, shape (n,) [m].

        Positive outside a closed mesh, and on the side that the normals of a rough open one point to.
        """
        local = position - self.place
        if self.smooth:
            return SignedDistance(trimesh.Trimesh(**trimesh.triangles.to_kwargs(self.surface))).query(local)[0]
        joined = trimesh.Trimesh(self.mesh.vertices, self.mesh.faces)  # an STL file gives each triangle corners of its own
        if joined.is_watertight:
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
            mesh = _relief(read_heights(terrain.heights) * terrain.scale, terrain)
        mesh.vertices = rotation.rotate(np.asarray(terrain.pose.orientation), mesh.vertices) + terrain.pose.position
        place = mesh.bounds.mean(axis=0)
        mesh.vertices = mesh.vertices - place
        body = sample_body(mesh, terrain.particle_radius, thickness=terrain.thickness, sheets=terrain.sheets, progress=progress)
        if terrain.heights:
            body = replace(body, warnings=tuple(told for told in body.warnings if "sheets" not in told))  # of course
    except (MeshError, SceneError) as error:
        raise SceneError(f"boundaries: {source} of terrain '{boundary.name}': {error}") from None
    surface = outward_triangles(body.triangles) if terrain.contact == SMOOTH else None
    return Ground(boundary.name, boundary.material, place, mesh, body, surface)


def _relief(heights: np.ndarray, terrain: Terrain) -> trimesh.Trimesh:
    """Two triangles for each cell of the grid, facing up; below a smooth ground a solid, from which grains are driven upwards."""
    rows, columns = heights.shape
    y, x = np.mgrid[:rows, :columns] * terrain.spacing
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (corner.ravel() for corner in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    top = np.column_stack([x.ravel(), y.ravel(), heights.ravel()])
    if terrain.contact != SMOOTH:
        return trimesh.Trimesh(top, faces, process=False)
    bottom = np.column_stack([top[:, :2], np.full(len(top), heights.min() - _DEPTH * terrain.particle_radius)])
    rim = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    after, below = np.roll(rim, -1), len(top)
    sides = [np.column_stack([rim, rim + below, after + below]), np.column_stack([rim, after + below, after])]
    return trimesh.Trimesh(np.concatenate([top, bottom]), np.concatenate([faces, faces[:, ::-1] + below, *sides]), process=False)
