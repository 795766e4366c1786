"""A scene's free rigid bodies made into spheres, masses and meshes."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

from sampler import MeshError, SignedDistance, locate_mesh, read_mesh, sample_file
from sand_sim import rotation
from sand_sim.grain_table import BodyTable, GrainTable
from sand_sim.scene.clumps import members_of
from sand_sim.scene.shapes import Shape, principal_shape, read_shape, shape_of_spheres
from sand_sim.scene.types import Body, Scene, SceneError


@dataclass(frozen=True)
class BodyModel:
    """A free rigid body.

    Attributes:
        body: what the scene says.
        mesh: in the body's own frame; None if it was given by spheres.
        shape: its spheres in the principal frame.
        mass: [kg].
        gyration: principal moments over the mass, shape (3,) [m^2].
        warnings: what had to be mended or guessed in the mesh.
    """

    body: Body
    mesh: trimesh.Trimesh | None
    shape: Shape
    mass: float
    gyration: np.ndarray
    warnings: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"body '{self.body.name}'"

    @property
    def lever(self) -> np.ndarray:
        """From the centre of mass to the origin of the body's own frame, in the principal frame, shape (3,) [m]."""
        return -self.shape.middle @ self.shape.axes

    def lead(self, spin: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """How much faster the centre of mass moves than the origin of the body's own frame, shape (3,) [m/s].

        Args:
            spin: world frame, shape (3,) [rad/s].
            orientation: own frame to world frame, shape (4,).
        """
        return np.cross(spin, rotation.rotate(orientation, self.shape.middle))

    def table(self, material: int) -> GrainTable:
        """The body and its spheres where the scene puts them, of the material with this index."""
        pose = self.body.pose
        turn = rotation.to_matrices(np.asarray(pose.orientation))
        row = BodyTable(
            position=(np.asarray(pose.position) + turn @ self.shape.middle)[None],
            orientation=rotation.from_matrix(turn @ self.shape.axes)[None],
            velocity=np.asarray(self.body.velocity, float)[None],
            spin=np.asarray(self.body.spin, float)[None],
            mass=np.array([self.mass]),
            inertia=(self.mass * self.gyration)[None],
        )
        owner = np.zeros(len(self.shape.radii), int)
        return members_of(row, owner, self.shape.centres, self.shape.radii, self.mass / self.shape.volume, material)

    def distance(self, position: np.ndarray) -> np.ndarray:
        """Distance of world points, shape (n, 3), from the body where the scene puts it, shape (n,) [m]."""
        pose = self.body.pose
        local = rotation.rotate(rotation.inverse(np.asarray(pose.orientation)), position - np.asarray(pose.position))
        if self.mesh is not None:
            return SignedDistance(self.mesh).query(local)[0] - self.body.particle_radius
        local = (local - self.shape.middle) @ self.shape.axes
        nearest = np.full(len(position), np.inf)
        for centre, radius in zip(self.shape.centres, self.shape.radii, strict=True):
            nearest = np.minimum(nearest, np.linalg.norm(local - centre, axis=1) - radius)
        return nearest

    def own_frame(self, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose of the body's own frame, (3,) and (4,), from that of its principal frame."""
        axes = rotation.to_matrices(orientation) @ self.shape.axes.T
        return position - axes @ self.shape.middle, rotation.from_matrix(axes)


def model_body(body: Body, scene: Scene, grain: float | None, progress) -> BodyModel:
    """Sample a body's mesh, so finely that no grain gets in, or take its spheres, and find its mass properties.

    Args:
        body: of the scene.
        scene: for density and paths.
        grain: radius of the smallest one [m], None without any.
        progress: as ``assemble``'s.

    Raises:
        SceneError: if a mesh or a file cannot be used.
    """
    density, where = scene.materials[scene.material_index(body.material)].density, f"bodies.{body.name}"
    mesh, warnings = None, ()
    if body.mesh is not None:
        try:
            path, show = locate_mesh(body.mesh, scene.folder), partial(progress, f"sampling {body.name}")
            mesh = read_mesh(path, body.scale)
            options = {"grain": grain, "thickness": body.thickness, "sheets": body.sheets, "progress": show}
            skin = sample_file(path, body.particle_radius, body.scale, **options)
        except MeshError as error:
            raise SceneError(f"{where}.mesh: {error}") from None
        if not np.isfinite(skin.volume) and body.inertia is None:
            raise SceneError(f"{where}.mesh: is not closed, so it has no mass; close it, or give 'mass' and 'inertia'")
        warnings = skin.warnings if body.inertia is not None else (*skin.warnings, *skin.mass_warnings)
        radii = np.full(len(skin.points), body.particle_radius)
        inertia = skin.inertia / skin.volume if np.isfinite(skin.volume) else np.eye(3)
        shape = principal_shape(skin.points, radii, skin.volume, skin.centre, inertia)
    else:
        try:
            shape = read_shape(body.spheres) if isinstance(body.spheres, Path) else _listed(body.spheres)
        except SceneError as error:
            raise SceneError(f"{where}.spheres: {error}") from None
    if body.inertia is not None:
        shape = shape.with_axes(np.eye(3))
        return BodyModel(body, mesh, shape, body.mass, np.asarray(body.inertia) / body.mass, warnings)
    return BodyModel(body, mesh, shape, body.mass or density * shape.volume, shape.gyration, warnings)


def _listed(rows: tuple) -> Shape:
    spheres = np.asarray(rows, float)
    return shape_of_spheres(spheres[:, :3], spheres[:, 3])


def lighten(scene: Scene, table: GrainTable, order: list[str]) -> Scene:
    """The scene as the time step must see it: no sphere heavier than what yields at its contacts.

    A push at an arm a from the centre of a body of mass m and inertia I moves ``1 / (1/m + a^2/I)``, which for hollow, slender or
    given masses can be less than the mass of a solid sphere of that radius; the density of the material is lowered by as much.

    Args:
        scene: as read.
        table: grains and bodies.
        order: names of the materials by their index in the table.
    """
    materials = list(scene.materials)
    part = ~table.lone
    body, bodies = table.body[part], table.bodies
    arm = np.linalg.norm(table.offset[part], axis=1)
    yields = 1.0 / (1.0 / bodies.mass[body] + arm**2 / bodies.inertia.min(axis=1, initial=np.inf)[body])
    for index in np.unique(table.material[part]):
        k = scene.material_index(order[index])
        chosen = table.material[part] == index
        solid = materials[k].density * 4.0 / 3.0 * np.pi * table.radius[part][chosen] ** 3
        share = min(1.0, float((yields[chosen] / solid).min()))
        materials[k] = replace(materials[k], density=share * materials[k].density)
    return replace(scene, materials=tuple(materials))
