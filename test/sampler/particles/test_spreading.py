"""One push of particles along a surface, and ways around its edges, against NumPy."""

import numpy as np
import pytest
import trimesh
import warp as wp

from sampler.launching import launch_shares
from sampler.particles.cells import sort_into_cells
from sampler.particles.gaps import Gaps
from sampler.particles.skin import Skin
from sampler.particles.spreading_kernels import push_apart


def pushed(points, normals, spacing, apart, strength):
    """What pushes each point, clipped to the longest step; those without a normal lie beyond a rim."""
    away = points[:, None] - points
    far = np.linalg.norm(away, axis=2)
    soft = np.maximum(np.exp(-2.0 * (far / spacing) ** 2) - np.exp(-8.0), 0.0)
    share = np.clip((normals @ normals.T + 0.7) / 0.5, 0.0, 1.0)
    soft *= 1.0 - 0.6 * (1.0 - share**2 * (3.0 - 2.0 * share))
    level = np.abs(np.einsum("ijk,ik->ij", away, normals)) < 0.3 * spacing
    beyond = ~normals.any(axis=1)
    push = np.where(beyond, 0.33 * soft * level, soft + 8.0 * np.maximum(1.25 * apart - far, 0.0) / spacing)
    step = strength * np.einsum("ijk,ij->ik", away, push / np.maximum(far, 1e-3 * spacing))
    return step * np.minimum(1.0, 0.3 * spacing / np.maximum(np.linalg.norm(step, axis=1), 1e-12))[:, None]


@pytest.mark.parametrize("number", [40, 2500], ids=["few", "more at a time than fit into the kernel's buffer"])
def test_a_push_is_that_of_all_neighbours(number):
    random = np.random.default_rng(number)
    plane = Skin(np.asarray(trimesh.creation.box((4.0, 4.0, 1e-4)).triangles))
    spacing = 0.05
    points = np.column_stack([random.uniform(-0.2, 0.2, (number, 2)), np.zeros(number)])  # a wall without thickness
    normals = random.choice([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]], number)
    points[~normals.any(axis=1), 2] = random.uniform(-0.05, 0.05, np.count_nonzero(~normals.any(axis=1)))
    held = ~normals.any(axis=1) | (random.random(number) < 0.2)
    wanted = pushed(points, normals, spacing, 0.4 * spacing, 0.1 * spacing)
    cells = sort_into_cells(points.astype(np.float32), normals, 2.0 * spacing, "cpu")
    moved, up = (wp.empty(number, dtype=wp.vec3, device="cpu") for _ in range(2))
    inputs = [cells, *plane.faces, wp.array(held, dtype=int, device="cpu"), spacing, 0.4 * spacing, 0.1 * spacing]
    launch_shares(push_apart, number, inputs, [moved, up], "cpu")
    step = moved.numpy() - points
    assert np.abs(step[held]).max() < 1e-7
    assert np.linalg.norm(wanted[~held], axis=1).max() > 0.1 * spacing
    assert step[~held, :2] == pytest.approx(wanted[~held, :2], abs=5e-3 * spacing)  # the kernel's Gaussian is a power


@pytest.mark.parametrize("angle", [0.3, 1.0, 1.8, 2.4])
def test_ways_lead_around_edges(angle):
    """Of two half planes that meet along the axis z one is turned into the plane of the other; then ways are straight."""
    random = np.random.default_rng(0)
    turn = np.pi - angle  # of the other half plane, about the axis z, until it goes on as the first one does
    ahead, aside = random.uniform(0.0, 1.0, (2, 200)), random.uniform(-1.0, 1.0, (2, 200))
    zero = np.zeros(200)
    places = np.column_stack([ahead[0], zero, aside[0]])
    points = np.column_stack([ahead[1] * np.cos(angle), ahead[1] * np.sin(angle), aside[1]])
    unfolded = np.column_stack([-ahead[1], zero, aside[1]])
    up, other = np.array([0.0, -1.0, 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
    assert up @ other == pytest.approx(np.cos(turn))
    straight = up @ other > -0.2  # such places count as on one skin
    triangles = np.array([[[2.0, 0.0, -2.0], [2.0, 0.0, 2.0], [-2.0, 0.0, 0.0]]])
    gaps = Gaps(Skin(triangles), 2.0)
    for place, point, flat in zip(places, points, unfolded, strict=True):
        gaps.look(point[None], other[None])
        closest, own = gaps.measure(gaps.skin.shifted(place[None]), up[None].astype(np.float32))
        assert closest["way"][0] == pytest.approx(np.linalg.norm(place - point) / 2.0, abs=1e-4)
        wanted = np.linalg.norm(place - (point if straight else flat)) / 2.0
        assert own["way"][0] == pytest.approx(wanted, abs=1e-3)
