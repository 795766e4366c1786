"""The nearest point of a smooth tool's surface, against exact distances to all triangles, and the rule for further contacts."""

import numpy as np
import pytest
import trimesh
import warp as wp
from shapes import robot_mesh, wavy_ball

from sampler import read_mesh, sample_file
from sampler.geometry.closest import closest_on_triangles
from sampler.geometry.surface import Surface
from sand_sim.assembly.true_surface import outward_triangles
from sand_sim.engine.kernel import kernel
from sand_sim.engine.smooth_tools import SmoothTools
from sand_sim.engine.triangle_tree import TriangleTree, nearest_on_tree


@kernel
def find(
    tree: wp.array(dtype=TriangleTree),
    boxes: wp.array(dtype=wp.vec3d),
    corners: wp.array(dtype=wp.vec3d),
    points: wp.array(dtype=wp.vec3d),
    limit: wp.float64,
    distances: wp.array(dtype=wp.vec3d),
    normals: wp.array(dtype=wp.mat33d),
):
    """Up to three contacts of each point, as ``touch_smooth`` finds them."""
    i = wp.tid()
    found = wp.mat33d()
    far = wp.vec3d(limit, limit, limit)
    for k in range(3):
        distance, normal, _triangle = nearest_on_tree(tree[0], boxes, corners, points[i], limit, found, far, k)
        if distance < limit:
            found[k] = normal
            far[k] = distance
        else:
            break
    distances[i] = far
    normals[i] = found


def contacts(triangles, points, limit):
    """Distances [m] and normals of up to three contacts of each point, shape (n, 3) and (n, 3, 3)."""
    surface = SmoothTools([triangles], [0], "cpu")
    points = wp.array(points, dtype=wp.vec3d, device="cpu")
    distances = wp.zeros(len(points), dtype=wp.vec3d, device="cpu")
    normals = wp.zeros(len(points), dtype=wp.mat33d, device="cpu")
    inputs = [surface.trees, surface.boxes, surface.corners, points, limit, distances, normals]
    wp.launch(find, dim=len(points), inputs=inputs, device="cpu")
    return distances.numpy(), normals.numpy()


def brute_force(triangles, points):
    """Distance of each point from the nearest of all triangles [m]."""
    least = np.full(len(points), np.inf)
    for triangle in triangles:
        closest = closest_on_triangles(points, np.broadcast_to(triangle, (len(points), 3, 3)))
        least = np.minimum(least, np.linalg.norm(points - closest, axis=1))
    return least


@pytest.mark.parametrize("name", ["one triangle", "box", "wavy ball", "ow_lander_scoop.stl"])
def test_nearest_of_all_triangles(name):
    if name == "one triangle":
        triangles = np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.001, 0.0]]])
    elif name == "box":
        triangles = np.asarray(trimesh.creation.box((0.06, 0.06, 0.004)).triangles)
    else:
        mesh = wavy_ball(3) if name == "wavy ball" else read_mesh(robot_mesh(name), 1.0)
        triangles = np.asarray(mesh.triangles)
    random = np.random.default_rng(0)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    size = np.linalg.norm(high - low)
    points = random.uniform(low - 0.1 * size, high + 0.1 * size, (400, 3))
    found, normals = contacts(triangles, points, size)
    expected = brute_force(triangles, points)
    assert np.abs(np.abs(found[:, 0]) - expected).max() < 1e-12 * size
    # The place found lies on the surface.
    assert brute_force(triangles, points - found[:, :1] * normals[:, 0]).max() < 1e-12 * size


def test_sign_inside_a_box_and_beside_a_thin_plate():
    triangles = np.asarray(trimesh.creation.box((0.06, 0.06, 0.004)).triangles)
    points = np.array([[0.01, 0.0, 0.0015], [0.01, 0.0, 0.003], [0.032, 0.032, 0.0], [0.01, 0.0, -0.0015]])
    distances, normals = contacts(triangles, points, 0.006)
    assert distances[:, 0] == pytest.approx([-0.0005, 0.001, np.sqrt(2.0) * 0.002, -0.0005], abs=1e-15)
    assert normals[0, 0] == pytest.approx([0.0, 0.0, 1.0])
    assert normals[3, 0] == pytest.approx([0.0, 0.0, -1.0])


@pytest.mark.parametrize("name", ["ow_lander_scoop.stl", "excavator_bucket_mm.stl", "robotiq140_base.stl", "rassor_drum.obj"])
def test_no_grain_outside_a_robot_mesh_is_taken_for_one_inside(name):
    """By the winding number; the drum is a wreck of 1387 faces of double walls and 30 holes."""
    mesh = robot_mesh(name)
    scale = 0.001 if "_mm" in name else 1.0
    size = np.linalg.norm(read_mesh(mesh, scale).extents)
    triangles = outward_triangles(sample_file(mesh, 0.01 * size, scale).triangles)
    skin, random = Surface(triangles), np.random.default_rng(0)
    face = random.choice(len(triangles), 20_000, p=skin.areas / skin.areas.sum())
    points = np.einsum("ij,ijk->ik", random.dirichlet([1.0, 1.0, 1.0], len(face)), triangles[face])
    points += random.normal(0.0, 0.01 * size, points.shape)
    distances, _ = contacts(triangles, points, 0.015 * size)
    outside = np.abs(skin.winding(points)) < 0.5
    assert outside.sum() > 5000
    wrong = outside & (distances[:, 0] < -1e-6 * size)
    assert wrong.sum() <= (2e-4 * outside.sum() if name.startswith("rassor") else 0)


def test_convex_surfaces_give_one_contact_and_corners_as_many_as_they_have_walls():
    """However the faces are cut into triangles, and on whichever side of a bend the grain lies."""
    radius, depth = 0.006, 0.0006
    box = trimesh.creation.box((0.1, 0.1, 0.02)).subdivide().subdivide().subdivide()
    random = np.random.default_rng(1)
    points = random.uniform([-0.06, -0.06, -0.02], [0.06, 0.06, 0.02], (4000, 3))
    distances, _ = contacts(np.asarray(box.triangles), points, radius)
    touching = (distances[:, 0] > radius - depth) & (distances[:, 0] < radius)
    assert touching.sum() > 50
    assert np.all(distances[touching, 1] == radius)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    points = random.normal(size=(2000, 3))
    points *= random.uniform(0.036 - depth, 0.036, (2000, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    distances, _ = contacts(np.asarray(ball.triangles), points, radius)
    assert np.all(distances[:, 1] == radius)
    hollow = np.asarray(box.triangles)[:, ::-1]  # the same box seen from inside
    inside = np.array([[0.05, 0.05, 0.01]]) - (radius - depth * np.array([[1.0, 0.5, 0.2], [1.0, 0.5, -9.0], [1.0, -9.0, -9.0]]))
    distances, normals = contacts(hollow, inside, radius)
    assert distances == pytest.approx(np.minimum(radius - depth * np.array([[1, 0.5, 0.2], [1, 0.5, -9], [1, -9, -9]]), radius))
    assert normals[0] == pytest.approx(-np.eye(3))


def test_a_rounded_hollow_is_one_contact():
    """A ball in a pipe of 32 facets, half as wide as the pipe: one contact, wherever the ball touches."""
    turns = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    ring = 0.012 * np.column_stack([np.cos(turns), np.sin(turns)])
    low, high = np.column_stack([ring, np.full(32, -0.05)]), np.column_stack([ring, np.full(32, 0.05)])
    n = np.roll(np.arange(32), -1)
    pipe = np.concatenate([np.stack([low, high, high[n]], 1), np.stack([low, high[n], low[n]], 1)])
    angle = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, 200)
    points = 0.0063 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(200)])
    distances, normals = contacts(pipe, points, 0.006)
    assert distances[:, 0].max() < 0.0058
    assert np.all(distances[:, 1] == 0.006)
    assert np.einsum("ij,ij->i", normals[:, 0], points / 0.0063).max() < -np.cos(np.pi / 16.0)
