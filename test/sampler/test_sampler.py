"""From meshes to particle bodies."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from spread import distances, neighbours

from sampler import MeshError, SignedDistance, locate_mesh, make_field, read_mesh, sample_body
from sampler.geometry.surface import Surface
from sampler.sampling import thinnest_wall

MESHES = Path(__file__).parents[2] / "config" / "meshes"
BUCKET = MESHES / "bucket.stl"


def farthest_from_particles(mesh, points, samples=4000):
    """Largest distance of surface points from the nearest particle."""
    return distances(trimesh.sample.sample_surface(mesh, samples, seed=1)[0], points).max()


@pytest.fixture(scope="module")
def sphere():
    return trimesh.creation.icosphere(subdivisions=4, radius=0.05)


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "dae"])
def test_meshes_are_read(tmp_path, kind):
    path = tmp_path / f"box.{kind}"
    trimesh.creation.box((100.0, 60.0, 20.0)).export(path)
    mesh = read_mesh(path, scale=0.001)
    assert mesh.extents == pytest.approx([0.1, 0.06, 0.02])
    assert mesh.volume == pytest.approx(0.1 * 0.06 * 0.02)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("empty.stl", b"", "mesh empty.stl"),
        ("text.obj", b"hello\n", "mesh text.obj"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "mesh points.obj"),
        ("pointer.stl", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n", "is a Git LFS pointer"),
        ("nan.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "mesh nan.obj"),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "mesh flat.obj"),
        ("what.xyz123", b"?", "mesh what.xyz123: cannot be read: .xyz123 files are not known"),
    ],
)
def test_bad_meshes_are_refused(tmp_path, name, content, reason):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError) as caught:
        read_mesh(tmp_path / name)
    assert reason in str(caught.value)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), "1", None])
def test_bad_scale_is_refused(scale):
    with pytest.raises(MeshError, match="scale must be positive"):
        read_mesh(BUCKET, scale)


def test_meshes_are_found_by_address(tmp_path, monkeypatch):
    share = tmp_path / "share" / "my_robot" / "meshes"
    share.mkdir(parents=True)
    (share / "a tool.stl").write_bytes(BUCKET.read_bytes())
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(["/nowhere", str(tmp_path)]))
    expected = share / "a tool.stl"
    assert locate_mesh("package://my_robot/meshes/a%20tool.stl") == expected
    assert locate_mesh(f"file://{expected}".replace(" ", "%20")) == expected
    assert locate_mesh(str(expected)) == expected
    assert locate_mesh("meshes/a tool.stl", share.parent) == expected


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("package://no_such_package/mesh.stl", "no ROS package 'no_such_package'"),
        ("https://example.org/mesh.stl", "unknown scheme 'https://'"),
        ("missing.stl", "there is no file"),
        ("file:///missing.stl", "there is no file"),
        ("file://meshes/missing.stl", "lies on another machine; an address of a file begins with file:///"),
        ("//[bracket.stl", "is no address"),
        ("x" * 5000, "File name too long"),
    ],
)
def test_addresses_that_lead_nowhere_are_refused(address, reason):
    with pytest.raises(MeshError) as caught:
        locate_mesh(address)
    assert reason in str(caught.value)


def test_distance_is_exact_and_negative_inside():
    box = trimesh.creation.box((0.2, 0.1, 0.06))
    random = np.random.default_rng(0)
    points = random.uniform(-0.15, 0.15, (2000, 3))
    half = np.array([0.1, 0.05, 0.03])
    out = np.abs(points) - half
    exact = np.linalg.norm(np.maximum(out, 0.0), axis=1) + np.minimum(out.max(axis=1), 0.0)
    distance, closest, normal = SignedDistance(box).query(points)
    assert np.abs(distance - exact).max() < 1e-7
    assert np.abs(np.linalg.norm(points - closest, axis=1) - np.abs(exact)).max() < 1e-7
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-5)


def test_particles_are_even_and_on_the_surface(sphere):
    body = sample_body(sphere, radius=0.004)
    spacing = neighbours(body.points) / body.spacing
    assert np.abs(np.linalg.norm(body.points, axis=1) - 0.05).max() < 2e-4  # the mesh is a polyhedron
    assert spacing.std() / spacing.mean() < 0.06
    assert spacing.min() > 0.75
    assert spacing.max() < 1.15
    assert farthest_from_particles(sphere, body.points) < 0.85 * body.spacing


def test_bucket_is_covered_so_that_no_grain_passes():
    mesh = read_mesh(BUCKET)
    body = sample_body(mesh, radius=0.004)
    # A grain of radius r passes a gap in which no particle is nearer than its own radius plus r.
    assert farthest_from_particles(mesh, body.points) < body.radius + 0.003


def test_mass_properties_of_a_box():
    box = trimesh.creation.box((0.2, 0.1, 0.06))
    box.apply_translation([0.1, 0.2, 0.3])
    body = sample_body(box, radius=0.01)
    volume = 0.2 * 0.1 * 0.06
    assert body.volume == pytest.approx(volume, rel=1e-12)
    assert body.centre == pytest.approx([0.1, 0.2, 0.3])
    expected = volume / 12.0 * np.diag([0.1**2 + 0.06**2, 0.2**2 + 0.06**2, 0.2**2 + 0.1**2])
    assert body.inertia == pytest.approx(expected, rel=1e-9, abs=1e-15)
    for given, density in (({"density": 2700.0}, 2700.0), ({"mass": 0.6}, 0.6 / volume)):
        properties = body.mass_properties(**given)
        assert properties.mass == pytest.approx(density * volume)
        assert properties.inertia == pytest.approx(density * expected, rel=1e-9, abs=1e-12)
        assert properties.principal == pytest.approx(np.sort(np.diag(density * expected)))


def test_an_open_shell_is_a_sheet_and_weighs_what_its_thickness_says(sphere):
    half = sphere.copy()
    half.update_faces(half.triangles_center[:, 2] > 0.0)
    body = sample_body(half, radius=0.002, thickness=0.001)
    assert any("sheets" in warning for warning in body.warnings)
    assert body.volume == pytest.approx(half.area * 0.001, rel=0.01)
    assert np.abs(np.linalg.norm(body.points, axis=1) - 0.05).max() < 1e-4  # one layer, in the sheet


def test_same_seed_same_body(sphere):
    first, second, third = (sample_body(sphere, radius=0.008, seed=seed).points for seed in (0, 0, 1))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"radius": "wide"}, "radius must be positive, got 'wide'"),
        ({"radius": None}, "radius must be positive, got None"),
        ({"spacing": float("nan")}, "spacing must be positive"),
        ({"count": 10.5}, "count must be a whole number from 1 on, got 10.5"),
        ({"count": True}, "count must be a whole number"),
        ({"seed": -1}, "seed must be a whole number from 0 on"),
        ({"device": "abacus"}, "device 'abacus' is not here; present are cpu"),
    ],
)
def test_options_that_make_no_sense_are_refused(sphere, options, reason):
    with pytest.raises(MeshError, match=reason):
        sample_body(sphere, **{"radius": 0.1} | options)


@pytest.mark.parametrize("density", ["7", True, 0.0, float("inf")])
def test_densities_that_make_no_sense_are_refused(sphere, density):
    with pytest.raises(MeshError, match="positive"):
        sample_body(sphere, radius=0.02).mass_properties(density=density)


@pytest.mark.parametrize(
    ("radius", "reason"), [(0.0, "must be positive"), (-1.0, "must be positive"), (1e-6, "check the mesh's scale")]
)
def test_radii_that_make_no_sense_are_refused(sphere, radius, reason):
    with pytest.raises(MeshError, match=reason):
        sample_body(sphere, radius=radius)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"band": 0.0}, "band of a field must be positive, got 0.0"),
        ({"cell": float("nan")}, "cell of a field must be positive, got nan"),
        ({"memory": 2000}, "memory of a field must be at least 2920 bytes, one block, got 2000"),
    ],
)
def test_fields_that_make_no_sense_are_refused(sphere, options, reason):
    with pytest.raises(MeshError, match=reason):
        make_field(SignedDistance(sphere), **{"band": 0.01} | options)


def test_the_smallest_field_is_one_block(sphere):
    assert make_field(SignedDistance(sphere), 0.01, memory=2920).memory == 2920


@pytest.mark.parametrize("radius", [1e-300, 1e-7, 1e4, 1e300])
def test_scales_that_make_no_sense_are_told_before_numbers_overflow(radius):
    with pytest.raises(MeshError, match="check the mesh's scale"):
        sample_body(trimesh.creation.box((1.0, 1.0, 1.0)), radius=radius)


def test_a_stray_vertex_leaves_particles_on_the_surface():
    ball = trimesh.creation.icosphere(3)
    ball.vertices[5] = 1e3
    body = sample_body(ball, 0.1, count=500)
    away = np.linalg.norm(Surface(np.asarray(ball.triangles)).closest(body.points)[0] - body.points, axis=1)
    assert away.max() < 1e-3 * body.radius


@pytest.mark.parametrize(
    ("far", "radius", "reason"), [(1e6, 0.1, "stray vertices"), (1e160, 0.1, "farther than"), (1e6, 1e3, "no normals")]
)
def test_what_is_far_too_large_for_its_particles_is_refused(far, radius, reason):
    ball = trimesh.creation.icosphere(3)
    ball.vertices[5] = far
    with pytest.raises(MeshError, match=reason):
        sample_body(ball, radius)


def test_parts_far_apart_are_refused():
    ball, other = trimesh.creation.icosphere(3), trimesh.creation.icosphere(3)
    other.apply_translation((1e5, 0.0, 0.0))
    with pytest.raises(MeshError, match="far too fine for a mesh"):
        sample_body(trimesh.util.concatenate([ball, other]), 0.1)


def test_sheets_thicker_than_the_mesh_are_refused():
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    with pytest.raises(MeshError, match=r"sheets 1e\+03 m thick cannot be meant"):
        sample_body(box, 0.1, thickness=1000.0)


@pytest.mark.parametrize("mesh", [None, "box.stl", trimesh.Scene()])
def test_what_is_no_mesh_is_refused(mesh):
    with pytest.raises(MeshError, match=r"must be a trimesh\.Trimesh, got"):
        sample_body(mesh, 0.1)


def test_millimetres_taken_for_metres_are_told():
    mesh = trimesh.creation.box((1200.0, 700.0, 500.0))
    with pytest.raises(MeshError, match="check the mesh's scale"):
        sample_body(mesh, radius=1e-4)
    with pytest.raises(MeshError, match="check the mesh's scale"):
        sample_body(mesh, radius=0.1, count=10**15)


def test_a_spacing_that_would_let_grains_pass_is_made_finer_and_told():
    ball = trimesh.creation.icosphere(3, 0.05)
    told = [sample_body(ball, 0.005, spacing=0.012, grain=grain).warnings for grain in (None, 0.02, 0.001)]
    assert told[:2] == [(), ()]
    assert told[2] == ("particles lie 0.0069 m apart, not 0.012 m, or grains of radius 0.001 m could pass",)


def test_the_thinnest_wall_may_be_that_of_a_small_fin():
    """Of 15,000th of the area, which some thousand random places are likely to miss."""
    block, fin = trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.creation.box((0.02, 5e-4, 0.02))
    fin.apply_translation((0.0, 0.0, 0.5))
    both = SignedDistance(trimesh.util.concatenate([block, fin]))
    assert thinnest_wall(both.surface) == pytest.approx(5e-4)
    assert not make_field(both, 0.01, memory=1 << 20).resolves_walls
