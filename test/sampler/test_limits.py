"""What cannot be meant and what should be told, a little on either side of each limit."""

import numpy as np
import pytest
import trimesh

from sampler import MeshError
from sampler.body import Evenness
from sampler.limits import broken_limits, check_scale, check_thickness

CUBE = np.asarray(trimesh.creation.box((3.0, 4.0, 12.0)).triangles)  # 13 m across, of 192 m^2
EVEN = {"variation": 0.05, "nearest": 0.8, "farthest": 1.0, "coverage": 0.7, "skin_coverage": 0.8}


FINEST = np.sqrt(2.0 / np.sqrt(3.0) * 192.0 / 2e7)  # [m] of ten times as many particles as are made, in a triangular lattice


@pytest.mark.parametrize("what", ["radius", "spacing"])
def test_particles_of_a_thousand_diagonals_are_not_meant(what):
    check_scale(CUBE, **({"radius": 1.0, "spacing": 1.0} | {what: 12_999.0}))
    with pytest.raises(MeshError, match=r"are far larger than the mesh, 13 m across"):
        check_scale(CUBE, **({"radius": 1.0, "spacing": 1.0} | {what: 13_001.0}))


def test_nor_are_ten_times_as_many_as_are_made_or_such_as_single_precision_cannot_place():
    check_scale(CUBE, 1.0, 1.001 * FINEST)
    with pytest.raises(MeshError, match=r"a surface of 192 m\^2 would need 2e\+07 particles of radius 1 m"):
        check_scale(CUBE, 1.0, 0.999 * FINEST)
    bare = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1e-6, 0.0]]])
    check_scale(bare, 1.0, 1.001e-5)
    with pytest.raises(MeshError, match=r"9\.99e-06 m apart are far too fine for a mesh 1 m across"):
        check_scale(bare, 1.0, 0.999e-5)


@pytest.mark.parametrize(("radius", "limit"), [(0.1, 2.0), (1.5, 3.0)])
def test_sheets_are_no_thicker_than_the_mesh_or_its_particles(radius, limit):
    check_thickness(0.999 * limit, radius, 2.0)
    with pytest.raises(MeshError, match="thick cannot be meant in a mesh 2 m across"):
        check_thickness(1.001 * limit, radius, 2.0)


@pytest.mark.parametrize(
    ("name", "limit", "how"),
    [
        ("variation", 0.10, "at most"),
        ("nearest", 0.30, "at least"),
        ("farthest", 1.10, "at most"),
        ("coverage", 1.0, "at most"),
        ("skin_coverage", 1.10, "at most"),
    ],
)
def test_each_unevenness_is_told_beyond_its_limit(name, limit, how):
    for share in (0.99, 1.01):
        told = broken_limits(Evenness(**(EVEN | {name: share * limit})), 100, 100, 0.1, 1.0)
        assert len(told) == ((share > 1.0) == (how == "at most"))
    value = limit * (1.01 if how == "at most" else 0.99)
    told = broken_limits(Evenness(**(EVEN | {name: value})), 100, 100, 0.1, 1.0)
    assert told[0].endswith(f"in spacings: {name.replace('_', ' ')} {value:.2f} ({how} {limit:g})")
    single = broken_limits(Evenness(**(EVEN | {name: value})), 1, 1, 0.1, 1.0)
    assert len(single) == (name == "coverage"), "it has no neighbours"


def test_a_number_that_is_off_by_more_than_a_percent_and_by_more_than_one_is_told():
    even = Evenness(**EVEN)
    told = [broken_limits(even, number, wanted, 0.1, 1.0) for number, wanted in ((1010, 1000), (989, 1000), (11, 10), (12, 10))]
    assert told == [[], ["there are 989 particles where 1000 were wanted"], [], ["there are 12 particles where 10 were wanted"]]


def test_particles_of_half_a_diagonal_are_told():
    told = [broken_limits(Evenness(**EVEN), 100, 100, radius, 1.0) for radius in (0.49, 0.51)]
    assert told[0] == []
    assert told[1] == ["particles of radius 0.51 m are about as large as the mesh, 1 m across; check its scale"]
