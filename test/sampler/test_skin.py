"""What of a surface can be touched, against closed forms."""

import numpy as np
import pytest
import trimesh
from shapes import solid_angle_inside

from sampler.skin import free_triangles
from sampler.surface import Surface


def box(extents, centre):
    return trimesh.creation.box(extents, trimesh.transformations.translation_matrix(centre))


def free_parts(*meshes, spacing=0.05):
    triangles = np.concatenate([mesh.triangles for mesh in meshes])
    return free_triangles(triangles, Surface(triangles), spacing)


def test_two_crossing_bars_hide_what_lies_in_the_other():
    free, _ = free_parts(box((2.0, 0.4, 0.4), (0, 0, 0)), box((0.3, 2.0, 0.3), (0, 0, 0)))
    own = 4 * 2.0 * 0.4 + 2 * 0.4**2 - 2 * 0.3 * 0.3
    other = 4 * (2.0 - 0.4) * 0.3 + 2 * 0.3**2
    assert Surface.areas_of(free).sum() == pytest.approx(own + other, rel=2e-3)


def test_only_what_another_part_comes_through_is_cut():
    far = box((1.0, 1.0, 1.0), (5.0, 0, 0))
    post = box((0.1, 0.1, 1.0), (0.07, 0.13, 0.5))  # stands in the middle of two large faces of the plate
    free, parent = free_parts(box((2.0, 2.0, 0.2), (0, 0, 0)), post, far)
    assert np.count_nonzero(parent >= 24) == 12
    plate = Surface.areas_of(free[parent < 12]).sum()
    assert plate == pytest.approx(2 * 4.0 + 4 * 2.0 * 0.2 - 0.1 * 0.1, rel=2e-4)


def test_winding_numbers_of_closed_parts_are_whole_beside_open_ones():
    balls = [trimesh.creation.icosphere(3).apply_translation([x, 0.1, 0.2]) for x in (0.0, 0.8)]
    points = np.random.default_rng(0).uniform(-1.5, 2.5, (3000, 3))
    closed = Surface(np.concatenate([ball.triangles for ball in balls]))
    points = points[np.linalg.norm(points - closed.closest(points)[0], axis=1) > 1e-4]
    exact = np.sum([solid_angle_inside(np.asarray(ball.triangles), points) for ball in balls], axis=0)
    assert np.array_equal(closed.winding(points), exact)
    scrap = np.array([[[9.0, 9.0, 9.0], [9.1, 9.0, 9.0], [9.0, 9.1, 9.0]]])  # an open part far away
    both = Surface(np.concatenate([closed.triangles, scrap]))
    assert both.winding(points) == pytest.approx(exact, abs=1e-4)
