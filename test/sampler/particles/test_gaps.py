"""Gaps between particles, and what a particle is needed for, against NumPy; also after some of them have moved."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from sampler.particles.gaps import Gaps
from sampler.particles.lattice import lattice_spacing
from sampler.particles.skin import Skin


def plane_gaps(number):
    plane = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    return Gaps(Skin(np.asarray(plane.triangles)), lattice_spacing(1.0, number))


def scatter(random, number):
    return np.column_stack([random.random((number, 2)), np.zeros(number)]), np.tile([0.0, 0.0, 1.0], (number, 1))


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_left_open_without_a_particle(seed):
    random = np.random.default_rng(seed)
    gaps, (points, up), (places, flat) = plane_gaps(150), scatter(random, 150), scatter(random, 4000)
    gaps.look(points, up)
    gaps.add(places, flat, fixed=True)
    far = np.linalg.norm(places[:, None] - points, axis=2) / gaps.spacing
    nearest, (first, second) = far.argmin(axis=1), np.sort(far, axis=1)[:, :2].T
    without = np.zeros(len(points))
    np.maximum.at(without, nearest, second)
    near = without < 1.0  # farther ones are told to be at least that far
    for found in (gaps.places.closest, gaps.places.own):
        assert found["way"] == pytest.approx(np.minimum(first, 2.0), abs=1e-5)
        assert np.array_equal(found["which"][first < 2.0], nearest[first < 2.0])
        told = np.zeros(len(points))
        np.maximum.at(told, found["which"][first < 2.0], found["next"][first < 2.0])
        assert told[near] == pytest.approx(without[near], abs=1e-5)
        assert np.all(told[~near] > 1.0 - 1e-5)


def test_what_moves_is_measured_anew():
    random = np.random.default_rng(2)
    gaps, (points, up) = plane_gaps(400), scatter(random, 380)
    gaps.look(points, up)
    gaps.add(*scatter(random, 3000), fixed=True)
    for moved in (3, 40, 0):
        where, _ = scatter(random, moved)
        points = points.copy()
        points[random.permutation(len(points))[:moved]] = where
        points = np.concatenate([points, scatter(random, 2)[0]])
        gaps.look(points, np.tile(up[0], (len(points), 1)))
        first = np.linalg.norm(gaps.skin.back(gaps.places.points)[:, None] - points, axis=2).min(axis=1) / gaps.spacing
        assert gaps.places.closest["way"] == pytest.approx(np.minimum(first, 2.0), abs=1e-5)
        assert gaps.neighbour_distances().shape == (len(points),)


@pytest.mark.parametrize("seed", range(5))
def test_the_worst_gap_is_found_from_few_places(seed):
    """Of a lattice that lacks one point it is there, a spacing away from six others."""
    random, number = np.random.default_rng(seed), 150
    gaps = plane_gaps(number)
    row, column = np.indices((60, 60)).reshape(2, -1) - 20
    lattice = np.column_stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row, np.zeros(row.size)]) * gaps.spacing
    missing = random.uniform(0.2, 0.8, 3) * [1.0, 1.0, 0.0]
    points = lattice - lattice[np.linalg.norm(lattice - missing, axis=1).argmin()] + missing
    points = points[np.linalg.norm(points - missing, axis=1) > 0.5 * gaps.spacing]
    gaps.look(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    gaps.add(*scatter(random, 10 * number), fixed=True)
    known = gaps.places.closest["way"].max()
    verdict = gaps.judge(np.zeros(len(points), bool), random)
    assert known < 0.97
    assert gaps.places.closest["way"].max() == pytest.approx(1.0, abs=0.025)
    assert np.linalg.norm(verdict.points[0] - missing) < 0.03 * gaps.spacing


@pytest.mark.parametrize("radius", [0.28, 0.48, 0.9])
def test_a_particle_alone_on_a_small_piece_gets_a_neighbour(radius):
    """However small, if there is room on it for two; as far from it as the piece allows, and no farther than a spacing."""
    turn = np.linspace(0.0, 2.0 * np.pi, 65)
    rim, middle = radius * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn]), np.zeros((1, 3))
    disc = np.stack([np.broadcast_to(middle, (64, 3)), rim[:-1], rim[1:]], axis=1)
    gaps = Gaps(Skin(disc), 1.0)
    gaps.look(middle, np.array([[0.0, 0.0, 1.0]]))
    gaps.scatter(200, np.random.default_rng(0), fixed=True)
    verdict = gaps.judge(np.zeros(1, bool), np.random.default_rng(0))
    assert np.linalg.norm(verdict.points[0]) == pytest.approx(radius, abs=0.05)


def test_a_gap_behind_which_a_particle_of_the_other_skin_lies_is_filled_beside_it():
    """On a leaf without thickness, at the end of which one skin lacks a particle and the other has one."""
    leaf = np.array(
        [[[0.0, -0.01, 0.0], [1.1, -0.01, 0.0], [1.1, 0.01, 0.0]], [[0.0, -0.01, 0.0], [1.1, 0.01, 0.0], [0.0, 0.01, 0.0]]]
    )
    gaps = Gaps(Skin(np.concatenate([leaf, leaf[:, ::-1]])), 1.0)
    points, up = np.array([[1.05, 0.0, 0.0], [0.0, 0.0, 0.0], [0.9, 0.0, 0.0]]), np.array([0.0, 0.0, 1.0])
    gaps.look(points, np.array([up, -up, -up]))
    gaps.scatter(500, np.random.default_rng(0), fixed=True)
    verdict = gaps.judge(np.zeros(3, bool), np.random.default_rng(0))
    assert len(verdict.points) == 1 and verdict.normals[0] == pytest.approx(up)
    assert verdict.points[0][0] > 0.37


@pytest.mark.parametrize("portion", [500_000, 700])
def test_random_places_are_thrown_in_portions(monkeypatch, portion):
    monkeypatch.setattr("sampler.particles.gaps._PORTION", portion)
    gaps, (points, up) = plane_gaps(50), scatter(np.random.default_rng(4), 50)
    gaps.look(points, up)
    for fixed in (True, False):
        gaps.scatter(2000, np.random.default_rng(5), fixed)
    places = gaps.places
    assert np.count_nonzero(places.fixed) == 2 * 2000
    assert np.all(places.excess[~places.fixed] > -0.15) and 0 < np.count_nonzero(~places.fixed) < 4000
    first = np.linalg.norm(gaps.skin.back(places.points)[:, None] - points, axis=2).min(axis=1) / gaps.spacing
    assert places.closest["way"] == pytest.approx(np.minimum(first, 2.0), abs=1e-5)


def test_particles_are_found_however_far_they_are_scattered():
    """In far more cells than there may be, so in wider ones."""
    random = np.random.default_rng(3)
    gaps = Gaps(Skin(np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]])), 0.002)
    points, places = random.random((50, 3)), random.random((200, 3))
    up = np.tile([0.0, 0.0, 1.0], (200, 1))
    gaps.look(points, up[:50])
    far = np.linalg.norm(places[:, None] - points, axis=2)
    for found in gaps.measure(gaps.skin.shifted(places), up.astype(np.float32), 1000.0):
        assert found["way"] * 0.002 == pytest.approx(far.min(axis=1), abs=1e-5)
        assert np.array_equal(found["which"], far.argmin(axis=1))
    apart = np.linalg.norm(points[:, None] - points, axis=2) + 2.0 * np.eye(50)
    assert gaps.neighbour_distances(1000.0) * 0.002 == pytest.approx(apart.min(axis=1), abs=1e-5)


def test_of_equal_particles_the_first_is_nearest_whatever_the_order_of_lists():
    """A GPU writes the lists of cells in any order; in a square lattice four particles are equally near to each middle."""
    gaps = plane_gaps(100)
    lattice, middles = (np.stack(np.meshgrid(x, x, [0.0]), -1).reshape(-1, 3) for x in (np.arange(9) / 8, np.arange(0.5, 8) / 8))
    up = np.tile([0.0, 0.0, 1.0], (len(lattice), 1))
    gaps.look(lattice, up)
    places = gaps.skin.shifted(middles), up[: len(middles)].astype(np.float32)
    wanted = gaps.measure(*places)
    lists, begin = gaps.cells.near.numpy(), gaps.cells.near_begin.numpy()
    for seed in range(3):
        random = np.random.default_rng(seed)
        for first, last in pairwise(begin):
            random.shuffle(lists[first:last])
        for found, one in zip(gaps.measure(*places), wanted, strict=True):
            np.testing.assert_array_equal(found, one)
