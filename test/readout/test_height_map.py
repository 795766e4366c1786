"""Height maps against a slow loop over cells in double precision, and closed forms."""

import numpy as np
import pytest
import trimesh
from clouds import cloud_of
from scenes import write_small_scene
from timing import quickest, sorting

from sand_sim import World, load_scene, rotation
from sand_sim.readout.height_map import bed_grid, footprint_grid, make_height_map


def slow_heights(cloud, low, cell, shape):
    """Cell by cell, sphere by sphere."""
    heights = np.full(shape, np.nan)
    for row in range(shape[0]):
        for column in range(shape[1]):
            middle = np.asarray(low) + cell * (np.array([column, row]) + 0.5)
            square = cloud.radius.astype(float) ** 2 - np.sum((cloud.position[:, :2] - middle) ** 2, axis=1)
            tops = cloud.position[square >= 0.0, 2] + np.sqrt(square[square >= 0.0])
            heights[row, column] = tops.max(initial=-np.inf) if len(tops) else np.nan
    return heights


@pytest.mark.parametrize("cell", [0.002, 0.011, 0.05])
def test_equals_a_slow_loop(cell, monkeypatch):
    monkeypatch.setattr("sand_sim.readout.height_map._AT_ONCE", 1000)  # in many parts
    random = np.random.default_rng(3)
    cloud = cloud_of(random.uniform([-0.1, 0.0, -0.02], [0.1, 0.15, 0.05], (400, 3)), random.uniform(0.001, 0.012, 400))
    low, shape = footprint_grid([-0.07, -0.02], [0.12, 0.12], cell)  # some grains lie beside it
    found = make_height_map(cloud, low, cell, shape).heights
    expected = slow_heights(cloud, low, cell, shape)
    assert found.dtype == np.float32
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    assert found == pytest.approx(expected, abs=1e-8, nan_ok=True)
    assert np.isnan(expected).any() or cell == 0.05


def test_one_sphere_is_a_cap():
    """z + sqrt(R^2 - x^2 - y^2) over its disc, nothing elsewhere; rows run along y."""
    cloud = cloud_of([0.03, 0.01, 0.5], 0.02)
    found = make_height_map(cloud, [0.0, 0.0], 0.001, (40, 80)).heights.astype(float)
    y, x = (np.mgrid[:40, :80] + 0.5) * 0.001
    square = float(np.float32(0.02)) ** 2 - (x - 0.03) ** 2 - (y - 0.01) ** 2
    expected = np.where(square >= 0.0, 0.5 + np.sqrt(np.maximum(square, 0.0)), np.nan)
    assert found == pytest.approx(expected, abs=1e-7, nan_ok=True)


def test_plane_of_spheres_on_their_own_grid_is_flat():
    """Spheres under the middles of the cells, and more below: all heights are z + R."""
    y, x = np.mgrid[:20, :30]
    upper = np.column_stack([x.ravel() + 0.5, y.ravel() + 0.5, np.full(x.size, 3.0)]) * 0.01
    cloud = cloud_of(np.concatenate([upper - [0.0, 0.0, 0.01], upper]), 0.005)
    assert make_height_map(cloud, [0.0, 0.0], 0.01, (20, 30)).heights == pytest.approx(0.035, abs=1e-8)


def test_large_maps_are_about_as_fast_as_sorting():
    random = np.random.default_rng(0)
    cloud = cloud_of(random.uniform(0.0, [1.0, 1.0, 0.1], (100_000, 3)), random.uniform(0.004, 0.006, 100_000))
    assert quickest(lambda: make_height_map(cloud, [0.0, 0.0], 0.01, (100, 100))) < 20.0 * sorting(100_000)


def test_grid_covers_the_bed(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    cloud = world.observe().spheres
    low, cell, shape = bed_grid(world.scene, cloud)
    assert cell == pytest.approx(0.01)
    reach = cloud.radius[:, None]
    assert np.all(low <= (cloud.position[:, :2] - reach).min(axis=0) + 1e-9)
    assert np.all(low + cell * np.array(shape)[::-1] >= (cloud.position[:, :2] + reach).max(axis=0) - 1e-9)
    heights = make_height_map(cloud, low, 0.5 * cell, (2 * shape[0], 2 * shape[1])).heights
    assert np.nanmax(heights) <= (cloud.position[:, 2] + cloud.radius).max() + 1e-7
    assert np.isfinite(heights).mean() > 0.5


def test_a_tool_knows_which_grains_are_in_it(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    model = world.tools[0]
    points = np.array([[0.0, 0.0, 0.0], [0.029, 0.0, 0.0019], [0.031, 0.0, 0.0], [0.0, 0.0, 0.0021]])
    turn = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    world_points = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]]) + [1.0, 2.0, 3.0]
    assert model.holds(world_points, np.array([1.0, 2.0, 3.0]), turn).tolist() == [True, True, False, False]


def test_a_tool_carries_what_lies_in_the_far_corner_of_its_box_too(tmp_path):
    corners, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    trimesh.Trimesh(0.02 * corners, faces).export(tmp_path / "wedge.stl")
    scene = write_small_scene(tmp_path)
    scene.write_text(scene.read_text().replace("plate.stl", "wedge.stl"))
    position = np.array([0.015, 0.015, 0.1])  # where no grain is
    model = World(load_scene(scene)).tools[0]
    inside = 0.02 * np.array([[0.97, 0.97, 0.97], [0.9, 0.95, 0.5], [0.1, 0.1, 0.1]])
    assert np.linalg.norm(inside[0]) > model.extent  # beyond every point of the tool
    for angles in ([0.0, 0.0, 0.0], [0.3, -0.5, 2.0]):
        turn = rotation.from_rpy(*angles)
        axes = trimesh.transformations.euler_matrix(*angles)[:3, :3]
        assert model.holds(position + inside @ axes.T, position, turn).all()
        assert not model.holds(position + 0.021 * axes.T, position, turn).any()
        assert not model.holds(position - 0.001 * axes.T, position, turn).any()


def test_a_grid_lies_around_the_middle_of_what_it_covers():
    low, high = np.array([-0.3, 0.1]), np.array([0.75, 0.32])
    corner, (rows, columns) = footprint_grid(low, high, 0.1)
    assert (rows, columns) == (3, 11)  # along y, along x
    assert corner + 0.05 * np.array([columns, rows]) == pytest.approx(0.5 * (low + high))
    assert np.all(corner <= low)
    assert np.all(corner + 0.1 * np.array([columns, rows]) >= high)


@pytest.mark.parametrize(("cell", "shape"), [(0.0, (2, 2)), (np.nan, (2, 2)), (0.1, (0, 2))])
def test_senseless_grids_are_refused(cell, shape):
    with pytest.raises(ValueError, match="must be positive"):
        make_height_map(cloud_of([0.0, 0.0, 0.0], 0.1), [0.0, 0.0], cell, shape)
