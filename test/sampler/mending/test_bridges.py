"""Where a section of a thin ring is missing its ends are bridged; sockets that face one another and holes in plates are not."""

from itertools import combinations

import numpy as np
import pytest
import trimesh

from benchmarks.sampler_damage import damaged
from sampler.mass import integrate
from sampler.mending.bridges import bridge
from sampler.mending.caps import close_holes
from sampler.mending.repair import repair_mesh

TURN = trimesh.transformations.rotation_matrix(0.3, [1.0, 2.0, 3.0])


def ring(radius=0.07, sections=72):
    """A thin ring around the origin."""
    return trimesh.creation.torus(1.0, radius, major_sections=sections, minor_sections=14).apply_transform(TURN)


def rims(mesh, **options):
    """Corners of each hole."""
    faces = np.asarray(mesh.faces)
    return close_holes(np.asarray(mesh.vertices), faces, np.zeros(len(faces), int), **options).loops


def bridges(mesh):
    """How many holes fewer there are than rims."""
    return len(rims(mesh)) - len(rims(mesh, bridged=True))


@pytest.mark.parametrize("shape", [(0.07, 72), (0.1, 72), (0.07, 200)])
@pytest.mark.parametrize("place", range(4))
def test_a_missing_section_of_a_ring_comes_back(place, shape):
    whole = ring(*shape)
    broken = damaged(whole, "hole", place)
    assert bridges(broken) == 1
    mended = repair_mesh(broken)
    assert trimesh.Trimesh(mended.vertices, mended.faces, process=False).is_watertight
    volume, centre, inertia = integrate(mended.triangles)
    faces = np.asarray(broken.faces)
    caps = close_holes(broken.vertices, faces, np.zeros(len(faces), int)).faces
    apart = integrate(broken.vertices[np.concatenate([faces, caps])])
    assert whole.volume - volume < 0.5 * (whole.volume - apart[0])
    assert np.linalg.norm(centre) < 0.01
    assert np.linalg.norm(centre) < 0.3 * np.linalg.norm(apart[1])
    assert np.abs(inertia - whole.moment_inertia).max() < 0.02 * np.abs(whole.moment_inertia).max()


def test_a_large_gap_stays_open():
    whole = ring()
    away = np.linalg.norm(whole.triangles_center - TURN[:3, 0], axis=1)
    assert bridges(trimesh.Trimesh(whole.vertices, whole.faces[away > 0.8], process=False)) == 0


def test_sockets_that_face_one_another_stay_apart():
    # The prongs of a fork carry short tubes, which are open, and cut off in planes.
    whole = ring()
    angle = np.arctan2(*(whole.vertices @ TURN[:3, :3])[:, 1::-1].T)
    left = np.all(np.abs(angle)[whole.faces] > np.radians(7.4), axis=1)
    fork = trimesh.Trimesh(whole.vertices, whole.faces[left], process=False)
    assert len(rims(fork)) == 2
    assert bridges(fork) == 0


def test_a_hole_through_both_skins_of_a_plate_is_no_tunnel():
    plate = trimesh.creation.box((1.0, 1.0, 0.02))
    for _ in range(5):
        plate = plate.subdivide()
    broken = damaged(plate.apply_transform(TURN), "hole", 4)
    assert len(rims(broken)) == 2
    assert bridges(broken) == 0


@pytest.mark.parametrize("seed", range(5))
def test_no_other_triangles_that_advance_on_both_rims_alike_have_less_area(seed):
    random = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, 5, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    vertices = np.concatenate([circle, circle[3::-1] + [0.0, 0.0, 1.0]]) + random.uniform(-0.4, 0.4, (9, 3))
    loop, triangles = bridge(vertices, np.arange(5), np.arange(5, 9))
    a, back = loop[:6], loop[:5:-1]

    def area(corners):
        return np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / 2.0

    def shares(path):
        along = np.cumsum([0.0, *np.linalg.norm(np.diff(vertices[path], axis=0), axis=1)])
        return along / along[-1]

    first, second, least = shares(a), shares(back), np.inf
    most = max(0.25, np.diff(first).max(), np.diff(second).max())
    for steps in combinations(range(9), 5):  # of nine those that go on along the first rim
        i, total = 0, 0.0
        for k in range(9):
            total += area(vertices[[a[i], back[k - i], a[i + 1] if k in steps else back[k - i + 1]]])
            i += k in steps
            if abs(first[i] - second[k + 1 - i]) > most:
                total = np.inf
        least = min(least, total)
    assert sum(area(vertices[corners]) for corners in triangles) == pytest.approx(least, rel=1e-12)
