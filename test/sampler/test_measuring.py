"""What is said of the particles, against what they are: the worst place, however far it is, on bodies as they are handed over."""

import numpy as np
import pytest
import trimesh
from spread import distances, neighbours, worst_on_a_box

from sampler import MeshError, sample_body
from sampler.limits import check_scale


@pytest.mark.parametrize("seed", range(3))
def test_the_worst_place_is_found(seed):
    extents = (0.1, 0.07, 0.05)
    body = sample_body(trimesh.creation.box(extents), radius=0.002, count=300, seed=seed)
    worst = worst_on_a_box(extents, body.points)
    assert body.coverage == pytest.approx(worst, rel=2e-3)
    assert body.smallest_grain == pytest.approx(worst - 0.002, abs=2e-3 * worst)
    assert body.evenness.skin_coverage >= body.evenness.coverage


def test_the_worst_place_is_found_among_those_kept_in_mind(monkeypatch):
    """Of many particles not all places are, and they are thrown in portions."""
    monkeypatch.setattr("sampler.measuring._MANY", 0)
    monkeypatch.setattr("sampler.particles.gaps._PORTION", 4000)
    extents = (0.1, 0.07, 0.05)
    body = sample_body(trimesh.creation.box(extents), radius=0.002, count=300)
    assert body.coverage == pytest.approx(worst_on_a_box(extents, body.points), rel=2e-3)


def test_however_far_the_worst_place_is():
    """Of eight cubes in a row, far apart, more than half have no particle."""
    cubes = [trimesh.creation.box((1.0, 1.0, 1.0)).apply_translation([100.0 * k, 0.0, 0.0]) for k in range(8)]
    row = trimesh.util.concatenate(cubes)
    body = sample_body(row, radius=3.0, count=3)
    worst = distances(np.asarray(row.vertices), body.points).max()
    assert worst > 2.0 * body.spacing
    assert body.coverage == pytest.approx(worst, rel=2e-3)
    assert body.evenness.farthest * body.spacing == pytest.approx(neighbours(body.points).max(), rel=1e-4)
    with pytest.raises(MeshError, match="could pass"):
        sample_body(row, radius=3.0, count=3, grain=0.9 * worst - 3.0)


def test_what_lies_otherwise_than_it_should_is_told():
    assert sample_body(trimesh.creation.box((0.1, 0.07, 0.05)), radius=0.004).warnings == ()
    bar = sample_body(trimesh.creation.box((1000.0, 1.0, 1.0)), radius=15.0, count=50)
    assert f"farthest {bar.evenness.farthest:.2f} (at most 1.1)" in bar.warnings[-1]
    assert f"coverage {bar.evenness.coverage:.2f} (at most 1)" in bar.warnings[-1]
    large = sample_body(trimesh.creation.box((1.0, 1.0, 1.0)), radius=10.0)
    assert "about as large as the mesh, 1.73 m across" in large.warnings[-1]


def test_what_a_single_particle_leaves_open_is_told():
    """Wherever it lies: the other of two cubes is farther than a spacing, the corner of a block nearer."""
    cubes = [trimesh.creation.box((1.0, 1.0, 1.0)).apply_translation([30.0 * k, 0.0, 0.0]) for k in range(2)]
    assert "coverage" in sample_body(trimesh.util.concatenate(cubes), radius=0.4, count=1).warnings[-1]
    assert not sample_body(trimesh.creation.box((2.0, 1.0, 1.0)), radius=0.4, count=1).warnings


def test_what_will_take_minutes_is_told_before(caplog):
    cube = trimesh.creation.box((100.0, 100.0, 100.0)).triangles  # in millimetres, taken for metres
    check_scale(cube, 0.4, 0.6)
    assert not caplog.messages
    check_scale(cube, 0.2, 0.3)
    assert "about 7.7e+05 particles on 6e+04 m^2 take minutes" in caplog.text and "0.001 for millimetres" in caplog.text
