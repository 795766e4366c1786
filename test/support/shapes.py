"""Meshes with known properties, and ways to damage them."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

MESHES = Path(os.environ.get("SAND_SIM_MESHES", Path(__file__).parents[3] / "shared" / "meshes"))
SOLIDS = ("franka_hand_col.stl", "robotiq140_base.stl")
THIN = ("ow_lander_scoop.stl", "excavator_bucket_mm.stl", "tray_bottom_mm.stl")


def robot_mesh(name):
    """Path of a public robot mesh; skips the test where there are none."""
    if not (MESHES / name).is_file():
        pytest.skip(f"no {MESHES / name}")
    return MESHES / name


def wavy_ball(level=4):
    """A smooth closed surface without symmetry."""
    ball = trimesh.creation.icosphere(subdivisions=level, radius=0.05)
    x, y, _ = ball.vertices.T / 0.05
    ball.vertices *= (1.0 + 0.25 * np.sin(2.5 * x) * np.cos(3.0 * y + 1.0))[:, None]
    return ball


def wedge(angle=0.1, length=0.1):
    """A prism with one acute edge [rad]."""
    half = length * np.tan(0.5 * angle)
    corners = [[0, 0, 0], [length, 0, half], [length, 0, -half], [0, length, 0], [length, length, half], [length, length, -half]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]])


def damaged(mesh, how, seed=0):
    """A copy with flipped, doubled or missing faces, cracks or a hole; vertices are not merged."""
    random = np.random.default_rng(seed)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces).copy()
    if how == "flipped":
        turned = random.random(len(faces)) < 0.1
        faces[turned] = faces[turned][:, ::-1]
    elif how == "doubled":
        faces = np.concatenate([faces, faces])
    elif how == "doubled with backs":
        faces = np.concatenate([faces, faces[:, ::-1]])
    elif how == "missing":
        faces = faces[random.random(len(faces)) >= 0.01]
    elif how == "cracked":
        size = np.linalg.norm(mesh.extents)
        vertices = vertices[faces].reshape(-1, 3) + random.uniform(-5e-6, 5e-6, (3 * len(faces), 3)) * size
        faces = np.arange(len(vertices)).reshape(-1, 3)
    elif how == "hole":
        middle = mesh.triangles_center
        order = np.argsort(np.linalg.norm(middle - middle[random.integers(len(middle))], axis=1))
        faces = faces[order[np.cumsum(mesh.area_faces[order]) > 0.05 * mesh.area]]
    return trimesh.Trimesh(vertices, faces, process=False)


def solid_angle_inside(triangles, points):
    """Whether points are inside, by the exact solid angles of all triangles (Van Oosterom & Strackee 1983), in NumPy."""
    total = np.zeros(len(points))
    for block in np.array_split(np.arange(len(points)), max(1, len(points) * len(triangles) // 2_000_000)):
        a, b, c = (triangles[None, :, k] - points[block, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
        top = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
        bottom = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
        total[block] = 2.0 * np.arctan2(top, bottom).sum(axis=1)
    return total > 2.0 * np.pi


def far_from_surface(distance, points, share=1e-5):
    """Points farther from a surface than a share of its diagonal, within which a sign means nothing."""
    return np.abs(distance.query(points)[0]) > share * distance.surface.unit


def grid_around(mesh, nodes):
    """Nodes of a grid a little larger than the bounding box."""
    low, high = mesh.bounds
    margin = 0.05 * np.linalg.norm(high - low)
    axes = [np.linspace(a - margin, b + margin, nodes) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
