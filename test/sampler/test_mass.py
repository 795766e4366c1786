"""Volume, centre and inertia: of surfaces that close, exactly, and of others by what lies inside of them."""

import numpy as np
import pytest
import trimesh

from sampler import sample_body
from sampler.geometry.surface import Surface
from sampler.mass import count_inside, integrate, is_physical, joined, openness, principal_axes


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


def test_the_inertia_of_needles_about_their_length_is_exact():
    for sections in (6, 24):
        radius, step = 5e-4, 2.0 * np.pi / sections
        volume, _, inertia = integrate(np.asarray(trimesh.creation.cylinder(radius, 1.0, sections=sections).triangles))
        area = 0.5 * sections * radius**2 * np.sin(step)
        assert volume / area == pytest.approx(1.0, abs=1e-13)
        assert inertia[2, 2] / (area * radius**2 * (2.0 + np.cos(step)) / 6.0) == pytest.approx(1.0, abs=1e-13)


def test_principal_axes_are_a_right_handed_rotation():
    random = np.random.default_rng(4)
    for _ in range(20):
        turn = trimesh.transformations.random_rotation_matrix(random.random(3))[:3, :3]
        inertia = turn @ np.diag([1.0, 2.0, 2.5]) @ turn.T
        moments, axes = principal_axes(inertia)
        assert moments == pytest.approx([1.0, 2.0, 2.5])
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert axes @ np.diag(moments) @ axes.T == pytest.approx(inertia)


def test_what_no_solid_can_be_is_told_from_what_one_can():
    """A box of edges a, b, c about its middle: V (b^2 + c^2)/12 and so on."""
    low, high = np.zeros(3), np.array([1.0, 2.0, 3.0])
    moments = 6.0 * np.array([13.0, 10.0, 5.0]) / 12.0
    assert is_physical(6.0, 0.5 * high, np.diag(moments), low, high)
    assert not is_physical(6.0, 0.5 * high, np.diag([1.0, 1.0, 2.1]), low, high)  # more about one axis than about both others
    assert not is_physical(6.0, 0.5 * high, np.diag([-1.0, 5.0, 5.0]), low, high)
    assert not is_physical(6.0, high + [0.1, 0.0, 0.0], np.diag(moments), low, high)  # the centre lies outside
    assert not is_physical(6.1, 0.5 * high, np.diag(moments), low, high)  # more than fits in
    assert not is_physical(-6.0, 0.5 * high, np.diag(moments), low, high)
    assert not is_physical(np.nan, 0.5 * high, np.diag(moments), low, high)


def test_surfaces_that_close_are_told_from_others():
    mesh = cone()
    assert openness(np.asarray(mesh.triangles)) < 1e-12
    assert openness(np.asarray(mesh.triangles)[: len(mesh.faces) // 2]) > 0.1


@pytest.mark.parametrize("apart", [1e3, 1e4])
def test_parts_far_apart_weigh_no_less_exactly(apart):
    ball, far = trimesh.creation.icosphere(3), trimesh.creation.icosphere(2)
    parts = [integrate(np.asarray(mesh.triangles))[0] for mesh in (ball, far)]
    far.apply_translation((apart, 0.3 * apart, 0.1 * apart))
    volume, centre, _ = integrate(np.asarray(trimesh.util.concatenate([ball, far]).triangles))
    assert volume == pytest.approx(sum(parts), rel=1e-10)
    assert centre == pytest.approx(np.array([1.0, 0.3, 0.1]) * apart * parts[1] / sum(parts), rel=1e-10)


@pytest.mark.parametrize(
    ("edge", "height", "added"),
    [
        pytest.param(0.8, 0.5, 0.03, id="large on the solid"),
        pytest.param(0.3, 0.5, 0.03, id="small on the solid"),
        pytest.param(0.3, 0.51, 0.04, id="half sunk"),
        pytest.param(0.3, 0.6, 0.06, id="apart"),
    ],
)
def test_of_a_sheet_counts_what_is_outside_of_solids(edge, height, added):
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * edge
    sheet = trimesh.Trimesh(np.column_stack([corners, np.full(4, height)]), [[0, 1, 2], [0, 2, 3]])
    body = sample_body(trimesh.util.concatenate([trimesh.creation.box((1.0, 1.0, 1.0)), sheet]), 0.03, count=800)
    volume = added * edge**2
    middle = 0.5 + added / 2.0 if added < 0.06 else height
    assert body.volume == pytest.approx(1.0 + volume, abs=0.01 * volume)
    assert body.centre == pytest.approx([0.0, 0.0, volume * middle / (1.0 + volume)], abs=0.01 * volume)
    within = edge**2 + added**2, 2.0 * edge**2  # of the plate about its centre, over a twelfth of its volume
    lever = middle**2 / (1.0 + volume)
    expected = [1.0 / 6.0 + volume * (within[0] / 12.0 + lever)] * 2 + [1.0 / 6.0 + volume * within[1] / 12.0]
    assert body.inertia == pytest.approx(np.diag(expected), abs=0.01 * volume)
    assert any("sheets reach into solids" in warning for warning in body.mass_warnings) == (edge > 0.5)  # 1 % of the whole


def test_sheets_that_overlap_more_than_fits_in_are_counted_from_inside():
    """Eight sheets, each six times as thick as they are apart, beside a plate: 0.13 high together, not 0.48."""
    plate = trimesh.creation.box((1.0, 1.0, 0.02)).apply_translation([0.0, 0.0, -0.05])
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    sheets = [trimesh.Trimesh(np.column_stack([corners, np.full(4, 0.01 * k)]), [[0, 1, 2], [0, 2, 3]]) for k in range(8)]
    body = sample_body(trimesh.util.concatenate([plate, *sheets]), 0.03, count=800)
    assert body.volume == pytest.approx(0.13 + 0.02, rel=0.02)
    assert any("sheets overlap" in warning for warning in body.mass_warnings)


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
