"""Pseudonormals against what symmetry says of a cube, however its faces are cut."""

import numpy as np
import pytest
import trimesh

from sampler.geometry.pseudonormals import Pseudonormals


@pytest.mark.parametrize("place", [(1, 1, 1), (1, 1, -1), (-1, 1, 1), (1, -1, 0), (0, 1, 1), (0, -1, 0)])
def test_those_of_a_cube_point_away_from_its_middle(place):
    """Angles weigh the faces, so it does not count how many triangles of a face meet in a corner."""
    triangles = np.asarray(trimesh.creation.box((2.0, 2.0, 2.0)).triangles)
    place = np.array(place, float)
    pseudonormals = Pseudonormals(triangles)
    for face, corners in enumerate(triangles):
        if trimesh.triangles.closest_point(corners[None], place[None])[0] == pytest.approx(place, abs=1e-12):
            normal = pseudonormals.at(place[None], np.array([face]))[0]
            assert normal == pytest.approx(place / np.linalg.norm(place), abs=1e-12)
