"""Gaps between particles and what a particle is needed for, against NumPy."""

import numpy as np
import pytest
import trimesh

from sampler.skin import Skin
from sampler.spreading import _State


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_left_open_without_a_particle(seed):
    random = np.random.default_rng(seed)
    plane = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    points, places = (np.column_stack([random.random((n, 2)), np.zeros(n)]) for n in (150, 4000))
    up = np.tile([0.0, 0.0, 1.0], (len(places), 1))
    state = _State(Skin(np.asarray(plane.triangles)), len(points), None)
    state.place(points, up[: len(points)], np.zeros(len(points), bool))
    found, along = state.distances(places, up)
    far = np.linalg.norm(places[:, None] - points, axis=2) / state.spacing
    nearest, (first, second) = far.argmin(axis=1), np.sort(far, axis=1)[:, :2].T
    assert found == pytest.approx(np.minimum(first, 2.0), abs=1e-5)
    assert along == pytest.approx(found, abs=1e-5)
    without = np.zeros(len(points))
    np.maximum.at(without, nearest, second)
    near = without < 1.0  # farther ones are told to be at least that far
    for measured in state.without:
        told = measured.numpy() / state.unit_spacing
        assert told[near] == pytest.approx(without[near], abs=1e-5)
        assert np.all(told[~near] > 1.0 - 1e-5)
