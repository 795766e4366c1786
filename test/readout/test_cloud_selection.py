"""Selections of grains against plain loops."""

import numpy as np
import pytest
from clouds import cloud_of
from timing import quickest, sorting

from sand_sim.readout.cloud_selection import select_box, select_every, select_voxels


@pytest.fixture
def cloud():
    random = np.random.default_rng(5)
    return cloud_of(random.uniform([-0.3, -0.2, -0.1], [0.3, 0.2, 0.1], (3000, 3)), random.uniform(0.004, 0.006, 3000))


def test_every_nth_by_identity(cloud):
    found = select_every(select_box(cloud, [-0.1] * 3, [np.inf] * 3), 7)
    assert len(found) > 50
    assert (found.identity % 7 == 0).all()
    assert found.position == pytest.approx(cloud.position[found.identity], abs=0.0)
    assert np.array_equal(select_every(cloud, 1).identity, cloud.identity)
    for step in (0, -3, np.nan):
        with pytest.raises(ValueError, match="step"):
            select_every(cloud, step)


def test_box(cloud):
    low, high = np.array([-0.1, -np.inf, 0.0]), np.array([0.2, 0.05, np.inf])
    expected = [k for k, point in enumerate(cloud.position) if all(low <= point) and all(point <= high)]
    assert select_box(cloud, low, high).identity.tolist() == expected
    assert len(select_box(cloud, [5.0] * 3, [6.0] * 3)) == 0
    for corner in ([0.1, 0.0, 0.0], [np.nan, 0.0, 0.0]):
        with pytest.raises(ValueError, match="box: every coordinate"):
            select_box(cloud, corner, [0.1, 0.1, 0.1])
    with pytest.raises(ValueError, match=r"box: corners must be of shape \(3,\), not \(2,\) and \(3,\)"):
        select_box(cloud, [0.0, 0.0], [0.1, 0.1, 0.1])


@pytest.mark.parametrize("edge", [0.003, 0.02, 0.07, 3.0])  # the first is sparse, the last one voxel or eight
def test_topmost_grain_of_each_voxel(cloud, edge):
    best = {}
    for row, point in enumerate(cloud.position):
        voxel = tuple(np.floor(point / edge))
        if voxel not in best or point[2] > cloud.position[best[voxel], 2]:
            best[voxel] = row
    found = select_voxels(cloud, edge)
    assert found.identity.tolist() == sorted(best.values())
    assert found.radius.tolist() == cloud.radius[found.identity].tolist()


def test_level_grains_are_told_apart_by_identity():
    cloud = cloud_of([[0.01, 0.0, 0.5], [0.02, 0.0, 0.5], [0.03, 0.0, 0.4]], 0.005)
    assert select_voxels(cloud, 1.0).identity.tolist() == [0]


def test_voxels_do_not_move_with_the_cloud(cloud):
    """Without the outermost grains the others stay the same: the grid hangs on the world."""
    inner = select_box(cloud, [-0.21] * 3, [0.21] * 3)
    shown, expected = select_voxels(inner, 0.03), select_voxels(cloud, 0.03)
    assert np.array_equal(shown.identity, select_box(expected, [-0.21] * 3, [0.21] * 3).identity)


def test_nothing_of_nothing_and_refusals(cloud):
    assert len(select_voxels(cloud_of(np.zeros((0, 3)), 0.1), 0.1)) == 0
    for edge in (0.0, -1.0, np.nan, np.inf, 1e-9):
        with pytest.raises(ValueError, match="edge"):
            select_voxels(cloud, edge)


@pytest.mark.parametrize("edge", [0.02, 0.01])
def test_voxels_are_about_as_fast_as_sorting(edge):
    cloud = cloud_of(np.random.default_rng(0).uniform(0.0, [1.0, 1.0, 0.5], (1_000_000, 3)), 0.004)
    assert quickest(lambda: select_voxels(cloud, edge)) < 20.0 * sorting(1_000_000)
