"""A scene's tools made into meshes and particles."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import trimesh

from sampler import MeshError, ParticleBody, SignedDistance, locate_mesh, read_mesh, sample_mesh
from sand_sim import rotation
from sand_sim.assembly.link_mesh import model_link
from sand_sim.assembly.true_surface import outward_triangles, reach_of_touched
from sand_sim.reach import Reach
from sand_sim.scene.types import SMOOTH, Scene, SceneError, Tool

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class ToolModel:
    """A tool with its mesh and its particles, both in the tool frame [m].

    Grains touch its particles if it is rough, and the triangles of its ``surface``, shape (n, 3, 3) [m], if it is smooth, which
    are those of the mesh as repaired.
    """

    tool: Tool
    mesh: trimesh.Trimesh
    body: ParticleBody
    surface: np.ndarray | None = None

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"tool '{self.tool.name}'"

    @property
    def smooth(self) -> bool:
        """Whether grains touch the mesh itself."""
        return self.surface is not None

    @property
    def margin(self) -> float:
        """How far its surface lies outside the mesh [m]."""
        return 0.0 if self.smooth else self.body.radius

    @cached_property
    def reach(self) -> Reach:
        """How far its surface reaches in the tool frame."""
        return reach_of_touched(self.body, self.surface)

    @property
    def extent(self) -> float:
        """Farthest point of its surface from the tool frame's origin [m]."""
        return self.reach.extent

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner of its hull in the world at the initial pose, shape (3,) each [m]."""
        pose = self.tool.pose
        points = np.asarray(self.mesh.vertices) if self.surface is None else self.surface.reshape(-1, 3)
        corners = np.asarray(pose.position) + rotation.rotate(np.asarray(pose.orientation), points)
        return corners.min(axis=0) - self.margin, corners.max(axis=0) + self.margin

    def holds(self, points: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Whether world points, shape (n, 3), are inside the mesh's bounding box at a pose of the tool, shape (n,)."""
        low, high = self.mesh.bounds
        # The corners of the box may lie farther out than any point of the tool.
        inside = np.linalg.norm(points - position, axis=1) < np.linalg.norm(np.maximum(np.abs(low), np.abs(high)))
        local = rotation.rotate(rotation.inverse(orientation), points[inside] - position)
        inside[inside] = np.all((local > low) & (local < high), axis=1)
        return inside

    def distance(self, position: np.ndarray) -> np.ndarray:
        """Distance of world points, shape (n, 3), from its surface at the initial pose, shape (n,) [m]."""
        pose = self.tool.pose
        local = rotation.rotate(rotation.inverse(np.asarray(pose.orientation)), position - np.asarray(pose.position))
        return self._solid.query(local)[0] - self.margin

    @cached_property
    def _solid(self) -> SignedDistance:
        return SignedDistance(self.mesh if self.surface is None else trimesh.Trimesh(**trimesh.triangles.to_kwargs(self.surface)))


def with_mesh(tool: Tool, mesh: str, scale: float) -> Tool:
    """The tool with another mesh, in place of its own or of the link of a robot that it was."""
    return replace(tool, mesh=mesh, scale=float(scale), urdf="", link="")


def model_tool(tool: Tool, scene: Scene, grain: float | None, progress: Progress = lambda stage, share: None) -> ToolModel:
    """Sample a tool's mesh, so finely that no grain of the scene passes between the particles it may touch.

    Args:
        tool: of the scene.
        scene: for paths.
        grain: radius of the smallest one [m], None without any.
        progress: called with the name of a stage and the share of it that is done, 0 to 1.

    Raises:
        SceneError: if the mesh cannot be used.
    """
    try:
        mesh = model_link(tool, scene) if tool.link else read_mesh(locate_mesh(tool.mesh, scene.folder), tool.scale)
        show = partial(progress, f"sampling {tool.name}")
        grain = None if tool.contact == SMOOTH else grain
        options = {"grain": grain, "spacing": tool.particle_spacing, "thickness": tool.thickness, "sheets": tool.sheets}
        body = sample_mesh(mesh, tool.particle_radius, progress=show, **options)
    except MeshError as error:
        raise SceneError(f"tools.{tool.name}.{'link' if tool.link else 'mesh'}: {error}") from None
    return ToolModel(tool, mesh, body, outward_triangles(body.triangles) if tool.contact == SMOOTH else None)
