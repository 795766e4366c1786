"""Damaged meshes against the sound ones they were made from."""

import numpy as np
import pytest
import trimesh
from shapes import THIN, robot_mesh, wavy_ball

from benchmarks.sampler_damage import damaged, far_from_surface, grid_around, solid_angle_inside
from sampler import SignedDistance, read_mesh, repair_mesh, sample_body
from sampler.geometry.loops import span_loops
from sampler.geometry.surface import Surface
from sampler.mass import integrate
from sampler.mending.repair import CAP, SHEET

HARMLESS = ("flipped", "doubled", "doubled with backs", "cracked", "missing")


def signs(mesh, sound, seed=1):
    """Share of wrong signs on a grid and near the surface, by solid angles of the sound mesh."""
    random = np.random.default_rng(seed)
    near, _ = trimesh.sample.sample_surface(sound, 3000, seed=seed)
    near = near + random.normal(size=near.shape) * 5e-3 * np.linalg.norm(sound.extents)
    distance, wrong = SignedDistance(mesh), []
    for places in (grid_around(sound, 16), near):
        points = places[far_from_surface(SignedDistance(sound), places)]
        inside = distance.query(points)[0] < 0.0
        wrong.append(np.mean(inside != solid_angle_inside(np.asarray(sound.triangles), points)))
    return wrong


@pytest.mark.parametrize("how", HARMLESS)
def test_signs_survive_damage(how):
    ball = wavy_ball(3)
    grid, near = signs(damaged(ball, how), ball)
    assert grid <= 1e-4
    assert near <= 1e-3


def test_a_hole_costs_little_and_is_told():
    ball = wavy_ball(3)
    broken = damaged(ball, "hole")
    grid, near = signs(broken, ball)
    assert grid <= 5e-3
    assert 0.0 < near <= 0.03
    assert any("holes were closed" in warning for warning in repair_mesh(broken).report.warnings)


def test_a_torn_hole_may_be_larger_than_an_opening():
    ring, tube = trimesh.creation.torus(1.0, 0.4, major_sections=96, minor_sections=48), trimesh.creation.cylinder(1.0, 3.6)
    x, y, z = np.asarray(ring.triangles).mean(axis=1).T
    torn = (z > 0.1) & (np.abs(np.arctan2(y, x)) < 0.95)
    opening = np.asarray(tube.triangles)[:, :, 2].min(axis=1) > 1.7
    for sound, gone, sheets in ((ring, torn, 0), (tube, opening, 1)):
        assert 0.1 < sound.area_faces[gone].sum() / sound.area < 0.13
        assert repair_mesh(loose(np.asarray(sound.triangles)[~gone])).report.steps["sheets"] == sheets


def test_a_part_from_which_faces_were_broken_out_is_no_sheet():
    """Its rim zigzags from face to face; those of a scoop of bent plates and of a cut pipe do not."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    ragged = trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 2] < 0.3])
    pipe = trimesh.creation.cylinder(1.0, 1.2, sections=24)
    pipe.update_faces(pipe.triangles[:, :, 2].min(axis=1) < 0.5)  # without its end
    scoop = trimesh.creation.box((1.0, 1.0, 1.0))
    scoop.update_faces((scoop.face_normals[:, 2] < 0.5) & (scoop.face_normals[:, 0] < 0.5))  # without its top and front
    rest = trimesh.creation.box((3.0, 3.0, 3.0))
    rest.apply_translation((10.0, 0.0, 0.0))
    for broken, sheets in ((ragged, 0), (pipe, 1), (scoop, 1)):
        closed = repair_mesh(broken, sheets="never")
        assert Surface.areas_of(closed.triangles[closed.kind == CAP]).sum() > 0.25 * broken.area
        assert repair_mesh(trimesh.util.concatenate([broken, rest])).report.steps["sheets"] == sheets


@pytest.mark.parametrize(("how", "volume", "centre", "inertia"), [("missing", 0.015, 0.003, 0.01), ("hole", 0.06, 0.015, 0.08)])
@pytest.mark.parametrize("seed", range(3))
def test_mass_of_broken_meshes(how, volume, centre, inertia, seed):
    ball = wavy_ball()
    exact = integrate(np.asarray(ball.triangles))
    found = integrate(repair_mesh(damaged(ball, how, seed)).triangles)
    assert found[0] == pytest.approx(exact[0], rel=volume)
    assert np.linalg.norm(found[1] - exact[1]) < centre * np.linalg.norm(ball.extents)
    assert np.abs(found[2] - exact[2]).max() < inertia * np.abs(exact[2]).max()


def loose(triangles):
    """A mesh of triangles that share no vertices."""
    return trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)


def test_cracks_are_sewn_in_their_middle():
    ball, gap = wavy_ball(3), 1e-5
    triangles = np.array(ball.triangles)
    far = triangles.mean(axis=1)[:, 0] > 0.0
    triangles[far, :, 0] += gap
    repaired = repair_mesh(loose(triangles))
    assert repaired.report.steps["edges sewn"] > 0
    rim = np.intersect1d(*(ball.faces[side] for side in (far, ~far)))
    expected = np.sort(ball.vertices[rim][:, 0] + 0.5 * gap)
    off = np.abs(repaired.vertices[np.unique(repaired.faces)][:, 0][:, None] - expected).min(axis=0)
    assert off.max() < 1e-12


@pytest.mark.parametrize("damage", ["beside one another", "opposite", "hole"])
def test_the_skins_of_a_thin_plate_are_not_sewn_to_each_other(damage):
    """Where each of them lacks a triangle at one corner, or what is around it."""
    plate = trimesh.creation.box((1.0, 1.0, 1.0))
    for _ in range(3):
        plate = plate.subdivide()
    place, gone = (0.25, 0.25), []
    for side in (1.0, -1.0):
        away = plate.triangles_center[:, :2] - place
        away[plate.face_normals[:, 2] * side < 0.5] = np.inf
        near = np.argsort(np.linalg.norm(away, axis=1))[:6]  # around the corner
        forth = away[near, 0] * (side if damage == "beside one another" else 1.0)
        gone += [*near] if damage == "hole" else [near[forth.argmax()]]
    plate.apply_scale((1.0, 1.0, 1e-3))
    repaired = repair_mesh(trimesh.Trimesh(plate.vertices, np.delete(plate.faces, gone, axis=0), process=False))
    assert repaired.report.steps["holes closed"] == 2
    assert integrate(repaired.triangles)[0] == pytest.approx(1e-3, rel=1e-12)


@pytest.mark.parametrize("share", [0.01, 0.04])
def test_needles_that_fell_apart_are_not_sewn_flat(share):
    pipe = trimesh.creation.cylinder(radius=0.1, height=5.0, sections=64)
    triangles = np.array(pipe.triangles)
    triangles += share * (triangles.mean(axis=1, keepdims=True) - triangles)
    repaired = repair_mesh(loose(triangles))
    assert repaired.report.steps["degenerate faces dropped"] == 0
    assert integrate(repaired.triangles)[0] == pytest.approx(pipe.volume, rel=1.2 * share)


@pytest.mark.parametrize("seed", range(3))
def test_cracks_of_a_ten_thousandth_cost_hardly_any_volume(seed):
    pipe = trimesh.creation.annulus(0.4, 0.5, 1.0, sections=64)
    triangles = np.array(pipe.triangles)
    triangles += np.random.default_rng(seed).uniform(-1e-4, 1e-4, triangles.shape) * np.linalg.norm(pipe.extents)
    repaired = repair_mesh(loose(triangles))
    assert not any("cracked" in warning for warning in repaired.report.warnings)
    assert not repaired.report.steps["sheets"]
    assert integrate(repaired.triangles)[0] == pytest.approx(pipe.volume, rel=1e-3)


def test_open_pieces_of_a_solid_are_counted():
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    top = box.face_normals[:, 2] > 0.5
    lid = trimesh.Trimesh(box.vertices, box.faces[top]).subdivide()  # its edges meet those of the rest in their middles
    repaired = repair_mesh(trimesh.util.concatenate([trimesh.Trimesh(box.vertices, box.faces[~top]), lid]))
    assert repaired.report.warnings == ["2 open pieces are taken for parts of one cracked surface"]


def test_every_step_is_counted():
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    faces = np.concatenate([box.faces, box.faces[:2], box.faces[2:3, ::-1], [[0, 0, 1]]])
    faces[4] = faces[4][::-1]
    steps = repair_mesh(trimesh.Trimesh(box.vertices, faces, process=False)).report.steps
    assert steps["duplicate faces dropped"] == 3
    assert steps["degenerate faces dropped"] == 1
    assert steps["faces turned"] == 1
    assert steps["vertices merged"] == 0


def test_inside_out_solids_are_turned_but_cavities_stay():
    outer, inner = trimesh.creation.icosphere(3, radius=1.0), trimesh.creation.icosphere(3, radius=0.5)
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    for mesh in (hollow, trimesh.Trimesh(hollow.vertices, hollow.faces[:, ::-1], process=False)):
        assert SignedDistance(mesh).query([[0, 0, 0], [0, 0, 0.75], [0, 0, 1.5]])[0] == pytest.approx([0.5, -0.25, 0.5], abs=0.01)


@pytest.mark.parametrize("first", [0, 5, 9])
def test_an_inverted_part_that_overlaps_is_no_cavity_whichever_face_comes_first(first):
    box, other = trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.creation.box((1.0, 1.0, 1.0))
    other.apply_translation((0.5, 0.3, 0.2))
    other = trimesh.Trimesh(other.vertices, np.roll(other.faces[:, ::-1], first, axis=0), process=False)
    repaired = repair_mesh(trimesh.util.concatenate([box, other]))
    assert repaired.report.steps["components turned"] == 1
    union = 2.0 - 0.5 * 0.7 * 0.8
    assert sample_body(repaired, 0.05, count=300).volume == pytest.approx(union, rel=1e-9)


def test_a_wall_between_touching_solids_is_no_surface():
    left = trimesh.creation.box((1, 1, 1))
    right = trimesh.Trimesh(left.vertices * [-1, 1, 1] + [1, 0, 0], left.faces[:, ::-1])
    both = trimesh.util.concatenate([left, right])
    assert repair_mesh(both).report.steps["duplicate faces dropped"] == 4
    assert SignedDistance(both).query([[0.5, 0, 0]])[0] == pytest.approx([-0.5])


def test_levels_of_detail_with_common_edges_stay_as_they_are():
    levels = [trimesh.creation.cylinder(0.3, 1.0, sections=sections) for sections in (8, 16, 32, 64)]
    together = trimesh.util.concatenate(levels)
    assert repair_mesh(together).report.steps["faces turned"] == 0
    assert signs(together, levels[-1]) == [0.0, 0.0]


@pytest.mark.parametrize("turned", [False, True])
def test_a_partition_that_shares_its_edges_with_the_shell_is_told_from_it(turned):
    boxes = [trimesh.creation.box((1.0, 1.0, 1.0)).apply_translation([x, 0, 0]) for x in (-0.5, 0.5)]
    between = [np.all(box.vertices[box.faces][:, :, 0] == 0.0, axis=1) for box in boxes]
    wall = boxes[0].triangles[between[0]][:, :: -1 if turned else 1]
    shell = np.concatenate([box.triangles[~side] for box, side in zip(boxes, between, strict=True)])
    repaired = repair_mesh(loose(np.concatenate([shell, wall])))
    assert (repaired.kind == SHEET).sum() == 2
    assert repaired.report.steps["faces turned"] == repaired.report.steps["holes closed"] == 0
    assert signs(loose(np.concatenate([shell, wall])), loose(shell)) == [0.0, 0.0]


def test_slivers_without_area_are_no_sheets():
    first, second = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1))
    second.apply_translation((1, 0, 0))
    second.update_faces(second.triangles_center[:, 0] > 0.51)  # one wall between the two, whose edges have three faces
    mesh = trimesh.util.concatenate([first, second])
    mesh.merge_vertices()
    p, q = (int(np.argmin(np.linalg.norm(mesh.vertices - [-0.5, -0.5, z], axis=1))) for z in (-0.5, 0.5))
    cut = next(k for k, face in enumerate(mesh.faces) if {p, q} <= set(face))
    x, y, z = next(turn for turn in (np.roll(mesh.faces[cut], k) for k in range(3)) if {turn[0], turn[1]} == {p, q})
    middle = len(mesh.vertices)
    faces = np.vstack([np.delete(mesh.faces, cut, axis=0), [[x, middle, z], [middle, y, z], [x, y, middle]]])
    body = sample_body(trimesh.Trimesh([*mesh.vertices, [-0.5, -0.5, 0.1]], faces, process=False), 0.05, sheets="never")
    assert body.steps["faces of double walls"] == 0
    assert body.volume == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_overlapping_parts_have_one_inside(size):
    balls = [trimesh.creation.icosphere(3, radius=1.0) for _ in range(3)]
    for k, ball in enumerate(balls):
        ball.apply_translation([0.8 * k, 0.3 * k * k, 0.0])
        ball.apply_scale(size)
    union = trimesh.util.concatenate(balls)
    distance, points = SignedDistance(union), np.random.default_rng(0).uniform(-1.2, 3.2, (4000, 3)) * size
    points = points[far_from_surface(distance, points)]
    inside = np.any([solid_angle_inside(np.asarray(ball.triangles), points) for ball in balls], axis=0)
    assert np.array_equal(distance.query(points)[0] < 0.0, inside)


@pytest.mark.parametrize("name", [*THIN, "viper_blade.obj"])
def test_signs_of_robot_meshes_just_off_the_surface(name):
    mesh = read_mesh(robot_mesh(name))
    distance = SignedDistance(mesh)
    surface, face = trimesh.sample.sample_surface(trimesh.Trimesh(**flat(distance)), 1500, seed=2)
    normal = distance.surface.normals[face]
    step = 1.1e-5 * distance.surface.unit
    inside = solid_angle_inside(distance.surface.triangles, np.concatenate([surface + step * normal, surface - step * normal]))
    found = distance.query(np.concatenate([surface + step * normal, surface - step * normal]))[0] < 0.0
    assert np.array_equal(found, inside)


def flat(distance):
    corners = distance.surface.triangles.reshape(-1, 3)
    return {"vertices": corners, "faces": np.arange(len(corners)).reshape(-1, 3), "process": False}


@pytest.mark.parametrize("how", HARMLESS)
@pytest.mark.parametrize("name", ["excavator_bucket_mm.stl", "franka_hand_col.stl"])
def test_damaged_robot_meshes(name, how):
    mesh = read_mesh(robot_mesh(name))
    mesh.merge_vertices()
    grid, near = signs(damaged(mesh, how), mesh)
    assert grid <= 1e-4
    assert near <= 1e-3


@pytest.mark.parametrize("tips", [20, 150])
def test_a_jagged_loop_is_spanned_within_its_edge(tips):
    # Two triangles per tip of a star, from its middle.
    angle = np.arange(2 * tips) * np.pi / tips
    reach = np.where(np.arange(2 * tips) % 2, 1.0, 2.0)
    star = np.stack([reach * np.cos(angle), reach * np.sin(angle), np.full(2 * tips, 3.0)], axis=1)
    corners = star[span_loops(star, [np.arange(2 * tips)])[0]]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(2 * tips * 0.5 * 2.0 * 1.0 * np.sin(np.pi / tips))
