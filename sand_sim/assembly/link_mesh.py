"""A link of a robot description as one mesh, and the tools of a scene that are such links."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from sampler import MeshError, locate_mesh, read_mesh
from sand_sim import rotation
from sand_sim.assembly.mesh_roots import allowed_mesh, mesh_roots
from sand_sim.assembly.urdf import Geometry, Robot, load_robot, parse_robot
from sand_sim.scene.types import Scene, SceneError, Tool

_SECTIONS = 64  # of a cylinder, whose faces then lie up to 0.12 % of its radius inside the true one
_HALVINGS = 4  # of an icosahedron's edges, for a sphere: 0.11 % of its radius
_MOST_TRIANGLES = 2_000_000


def make_link_mesh(robot: Robot, link: str, find: Callable[[str], Path]) -> trimesh.Trimesh:
    """All collision geometries of a link, or all visual ones if there are none, in the link's frame [m].

    Parts that overlap are only put together; the sampler finds what of them is outside.

    Args:
        robot: that has the link.
        link: its name.
        find: gives the file of a mesh for its address.

    Raises:
        SceneError: if the link has no geometry, or a part of it cannot be used; the message names link and part.
    """
    parts, triangles = [], 0
    for geometry in robot.geometries(link):
        try:
            part = _part(geometry, find)
        except (MeshError, SceneError) as error:
            raise SceneError(f"{geometry.where}: {error}") from None
        triangles += len(part.faces)
        if triangles > _MOST_TRIANGLES:
            raise SceneError(f"{geometry.where}: makes more than {_MOST_TRIANGLES} triangles; simplify the link's meshes")
        part.vertices = geometry.position + rotation.rotate(geometry.orientation, np.asarray(part.vertices, float))
        parts.append(part)
    return parts[0] if len(parts) == 1 else trimesh.util.concatenate(parts)


def model_link(tool: Tool, scene: Scene) -> trimesh.Trimesh:
    """The mesh of a tool that is a link, of its own URDF file or of the robot description that the scene was given.

    Raises:
        SceneError: if there is no such description, link or geometry; the message names the field.
    """
    where = f"tools.{tool.name}"
    if not (tool.urdf or scene.robot_description):
        raise SceneError(
            f"{where}.link: no robot description is known; name its file in {where}.urdf, or give the node the parameter "
            "robot_description or robot_description_topic"
        )
    field = "urdf"
    try:
        path = locate_mesh(tool.urdf, scene.folder, "URDF") if tool.urdf else None
        robot = load_robot(path) if path else parse_robot(scene.robot_description)
        field = "link"
        roots, packages = mesh_roots(scene.mesh_roots, *([path.parent] if path else []), scene.folder)
        return make_link_mesh(robot, tool.link, lambda uri: allowed_mesh(uri, roots, packages))
    except (MeshError, SceneError) as error:
        raise SceneError(f"{where}.{field}: {error}") from None


def _part(geometry: Geometry, find: Callable[[str], Path]) -> trimesh.Trimesh:
    """One geometry around its own origin."""
    if geometry.kind == "box":
        return trimesh.creation.box(geometry.numbers)
    if geometry.kind == "cylinder":
        radius, length = geometry.numbers
        return trimesh.creation.cylinder(radius, length, sections=_SECTIONS)
    if geometry.kind == "sphere":
        return trimesh.creation.icosphere(_HALVINGS, geometry.numbers[0])
    mesh = read_mesh(find(geometry.uri))
    faces = mesh.faces if np.prod(geometry.numbers) > 0.0 else mesh.faces[:, ::-1]  # a mirrored mesh is inside out
    return trimesh.Trimesh(np.asarray(mesh.vertices, float) * geometry.numbers, faces, process=False)
