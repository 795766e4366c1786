"""A scene's tools made into meshes and particles."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import trimesh

from sampler import MeshError, ParticleBody, SignedDistance, locate_mesh, read_mesh, sample_file
from sand_sim import rotation
from sand_sim.scene.shapes import shape_named
from sand_sim.scene.types import Scene, SceneError, Tool

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class ToolModel:
    """A tool with its mesh and its particles, both in the tool frame [m]."""

    tool: Tool
    mesh: trimesh.Trimesh
    body: ParticleBody

    @property
    def margin(self) -> float:
        """How far its surface lies outside the mesh [m]."""
        return self.body.radius

    @property
    def extent(self) -> float:
        """Farthest particle surface from the tool frame's origin [m]."""
        return float(np.linalg.norm(self.body.points, axis=1).max() + self.body.radius)

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner of its hull in the world at the initial pose, shape (3,) each [m]."""
        pose = self.tool.pose
        corners = np.asarray(pose.position) + rotation.rotate(np.asarray(pose.orientation), np.asarray(self.mesh.vertices))
        return corners.min(axis=0) - self.body.radius, corners.max(axis=0) + self.body.radius

    def holds(self, points: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Whether world points, shape (n, 3), are inside the mesh's bounding box at a pose of the tool, shape (n,)."""
        low, high = self.mesh.bounds
        inside = np.linalg.norm(points - position, axis=1) < self.extent
        local = rotation.rotate(rotation.inverse(orientation), points[inside] - position)
        inside[inside] = np.all((local > low) & (local < high), axis=1)
        return inside

    def distance(self, position: np.ndarray) -> np.ndarray:
        """Distance of world points, shape (n, 3), from the particles' hull at the initial pose, shape (n,) [m]."""
        pose = self.tool.pose
        local = rotation.rotate(rotation.inverse(np.asarray(pose.orientation)), position - np.asarray(pose.position))
        return SignedDistance(self.mesh).query(local)[0] - self.body.radius


def model_tool(tool: Tool, scene: Scene, progress: Progress) -> ToolModel:
    """Sample a tool's mesh, so finely that no grain of the scene's fills passes between its particles.

    Args:
        tool: of the scene.
        scene: for paths and grains.
        progress: called with the name of a stage and the share of it that is done, 0 to 1.

    Raises:
        SceneError: if the mesh cannot be used.
    """
    try:
        path = locate_mesh(tool.mesh, scene.folder)
        mesh = read_mesh(path, tool.scale)
        show = partial(progress, f"sampling {tool.name}")
        grain, spacing = _smallest_grain(scene), tool.particle_spacing
        body = sample_file(path, tool.particle_radius, tool.scale, grain=grain, spacing=spacing, progress=show)
    except MeshError as error:
        raise SceneError(f"tools.{tool.name}.mesh: {error}") from None
    return ToolModel(tool, mesh, body)


def _smallest_grain(scene: Scene) -> float | None:
    """Smallest radius of a sphere that the fills can draw, none of which may pass between a tool's particles [m]."""
    least = []
    for fill in scene.fills:
        if fill.size:
            shape = shape_named(fill.shape, f"fills: '{fill.name}'")
            share = float(shape.radii.min()) / shape.equal_radius if shape else 1.0
            least.append(share * (min(fill.size.radii) if fill.size.radii else fill.size.low or fill.size.mean))
    return min(least, default=None)
