"""Caps go on as the faces around a hole do: balls and boxes keep their shape, cuts stay flat."""

import numpy as np
import pytest
import trimesh

from benchmarks.sampler_damage import damaged
from sampler.mass import integrate
from sampler.mending.caps import close_holes
from sampler.mending.raising import raise_caps
from sampler.mending.repair import CAP, repair_mesh


def volumes(mesh):
    """Closed with caps as they are raised, and with flat ones [m^3]."""
    repaired = repair_mesh(mesh)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    flat = close_holes(vertices, faces, np.zeros(len(faces), int)).faces
    return integrate(repaired.triangles)[0], integrate(vertices[np.concatenate([faces, flat])])[0]


def without(mesh, gone):
    """The mesh without some faces and what only they used."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces[~gone], process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


@pytest.mark.parametrize("place", range(3))
def test_a_ball_with_a_hole_stays_a_ball(place):
    ball = trimesh.creation.icosphere(subdivisions=3)
    raised, flat = volumes(damaged(ball, "hole", place))
    assert abs(raised / ball.volume - 1.0) < 0.5 * abs(flat / ball.volume - 1.0)


@pytest.mark.parametrize("corner", [(1, 1, 1), (1, 1, 0)], ids=["corner", "edge"])
def test_a_corner_and_an_edge_that_are_missing_come_back(corner):
    box = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide().subdivide()
    away = np.linalg.norm(box.triangles_center - 0.5 * np.array(corner), axis=1)
    broken = without(box, away < np.sort(away)[int(0.05 * len(away))])
    raised, flat = volumes(broken)
    assert flat < 0.99 < raised < 1.005
    assert 1.0 - raised < 0.5 * (1.0 - flat)


def test_no_place_leaves_the_rim_behind_a_sharp_tip():
    # Planes along a slender cone meet far beyond the rim; nothing is to fly there.
    cone = trimesh.creation.cone(0.1, 2.0, sections=24).subdivide().subdivide()
    high = cone.triangles_center[:, 2]
    ragged = high + 0.05 * np.sin(5.0 * np.arctan2(cone.triangles_center[:, 1], cone.triangles_center[:, 0]))
    repaired = repair_mesh(without(cone, ragged > 1.5))
    assert np.count_nonzero(repaired.kind == CAP)
    rim = repaired.triangles[repaired.kind != CAP][..., 2].max()
    assert repaired.triangles[..., 2].max() < rim + 0.1


def test_what_was_cut_off_in_a_plane_stays_flat():
    rod = trimesh.creation.cylinder(0.2, 1.0, sections=48).subdivide()
    repaired = repair_mesh(without(rod, rod.triangles_center[:, 2] > 0.4999))
    cap = repaired.triangles[repaired.kind == CAP]
    assert len(cap) == 2 * 48 - 2  # none of them split
    assert np.ptp(cap[..., 2]) < 1e-12


def test_the_mouth_of_a_vessel_is_spanned_taut():
    scoop = trimesh.creation.box((1.0, 1.0, 1.0))
    scoop = without(scoop, (scoop.face_normals[:, 2] > 0.5) | (scoop.face_normals[:, 0] > 0.5))  # the top and the front
    assert integrate(repair_mesh(scoop, sheets="never").triangles)[0] == pytest.approx(1.0, rel=1e-12)


def test_only_whole_caps_that_are_asked_for_are_raised():
    balls = [trimesh.creation.icosphere(subdivisions=2).apply_translation([x, 0.0, 0.0]) for x in (0.0, 3.0)]
    both = trimesh.util.concatenate([damaged(ball, "hole") for ball in balls])
    vertices, faces = np.asarray(both.vertices), np.asarray(both.faces)
    component = (both.triangles_center[:, 0] > 1.5).astype(int)
    caps = close_holes(vertices, faces, component)
    wide = np.full(2, np.inf)
    more, raised, owner = raise_caps(vertices, faces, caps, caps.owner == 1, wide)
    assert np.all(owner == 1)
    assert len(more) > len(vertices)
    assert np.array_equal(more[: len(vertices)], vertices)
    one = trimesh.Trimesh(more, np.concatenate([faces[component == 1], raised]), process=False)
    one.remove_unreferenced_vertices()
    assert one.is_watertight
    assert one.is_winding_consistent
    assert len(raise_caps(vertices, faces, caps, np.zeros(len(caps.faces), bool), wide)[1]) == 0


def test_caps_are_not_raised_through_other_faces():
    # The corner of a box is missing, and a smaller box stands where it was.
    box = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide()
    box = without(box, np.linalg.norm(box.triangles_center - 0.5, axis=1) < 0.45)
    other = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation([0.4, 0.4, 0.4])
    free, beside = (repair_mesh(mesh) for mesh in (box, trimesh.util.concatenate([box, other])))
    tips = [repaired.triangles[repaired.kind == CAP].reshape(-1, 3).sum(axis=1).max() for repaired in (free, beside)]
    assert tips[0] > 1.4
    assert tips[1] < 1.2
