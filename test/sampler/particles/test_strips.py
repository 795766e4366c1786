"""Strips and wires far narrower than the spacing get a row of particles, whatever else the mesh has."""

import numpy as np
import pytest
import trimesh

from sampler import sample_body
from sampler.particles import strips
from sampler.particles.skin import Skin, halve_triangles, slices
from sampler.particles.strips import with_rows

H, RADIUS = 0.01, 0.01 / 1.5  # the spacing that a radius stands for
LONG = 60.0 * H


def strip(width, length=LONG, height=0.0):
    """A flat sheet along x."""
    place = [[0.0, 0.0, height], [length, 0.0, height], [length, width, height], [0.0, width, height]]
    return trimesh.Trimesh(place, [[0, 1, 2], [0, 2, 3]], process=False)


def wire(diameter):
    """A cylinder along x."""
    turn = trimesh.transformations.rotation_matrix(np.pi / 2.0, [0.0, 1.0, 0.0], point=[0.0, 0.0, 0.0])
    mesh = trimesh.creation.cylinder(0.5 * diameter, LONG, sections=12, transform=turn)
    return mesh.apply_translation([0.5 * LONG, 0.0, 0.0])


def gap(points, low=0.0, high=LONG):
    """Farthest that a place on the x axis is from the nearest point [h]."""
    axis = np.linspace(low, high, 2001)
    return np.abs(axis[:, None] - points[:, 0]).min(axis=1).max() / H


@pytest.mark.parametrize(
    "mesh",
    [pytest.param(strip(share * H), id=f"strip {share} h") for share in (0.02, 0.1, 0.5)]
    + [pytest.param(wire(share * H), id=f"wire {share} h") for share in (0.05, 0.2)],
)
def test_a_strip_or_wire_alone_gets_a_row(mesh):
    """By its area it would get 1, 7, 35, 11 or 44 particles."""
    body = sample_body(mesh, RADIUS)
    assert 52 <= len(body) <= 66
    assert gap(body.points) < 0.85
    assert body.evenness.coverage < 0.85


def test_strips_beside_something_wide_get_rows_and_the_count_is_kept():
    bar = trimesh.creation.box((LONG, 3.0 * H, 3.0 * H))
    bar.apply_translation([0.5 * LONG, 20.0 * H, 0.0])
    strips = [strip(0.1 * H, height=4.0 * k * H) for k in range(5)]
    body = sample_body(trimesh.util.concatenate([*strips, bar]), RADIUS, count=1100)
    assert len(body) == pytest.approx(1100, rel=0.01)
    for k in range(5):
        assert gap(body.points[np.abs(body.points - [0.0, 0.0, 4.0 * k * H])[:, 1:].max(axis=1) < H]) < 0.85
    assert body.evenness.coverage < 0.85
    assert body.evenness.variation < 0.065


def test_no_grain_passes_between_the_particles_of_a_wire():
    body = sample_body(wire(0.1 * H), RADIUS, grain=0.4 * RADIUS)
    assert gap(body.points) * H < RADIUS + 0.4 * RADIUS


def test_pieces_smaller_than_the_spacing_count_as_one_particle_each():
    pieces = [strip(0.2 * H, 0.2 * H).apply_translation([3.0 * k * H, 0.0, 0.0]) for k in range(40)]
    wide = strip(2.0 * H, height=-5.0 * H)
    skin = Skin(np.asarray(trimesh.util.concatenate([*pieces, wide]).triangles, float))
    areas = with_rows(skin, H).areas
    assert areas[:80].reshape(-1, 2).sum(axis=1) == pytest.approx(np.full(40, 0.87 * H**2))
    assert areas[80:] == pytest.approx(skin.areas[80:])


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box((5.0 * H, 8.0 * H, 6.0 * H)),
        trimesh.creation.icosphere(4, 4.0 * H),
        strip(2.0 * H),
        trimesh.creation.box((10.0 * H, 10.0 * H, 0.1 * H)),
        wire(0.5 * H),
    ],
    ids=["box", "ball", "wide strip", "thin plate", "rod"],
)
def test_what_is_wide_enough_stays_as_it_is(mesh):
    skin = Skin(np.asarray(mesh.triangles, float))
    assert with_rows(skin, H) is skin


def test_what_is_wide_keeps_the_layers_it_counts_as_beside_strips():
    """Front and back of a sheet in one place count as one; a strip beside it gets its row all the same."""
    piece, wide = strip(0.2 * H, 0.2 * H), strip(2.0 * H, height=-5.0 * H)
    sides = np.asarray(wide.triangles, float)
    triangles = np.concatenate([np.asarray(piece.triangles, float), sides, sides[:, ::-1]])
    areas = with_rows(Skin(triangles, "cpu", np.array([1.0] * 2 + [2.0] * 4)), H).areas
    assert areas[:2].sum() == pytest.approx(0.87 * H**2)
    assert areas[2:] == pytest.approx(np.full(4, 0.25 * 2.0 * H * LONG))


def test_a_long_wire_is_cut_into_few_pieces(monkeypatch):
    # Ten thousand times as long as thick: halved at their longest edges alone, its needles became millions.
    asked = []
    monkeypatch.setattr(strips, "_wanted", lambda places, areas, device: asked.append(len(areas)) or np.ones(len(areas)))
    monkeypatch.setattr(strips, "halve_triangles", lambda triangles: asked.append(len(triangles)) or halve_triangles(triangles))
    wire = trimesh.creation.cylinder(1e-4, 1.0, sections=8)
    with_rows(Skin(np.asarray(wire.triangles)), 8e-4)
    assert 2500 < sum(asked) < 16 * 2500 + 100  # 1.0 / (0.5 * 8e-4) slices along each of its sides


def test_slices_are_the_whole_triangle():
    triangles = np.random.default_rng(0).normal(size=(50, 3, 3))
    places, shares, face = slices(triangles, 0.05)
    assert np.bincount(face, shares) == pytest.approx(np.ones(50), rel=1e-12)
    middle = np.stack([np.bincount(face, shares * x) for x in places.T], axis=1)
    assert middle == pytest.approx(triangles.mean(axis=1), abs=1e-12)
    along = np.linalg.norm(np.diff(places, axis=0), axis=1)[np.diff(face) == 0]
    assert along.max() < 4.0 * 0.05
