"""Volume, centre and inertia: of surfaces that close, exactly, and of others by what lies inside of them."""

import numpy as np
import pytest
import trimesh

from sampler import sample_body
from sampler.mass import count_inside, integrate, joined, openness
from sampler.surface import Surface


def cone():
    return trimesh.creation.cone(0.3, 1.0, sections=64).apply_transform(trimesh.transformations.rotation_matrix(0.7, (1, 2, 3)))


def cracked(mesh, gap):
    """The mesh in some fifty patches with gaps between them, each a share of a patch wide."""
    triangles = np.array(mesh.triangles)
    patch = np.unique(np.floor(triangles.mean(axis=1) / 0.5), axis=0, return_inverse=True)[1].ravel()
    for k in range(patch.max() + 1):
        middle = triangles[patch == k].mean(axis=(0, 1))
        triangles[patch == k] = middle + (1.0 - gap) * (triangles[patch == k] - middle)
    return trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)


def test_counted_and_integrated_alike():
    mesh = cone()
    volume, centre, inertia = count_inside(Surface(np.asarray(mesh.triangles)))
    exact = integrate(np.asarray(mesh.triangles))
    assert volume == pytest.approx(exact[0], rel=2e-3)
    assert centre == pytest.approx(exact[1], abs=1e-3)
    assert inertia == pytest.approx(exact[2], abs=2e-3 * np.trace(exact[2]))


def test_solids_are_joined_as_if_they_were_one():
    parts = [np.asarray(mesh.triangles) for mesh in (cone(), trimesh.creation.box((1.0, 2.0, 3.0)).apply_translation([5, 0, 1]))]
    for told, exact in zip(joined([integrate(part) for part in parts]), integrate(np.concatenate(parts)), strict=True):
        assert told == pytest.approx(exact, rel=1e-12)
    assert joined([])[0] == 0.0


def test_surfaces_that_close_are_told_from_others():
    mesh = cone()
    assert openness(np.asarray(mesh.triangles)) < 1e-12
    assert openness(np.asarray(mesh.triangles)[: len(mesh.faces) // 2]) > 0.1


@pytest.mark.parametrize("gap", [0.03, 0.06])
def test_cracked_solids_weigh_what_lies_inside_of_them(gap):
    """The integral over patches that do not meet lacks twice the share of their gaps: 6 or 12 %."""
    ball = trimesh.creation.icosphere(5)
    body = sample_body(cracked(ball, gap), radius=0.05, count=400)
    assert integrate(body.triangles)[0] == pytest.approx((1.0 - 2.0 * gap) * ball.volume, rel=0.005)
    assert body.volume == pytest.approx(ball.volume, rel=0.01)
    assert body.centre == pytest.approx(np.zeros(3), abs=0.005)
    assert body.inertia == pytest.approx(0.4 * ball.volume * np.eye(3), abs=0.03 * 0.4 * ball.volume)
    assert any("does not close" in warning for warning in body.mass_warnings)
