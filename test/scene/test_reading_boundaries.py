"""Boundaries in scene files: what is read, and that every refusal names its field."""

from math import inf, pi, tan
from pathlib import Path

import pytest
from good_scene import changed

from sand_sim import SceneError, read_scene

CONE = {"type": "cone", "material": "steel", "point": [0, 0, 0], "axis": [0, 0, 1], "hole_radius": 0.01, "radius": 0.05}
PLUNGER = {"type": "plunger", "material": "steel", "point": [0, 0, 1], "normal": [0, 0, -1]}
TERRAIN = {"type": "terrain", "material": "steel", "particle_radius": 0.002}
CYLINDER = {"type": "cylinder", "material": "steel", "point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.05}


def read(entry):
    return read_scene(changed(("boundaries", 0), entry), Path("/scenes")).boundaries[0]


def test_what_is_read():
    assert read(CONE | {"angle": pi / 6}).height == pytest.approx(0.04 / tan(pi / 6))
    assert read(CONE | {"height": 0.02}).height == 0.02
    assert read(CYLINDER).height == 0.0
    assert not read(CYLINDER | {"height": 0.1, "grains": "inside"}).around
    assert read(CONE | {"height": 0.1, "grains": "outside"}).around
    assert read(CYLINDER | {"rough": {"radius": 0.002}}).rough.spacing == 0.004
    driven = read(PLUNGER | {"velocity": -0.1, "travel": 0.02}).drive
    assert (driven.velocity, driven.force, driven.travel) == (-0.1, None, 0.02)
    pressed = read(PLUNGER | {"force": 10, "max_speed": 1, "radius": 0.04})
    assert (pressed.drive.force, pressed.drive.mass, pressed.drive.travel, pressed.radius) == (10.0, None, inf, 0.04)
    ground = read(TERRAIN | {"heights": "hill.csv", "spacing": 0.01}).terrain
    assert (ground.heights, ground.spacing, ground.scale) == (Path("/scenes/hill.csv"), 0.01, 1.0)


def test_plungers_and_terrains_need_names_of_their_own():
    """They are known by name where their motion and forces are shown."""
    parsed = changed(("boundaries",), [PLUNGER | {"velocity": 0.1}, PLUNGER | {"velocity": 0.2}])
    with pytest.raises(SceneError, match="'plunger' is the name of several; give the plunger a 'name' of its own"):
        read_scene(parsed, Path.cwd())
    hill = TERRAIN | {"heights": "hill.csv", "spacing": 0.01}
    with pytest.raises(SceneError, match="'terrain' is the name of several; give the terrain a 'name' of its own"):
        read_scene(changed(("boundaries",), [hill, hill]), Path.cwd())


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        (CONE, "boundaries[0]: give exactly one of 'height' [m] and 'angle' [rad]"),
        (CONE | {"height": 0.1, "angle": 0.5}, "boundaries[0]: give exactly one of 'height'"),
        (CONE | {"height": 0}, "boundaries[0].height: must be greater than 0 [m]"),
        (CONE | {"angle": 45}, "boundaries[0].angle: must be less than pi/2 [rad], got 45"),
        (CONE | {"height": 0.1, "hole_radius": 0.05}, "boundaries[0].hole_radius: must be less than 'radius', 0.05 m"),
        (CONE | {"height": 0.1, "hole_radius": -1}, "boundaries[0].hole_radius: must be at least 0 [m]"),
        (CONE | {"height": 0.1, "hole": 0.01}, "boundaries[0]: unknown field 'hole'"),
        (CONE | {"height": 0.1, "velocity": 1}, "boundaries[0]: unknown field 'velocity'"),
        (CONE | {"height": 0.1, "axis": [0, 0, 0]}, "boundaries[0].axis: must not be the zero vector"),
        (CYLINDER | {"grains": "outside"}, "boundaries[0].grains: 'outside' needs a 'height' [m]"),
        (CYLINDER | {"height": 1, "grains": "out"}, "boundaries[0].grains: unknown 'out'; known are inside, outside"),
        (CYLINDER | {"height": -1}, "boundaries[0].height: must be greater than 0 [m]"),
        (CYLINDER | {"rough": {"spacing": 0.01}}, "boundaries[0].rough: the field 'radius' is missing"),
        (CYLINDER | {"rough": {"radius": 0.0}}, "boundaries[0].rough.radius: must be greater than 0 [m]"),
        (
            CYLINDER | {"rough": {"radius": 1, "lattice": "cubic"}},
            "boundaries[0].rough.lattice: unknown 'cubic'; known are",
        ),
        (PLUNGER, "boundaries[0]: give exactly one of 'velocity' [m/s] and 'force' [N]"),
        (PLUNGER | {"velocity": 1, "force": 1}, "boundaries[0]: give exactly one of 'velocity'"),
        (PLUNGER | {"velocity": [0, 0, 1]}, "boundaries[0].velocity: must be a number [m/s]"),
        (PLUNGER | {"velocity": 1, "mass": 1}, "boundaries[0].mass: goes with 'force'"),
        (PLUNGER | {"force": 1}, "boundaries[0]: the field 'max_speed' [m/s] is missing"),
        (PLUNGER | {"force": 1, "max_speed": 0}, "boundaries[0].max_speed: must be greater than 0 and at most 10000 [m/s]"),
        (PLUNGER | {"force": 1, "max_speed": 1e5}, "boundaries[0].max_speed: must be greater than 0 and at most 10000 [m/s]"),
        (PLUNGER | {"velocity": -1e5}, "boundaries[0].velocity: must be at least -10000 and at most 10000 [m/s]"),
        (PLUNGER | {"force": 1, "max_speed": 1, "mass": 0}, "boundaries[0].mass: must be greater than 0 [kg]"),
        (PLUNGER | {"velocity": 1, "travel": 0}, "boundaries[0].travel: must be greater than 0 [m]"),
        (TERRAIN, "boundaries[0]: give exactly one of 'mesh' and 'heights'"),
        (TERRAIN | {"heights": "a.npz"}, "boundaries[0]: the field 'spacing' [m], of the grid of heights, is missing"),
        (
            TERRAIN | {"heights": "a.tif", "spacing": 1},
            "boundaries[0].heights: must be a file of type .npz, .csv, .png",
        ),
        (TERRAIN | {"mesh": "a.stl", "spacing": 1}, "boundaries[0].spacing: goes with 'heights'"),
        (TERRAIN | {"mesh": "a.stl", "particle_radius": 0}, "boundaries[0].particle_radius: must be greater than 0 [m]"),
        (TERRAIN | {"mesh": "a.stl", "rough": {}}, "boundaries[0]: unknown field 'rough'"),
        (
            TERRAIN | {"mesh": "a.stl", "speed": 1},
            "boundaries[0]: unknown field 'speed'; known fields are type, material, name, particle_radius, mesh, heights",
        ),
        (TERRAIN | {"heights": "a.csv", "spacing": 1, "thickness": 0.1}, "boundaries[0].thickness: goes with 'mesh'"),
        ({"typ": "plane", "material": "steel"}, "boundaries[0]: unknown field 'typ'; did you mean 'type'?"),
    ],
)
def test_refusals_name_the_field_and_the_fix(entry, named):
    with pytest.raises(SceneError) as caught:
        read(entry)
    assert named in str(caught.value)
