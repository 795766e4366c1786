"""What of a surface can be touched, against closed forms."""

import numpy as np
import pytest
import trimesh

from benchmarks.sampler_damage import solid_angle_inside
from sampler import sample_body
from sampler.geometry.rays import closing_cones
from sampler.geometry.surface import Surface
from sampler.mass import integrate
from sampler.particles.skin import Skin, free_triangles, touchable_parts, winding_before
from sampler.particles.spreading import spread_particles


def box(extents, centre):
    return trimesh.creation.box(extents, trimesh.transformations.translation_matrix(centre))


def free_parts(*meshes, spacing=0.05):
    triangles = np.concatenate([mesh.triangles for mesh in meshes])
    return free_triangles(triangles, Surface(triangles), spacing)


def test_two_crossing_bars_hide_what_lies_in_the_other():
    free, _, layers = free_parts(box((2.0, 0.4, 0.4), (0, 0, 0)), box((0.3, 2.0, 0.3), (0, 0, 0)))
    own = 4 * 2.0 * 0.4 + 2 * 0.4**2 - 2 * 0.3 * 0.3
    other = 4 * (2.0 - 0.4) * 0.3 + 2 * 0.3**2
    assert Surface.areas_of(free).sum() == pytest.approx(own + other, rel=1e-12)
    assert np.all(layers == 1)
    assert integrate(free)[0] == pytest.approx(2.0 * 0.4**2 + 1.6 * 0.3**2, rel=1e-12)


@pytest.mark.parametrize("depth", [0.0, 0.1])
def test_a_box_on_a_plate_is_cut_along_its_foot(depth):
    plate, foot = box((2.0, 1.6, 0.4), (0, 0, 0)), box((0.3, 0.5, 0.3), (0.11, 0.07, 0.35 - depth))
    free, _, _ = free_parts(plate, foot)
    assert Surface.areas_of(free).sum() == pytest.approx(plate.area + 2 * (0.3 + 0.5) * (0.3 - depth), rel=1e-12)
    assert integrate(free)[0] == pytest.approx(plate.volume + 0.3 * 0.5 * (0.3 - depth), rel=1e-12)


def test_coarse_and_fine_cuts_make_the_same_solid():
    balls = [trimesh.creation.icosphere(4).apply_translation(place) for place in ((0, 0, 0), (0.62, 0.4, 0.2))]
    volume = [integrate(free_parts(*balls, spacing=h)[0])[0] for h in (0.05, 0.5)]
    apart = np.linalg.norm((0.62, 0.4, 0.2))
    caps = 2 * np.pi * (1.0 - apart / 2) ** 2 * (2.0 + apart / 2) / 3
    assert volume[0] == pytest.approx(volume[1], rel=1e-6)
    assert volume[0] == pytest.approx(2 * balls[0].volume - caps, rel=1e-3)  # balls of many faces


def test_only_what_another_part_comes_through_is_cut():
    far = box((1.0, 1.0, 1.0), (5.0, 0, 0))
    post = box((0.1, 0.1, 1.0), (0.07, 0.13, 0.5))  # stands in the middle of two large faces of the plate
    free, parent, _ = free_parts(box((2.0, 2.0, 0.2), (0, 0, 0)), post, far)
    assert np.count_nonzero(parent >= 24) == 12
    plate = Surface.areas_of(free[parent < 12]).sum()
    assert plate == pytest.approx(2 * 4.0 + 4 * 2.0 * 0.2 - 0.1 * 0.1, rel=1e-12)


def off_surface(surface, points):
    return points[np.linalg.norm(points - surface.closest(points)[0], axis=1) > 1e-4]


def test_winding_numbers_of_closed_surfaces_are_whole():
    balls = [trimesh.creation.icosphere(3).apply_translation([x, 0.1, 0.2]) for x in (0.0, 0.8)]
    surface = Surface(np.concatenate([ball.triangles for ball in balls]))
    points = off_surface(surface, np.random.default_rng(0).uniform(-1.5, 2.5, (3000, 3)))
    exact = np.sum([solid_angle_inside(np.asarray(ball.triangles), points) for ball in balls], axis=0)
    assert np.array_equal(surface.winding(points), exact)


def test_winding_numbers_of_boxes_in_one_another_count_them():
    random = np.random.default_rng(3)
    centres, extents = random.uniform(-1.0, 1.0, (12, 3)), random.uniform(0.2, 2.0, (12, 3))
    boxes = [box(e, c).subdivide().subdivide() for c, e in zip(centres, extents, strict=True)]
    surface = Surface(np.concatenate([part.triangles for part in boxes]))
    for number in (10, 1000, 50000):
        points = off_surface(surface, random.uniform(-2.5, 2.5, (number, 3)))
        inside = np.all(np.abs(points[:, None] - centres) < 0.5 * extents, axis=2).sum(axis=1)
        assert np.array_equal(surface.winding(points), inside)


def test_ways_through_a_surface_lower_the_winding_number():
    random = np.random.default_rng(4)
    surface = Surface(np.concatenate([box((1.0, 1.0, 1.0), (x, 0, 0)).triangles for x in (0.0, 0.3)]))
    begin, end = (random.uniform(-1.0, 1.0, (4000, 3)) for _ in range(2))
    assert np.array_equal(surface.leavings(begin, end), surface.winding(begin) - surface.winding(end))
    assert not surface.leavings(begin, begin).any()


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_cones_close_any_surface(share):
    random = np.random.default_rng(5)
    ball = trimesh.creation.icosphere(4)
    triangles = np.asarray(ball.triangles)[random.random(len(ball.faces)) > share]
    both = np.concatenate([triangles, closing_cones(triangles)])
    points = random.uniform(-1.2, 1.2, (300, 3))
    a, b, c = (both[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    bottom = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
    turns = np.arctan2(np.einsum("ijk,ijk->ij", a, np.cross(b, c)), bottom).sum(axis=1) / (2.0 * np.pi)
    assert turns == pytest.approx(np.round(turns), abs=1e-9)


def test_winding_numbers_of_open_surfaces_are_their_solid_angles():
    whole = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide().subdivide()
    bucket = np.asarray(whole.triangles)[whole.triangles_center[:, 2] < 0.4999]
    height = np.linspace(-0.9, 3.0, 50)
    way = np.abs(0.5 - height)
    lid = np.arcsin(0.25 / (0.25 + way**2)) / np.pi  # of the square that is missing, seen from its axis
    expected = np.where(np.abs(height) < 0.5, 1.0 - lid, np.where(height > 0.0, lid, -lid))
    found = Surface(bucket).winding(np.stack([0.0 * height, 0.0 * height, height], axis=1))
    assert found == pytest.approx(expected, abs=1e-3)


def test_no_piece_is_given_up_where_many_parts_cross():
    number, tooth = 21, (0.01, 1.5, 0.5)  # a comb of thin teeth through a plate
    teeth = [box(tooth, (0.08 * k - 0.8, 0.0, 0.0)) for k in range(number)]
    free, _, _ = free_parts(box((2.0, 2.0, 0.2), (0, 0, 0)), *teeth, spacing=0.04)
    whole = 2 * 4.0 + 4 * 2.0 * 0.2 + number * 2 * (0.01 * 1.5 + 0.01 * 0.5 + 1.5 * 0.5)
    hidden = number * (2 * 0.01 * 1.5 + 2 * 0.2 * (1.5 + 0.01))
    assert Surface.areas_of(free).sum() == pytest.approx(whole - hidden, rel=1e-12)


def test_folds_are_no_skin_of_their_own():
    plate = box((1.0, 1.0, 0.2), (0, 0, 0))
    flap = np.array([[[0.1, 0.1, 0.1], [0.3, 0.13, 0.1], [0.17, 0.32, 0.1]]])
    triangles = np.concatenate([plate.triangles, flap, flap[:, ::-1]])  # there and back again, over the face
    kept = touchable_parts(triangles, Surface(triangles), 0.05)
    assert np.array_equal(kept, triangles[:-1])


@pytest.mark.parametrize(("size", "stays"), [(0.004, False), (0.04, True)])
def test_pinholes_are_not_covered(size, stays):
    hole = box((size, size, size), (0.03, 0.02, 0.01))
    hole.invert()
    triangles = np.concatenate([box((1.0, 1.0, 1.0), (0, 0, 0)).triangles, hole.triangles])
    assert len(touchable_parts(triangles, Surface(triangles), 0.1)) == 12 + 12 * stays


def test_a_small_knob_on_a_plate_is_covered():
    triangles, _, _ = free_parts(box((1.0, 1.0, 0.2), (0, 0, 0)), box((0.004, 0.004, 0.004), (0.05, 0.02, 0.1)))
    assert np.array_equal(touchable_parts(triangles, Surface(triangles), 0.1), triangles)


def test_triangles_without_a_normal_are_left_out():
    plate = np.asarray(box((1.0, 1.0, 0.2), (0, 0, 0)).triangles)
    sliver = np.array([[[0.1, 0.1, 0.1], [0.4, 0.1, 0.1], [0.2, 0.1, 0.1 + 1e-12]]])
    triangles = np.concatenate([plate, sliver])
    assert np.array_equal(touchable_parts(triangles, Surface(plate), 0.05), plate)


def test_the_end_of_a_slit_is_no_skin():
    plate, lid = box((1.0, 1.0, 0.2), (0, 0, -0.1)), box((1.0, 0.8, 0.2), (0, 0, 0.1))
    slope, spacing = 1e-3, 0.05
    width = 0.005 * spacing
    lid.vertices[:, 2] += slope * (lid.vertices[:, 0] + 0.5) * (lid.vertices[:, 2] < 0.1)  # its underside; touches at one end
    triangles = np.concatenate([plate.triangles, lid.triangles])
    solid = Surface(triangles)
    kept = touchable_parts(free_triangles(triangles, solid, spacing)[0], solid, spacing)
    lost = plate.area + lid.area - Surface.areas_of(kept).sum()
    assert lost == pytest.approx(2 * 0.8 * width / slope, rel=0.05)
    middle = kept.mean(axis=1)
    assert np.mean(np.abs(winding_before(middle, Surface.normals_of(kept), solid, width / solid.unit)) > 0.5) < 0.02


def test_what_lies_open_beside_a_slit_stays():
    plate, lid = box((1.0, 1.0, 0.2), (0, 0, -0.1)), box((0.93, 0.93, 0.2), (0, 0, 0.1 + 1e-4))
    triangles = np.concatenate([plate.triangles, lid.triangles])
    kept = touchable_parts(triangles, Surface(triangles), 0.05)
    assert Surface.areas_of(kept).sum() == pytest.approx(plate.area + lid.area - 2 * 0.93**2, rel=0.01)


@pytest.mark.parametrize("seed", [1, 2])
def test_small_pieces_that_face_the_other_way_are_found(seed):
    grid = np.stack(np.meshgrid(np.arange(20), np.arange(20), [0]), -1).reshape(-1, 1, 3)
    plate = np.concatenate([grid + half for half in ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]])]) / 20
    flag = np.array([[0.0, 0.5, -0.02], [0.0, 0.503, -0.02], [0.003, 0.5, -0.02]])  # faces down, a few of all places fall on it
    flags = flag + np.linspace([0.1, 0, 0], [0.9, 0, 0], 12)[:, None]
    points, normals = spread_particles(Skin(np.concatenate([plate, flags])), 400, seed)
    below = points[normals[:, 2] < 0.0]
    away = np.linalg.norm(flags.mean(axis=1)[:, None] - below, axis=2).min(axis=1)
    assert away.max() < np.sqrt(2.0 / np.sqrt(3.0) / 400)


def test_overlapping_parts_with_a_whole_face_in_common_weigh_what_their_union_does():
    frustum = box((1.0, 1.0, 1.0), (0, 0, 0))
    frustum.vertices[frustum.vertices[:, 2] > 0.0] *= (0.5, 0.5, 1.0)
    short, long = (trimesh.creation.cylinder(0.1, height).apply_translation((2.0, 0, 0.5 * height)) for height in (0.5, 0.8))
    parts = [box((1.0, 1.0, 1.0), (0, 0, 0)), frustum, short, long]
    body = sample_body(trimesh.util.concatenate(parts), radius=0.05, count=300)
    assert body.volume == pytest.approx(1.0 + long.volume, rel=1e-9)
    assert body.steps["holes closed"] == body.steps["sheets"] == 0


@pytest.mark.parametrize("apart", [1e-7, 1e-6])
def test_a_part_that_is_there_twice_weighs_once(apart):
    ring, block = trimesh.creation.torus(1.0, 0.2), box((1.0, 0.6, 0.4), (3.0, 0, 0))
    twin = ring.copy().apply_translation((apart, 0.0, apart))
    body = sample_body(trimesh.util.concatenate([ring, twin, block]), 0.05, count=200)
    assert body.volume == pytest.approx(ring.volume + block.volume, rel=10.0 * apart)


@pytest.mark.parametrize("count", [20, 400])
def test_few_particles_do_not_make_the_mass_of_crossing_parts_worse(count):
    """A cylinder through a box: how finely triangles are cut must not depend on how many particles are wanted."""
    box, cylinder = trimesh.creation.box((1.0, 0.8, 0.6)), trimesh.creation.cylinder(0.2, 2.0)
    body = sample_body(trimesh.util.concatenate([box, cylinder]), radius=0.05, count=count)
    assert body.volume == pytest.approx(box.volume + cylinder.volume * (1.0 - 0.6 / 2.0), rel=1e-9)


def test_a_speck_gets_a_place_on_each_of_its_sides():
    plate, speck = box((1.0, 1.0, 0.1), (0, 0, 0)), box((1e-4, 1e-4, 1e-4), (0, 0, 1.0))
    skin = Skin(np.concatenate([plate.triangles, speck.triangles]))
    points, normals = skin.corners(0.05)
    on = points[:, 2] > 0.9
    assert np.count_nonzero(on) <= 12
    assert {tuple(normal) for normal in normals[on].round(6)} == {tuple(s * row) for s in (-1.0, 1.0) for row in np.eye(3)}
    assert np.allclose(skin.closest(points)[0], points, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("third", [0.0, 0.3, 1.0])
def test_corners_and_needles_have_places(third):
    """Gaps are widest at corners, which random places meet seldom, and slivers are met hardly at all."""
    needle = np.array([[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [third, 1e-4, 1.0]]])
    plate = box((1.0, 1.0, 0.1), (0, 0, 0))
    skin = Skin(np.concatenate([plate.triangles, needle]))
    points, normals = skin.corners(0.05)
    along = np.sort(points[points[:, 2] > 0.9, 0])
    assert np.diff(along, prepend=0.0, append=1.0).max() < 0.6 * 0.05
    for corner in (*needle[0], *plate.vertices):
        assert np.linalg.norm(points - corner, axis=1).min() < 0.6 * 0.05
    closest, face = skin.closest(points, up=normals)
    assert np.allclose(closest, points, rtol=0.0, atol=1e-6)
    assert np.allclose(skin.normals[face], normals)


def test_a_surface_that_crosses_itself_is_covered_and_weighs_all_that_it_encloses():
    ball = trimesh.creation.icosphere(4)
    twisted = ball.copy()
    twisted.vertices[:, 0] *= ball.vertices[:, 2] + 0.2
    z = np.linspace(-1.0, 1.0, 100_001)
    exact = np.trapezoid(np.abs(z + 0.2) * np.pi * (1.0 - z**2), z)
    body = sample_body(twisted, radius=0.05, count=800)
    assert body.volume == pytest.approx(exact, rel=0.01)
    assert any("inside out" in warning for warning in body.mass_warnings)
    assert body.area == pytest.approx(twisted.area, rel=0.01)
    before, triangles = body.points + 1e-3 * body.normals, np.asarray(twisted.triangles)
    assert np.mean(solid_angle_inside(triangles, before) | solid_angle_inside(triangles[:, ::-1], before)) < 0.01
