"""What grains touch of a mesh: how far it reaches, and which way its triangles look."""

import numpy as np
import pytest
import trimesh

from sampler import sample_body
from sand_sim.assembly.true_surface import outward_triangles, reach_of_touched

BOX = np.asarray(trimesh.creation.box(bounds=[[-0.01, -0.02, -0.03], [0.05, 0.02, 0.04]]).subdivide().triangles)


def rolled(triangles):
    """Triangles that begin with their lowest corner, as a set, so that only the way round counts."""
    return {tuple(map(tuple, np.roll(one, -min(range(3), key=lambda k: tuple(one[k])), axis=0))) for one in triangles.tolist()}


def test_the_farthest_point_is_a_corner_or_lies_a_particle_radius_beyond_the_farthest_particle():
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(BOX))
    body = sample_body(mesh, 0.004)
    assert reach_of_touched(body, BOX).extent == pytest.approx(np.sqrt(0.05**2 + 0.02**2 + 0.04**2), rel=1e-12)
    reach = [np.linalg.norm(point + 0.004 * point / np.linalg.norm(point)) for point in body.points]
    assert reach_of_touched(body, None).extent == pytest.approx(max(reach), rel=1e-9)


@pytest.mark.parametrize("apart", [0.1, 0.03])
def test_solids_that_are_inside_out_are_turned(apart):
    """Whether they lie by themselves or reach into another one, inside of which nothing of them is touched."""
    other = BOX + [apart, 0.003, 0.002]
    found, expected = outward_triangles(np.concatenate([BOX, other[:, ::-1]])), np.concatenate([BOX, other])
    centres = expected.mean(axis=1)
    buried = np.all((centres > BOX.min(axis=(0, 1))) & (centres < BOX.max(axis=(0, 1))), axis=1)
    buried |= np.all((centres > other.min(axis=(0, 1))) & (centres < other.max(axis=(0, 1))), axis=1)
    assert buried.any() == (apart < 0.06)
    assert rolled(expected[~buried]) <= rolled(found)
    assert not rolled(expected[~buried][:, ::-1]) & rolled(found)


def test_triangles_with_the_solid_on_no_side_look_both_ways():
    stray = np.array([[[0.2, 0.0, 0.0], [0.21, 0.0, 0.0], [0.2, 0.01, 0.0]]])
    found = outward_triangles(np.concatenate([BOX, stray]))
    assert len(found) == 50
    assert rolled(found) == rolled(np.concatenate([BOX, stray, stray[:, ::-1]]))
