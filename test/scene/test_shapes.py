"""Mass properties of unions of spheres against closed forms."""

import numpy as np
import pytest
from scenes import SceneMaker

from sand_sim import SceneError, World, read_scene
from sand_sim.scene.shapes import read_shape, shape_of_spheres, tetrahedron, union_properties


def test_single_sphere():
    volume, middle, inertia = union_properties(np.array([[0.1, -0.2, 0.3]]), np.array([0.5]))
    assert volume == pytest.approx(4.0 / 3.0 * np.pi * 0.125, rel=1e-5)
    assert middle == pytest.approx([0.1, -0.2, 0.3], abs=1e-6)
    assert inertia == pytest.approx(0.4 * volume * 0.25 * np.eye(3), abs=1e-5 * volume)


def test_overlapping_spheres_count_once():
    """The lens of two unit spheres at distance d has the volume ``pi (4 + d) (2 - d)^2 / 12``."""
    d = 1.1
    centres = np.array([[0.0, 0.0, 0.0], [d / np.sqrt(3.0)] * 3])
    volume, middle, _ = union_properties(centres, np.ones(2))
    assert volume == pytest.approx(8.0 / 3.0 * np.pi - np.pi * (4.0 + d) * (2.0 - d) ** 2 / 12.0, rel=1e-5)
    assert middle == pytest.approx(centres.mean(axis=0), abs=1e-5)


def test_spheres_apart_obey_the_parallel_axis_theorem():
    shape = shape_of_spheres([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]], [1.0, 1.0])
    own = 0.4
    assert shape.gyration == pytest.approx([own, own + 6.25, own + 6.25], rel=1e-4)


def test_sphere_inside_another_adds_nothing():
    alone, both = shape_of_spheres([[0, 0, 0]], [1.0]), shape_of_spheres([[0, 0, 0], [0.3, 0.1, 0.0]], [1.0, 0.2])
    assert both.volume == pytest.approx(alone.volume, rel=1e-12)
    assert both.gyration == pytest.approx(alone.gyration, rel=1e-12)


def test_tetrahedron_is_isotropic_and_regular():
    shape = tetrahedron()
    assert np.ptp(shape.gyration) == 0.0
    apart = np.linalg.norm(shape.centres[:, None] - shape.centres[None], axis=2)
    assert apart[np.triu_indices(4, 1)] == pytest.approx(1.2, rel=1e-6)
    assert np.abs(shape.centres.sum(axis=0)).max() < 1e-6


def clumps_of_a_file(folder, rows, orientation):
    (folder / "clump.csv").write_text("x,y,z,radius\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    np.savez(folder / "grains.npz", position=[[0.0, 0.0, 0.0]], radius=[0.01], **orientation)
    scene = SceneMaker(folder).scene([[0.0, 0.0, 0.0]], 0.01)
    scene["fills"] = [{"material": "grain", "file": "grains.npz", "shape": "clump.csv"}]
    return World(read_scene(scene, folder))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_clumps_lie_as_their_file_has_them(tmp_path, axis):
    """And as their orientation turns them; what is observed can be given back as a file."""
    rows = np.zeros((2, 4))
    rows[:, axis], rows[:, 3] = (-1.0, 1.0), 1.0
    world = clumps_of_a_file(tmp_path, rows, {})
    spheres, grains = world.observe().spheres.position, world.observe().grains
    assert np.ptp(spheres, axis=0) == pytest.approx(np.ptp(rows[:, :3], axis=0) * 0.01 / 2.0 ** (1 / 3), abs=1e-6)
    half = np.sqrt(0.5)
    assert np.abs(grains.orientation) == pytest.approx(np.array([[0.0, 0.0, 0.0, 1.0]]), abs=1e-6)
    turned = clumps_of_a_file(tmp_path, rows, {"orientation": [[0.0, 0.0, half, half]]}).observe()
    assert np.ptp(turned.spheres.position, axis=0)[[1, 0, 2]] == pytest.approx(np.ptp(spheres, axis=0), abs=1e-6)
    again = clumps_of_a_file(tmp_path, rows, {"orientation": turned.grains.orientation}).observe()
    assert again.spheres.position == pytest.approx(turned.spheres.position, abs=1e-7)


def test_a_clump_file_that_has_changed_is_read_again(tmp_path):
    rows = [[-1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]]
    assert len(clumps_of_a_file(tmp_path, rows, {}).observe().spheres.position) == 2
    assert len(clumps_of_a_file(tmp_path, [*rows, [0.0, 1.0, 0.0, 1.0]], {}).observe().spheres.position) == 3


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (None, "cannot be read"),
        ("x,y,z\n0,0,0\n", "x, y, z, radius"),
        ("x,y,z,radius\n", "no spheres"),
        ("x,y,z,radius\n0,0,0,-1\n", "not positive"),
        ("x,y,z,radius\n0,nan,0,1\n", "not finite"),
        ("x,y,z,radius\n0,zero,0,1\n", "numbers"),
        (f"x,y,z,radius\n0,{'0' * 200_000},0,1\n", "numbers"),
    ],
)
def test_bad_clump_files_are_refused(tmp_path, text, named):
    path = tmp_path / "clump.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(SceneError, match=named):
        read_shape(path)
