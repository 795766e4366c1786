"""Edits of a parsed scene."""

import pytest

from sand_sim.scene.types import SceneError
from sand_sim.study.choices import CHOICES
from sand_sim.study.variation import Edit, Facts, Variation, counted, repeated, springs, steps, times, to, where_given

FACTS = Facts(step=3e-5, contact=1e-3, frame=0.02, radius=0.005, mass=1e-3, grains=100)


def change(parsed, *edits):
    return Variation("", "", edits).apply(parsed, FACTS)


def test_edits_reach_all_entries_and_leave_the_original_alone():
    parsed = {"materials": {"a": {"young": "2e7"}, "b": {"young": 1e9}}}
    assert change(parsed, Edit("materials.*.young", times(0.1))) == {"materials": {"a": {"young": 2e6}, "b": {"young": 1e8}}}
    assert parsed["materials"]["a"]["young"] == "2e7"


def test_missing_mappings_are_made_only_where_something_is_put_in():
    assert change({}, Edit("solver.precision", to("double"))) == {"solver": {"precision": "double"}}
    assert change({"fills": [{}]}, Edit("solver.skin", times(2.0)), Edit("fills.*.shape", where_given("sphere"))) == {
        "fills": [{}]
    }
    assert change({"solver": None}, Edit("solver.precision", to("double"))) == {"solver": {"precision": "double"}}
    assert change({"solver": None}, Edit("solver.skin", times(2.0))) == {"solver": None}


@pytest.mark.parametrize(
    ("radius", "scaled"),
    [
        (0.01, 0.02),
        ({"uniform": [0.01, 0.02]}, {"uniform": [0.02, 0.04]}),
        ({"table": {"radii": [0.01], "weights": [3]}}, {"table": {"radii": [0.02], "weights": [3]}}),
    ],
)
def test_grains_of_all_size_distributions_are_scaled(radius, scaled):
    edits = Edit("fills.*.radius", times(2.0)), Edit("fills.*.count", counted(1 / 8))
    assert change({"fills": [{"radius": radius, "count": 80}]}, *edits) == {"fills": [{"radius": scaled, "count": 10}]}


def test_whole_steps_make_a_frame_and_none_is_longer_than_asked():
    for factor in (0.25, 0.5, 1.0, 2.0):
        step = change({}, Edit("solver.time_step", steps(factor)))["solver"]["time_step"]
        assert step <= factor * FACTS.step
        assert FACTS.frame / step == pytest.approx(round(FACTS.frame / step), abs=1e-9)
        assert step == pytest.approx(factor * FACTS.step, rel=0.01)


def test_linear_spring_makes_contacts_as_long_as_hertz():
    """An undamped spring k between two grains of mass m parts them after pi sqrt(m / 2k)."""
    stiffness = change({"pairs": [{}]}, Edit("pairs.*.stiffness", springs(1.0)))["pairs"][0]["stiffness"]
    assert 3.141592653589793 * (FACTS.mass / 2.0 / stiffness) ** 0.5 == pytest.approx(FACTS.contact)


def test_chance_changes_seeds_or_planes_and_nothing_else():
    plane = {"type": "plane", "point": [0, 0, 1], "normal": [0, 0, 2]}
    parsed = {"fills": [{"seed": 1}, {"file": "a.csv"}], "boundaries": [plane, {"type": "box", "low": [0, 0, 0]}]}
    assert repeated(parsed, 0, FACTS) == parsed
    first, second = repeated(parsed, 1, FACTS), repeated(parsed, 2, FACTS)
    assert first == repeated(parsed, 1, FACTS)
    assert len({parsed["fills"][0]["seed"], first["fills"][0]["seed"], second["fills"][0]["seed"]}) == 3
    assert first["fills"][1] == {"file": "a.csv"}
    assert first["boundaries"][1] == parsed["boundaries"][1]
    for changed in (first, second):
        shift = 1.0 - changed["boundaries"][0]["point"][2]
        assert 0.0 < shift < 1e-3 * FACTS.radius


def test_chance_moves_planes_where_there_are_only_bodies():
    parsed = {"bodies": {"ball": {}}, "boundaries": [{"type": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}]}
    assert repeated(parsed, 1, FACTS)["boundaries"][0]["point"][2] < 0.0
    assert repeated({"bodies": {"ball": {}}}, 1, FACTS) == {"bodies": {"ball": {}}}


def test_every_choice_has_several_settings_and_a_title_of_its_own():
    assert {one.group for one in CHOICES} == {
        "time step",
        "stiffness",
        "integrator",
        "precision",
        "contact law",
        "shape",
        "grain size",
        "skin",
    }
    assert len({one.title for one in CHOICES}) == len(CHOICES)
    assert {one.group for one in CHOICES if one.quick} == {one.group for one in CHOICES}


PLATE = {"type": "hole_plate", "point": [0, 0, 0], "normal": [0, 0, 2], "hole_radius": 0.01, "radius": 0.1}
BOX = {"type": "box", "low": [0, 0, 0], "high": [1, 1, 1]}
GROUND = {"type": "terrain", "mesh": "ground.stl", "particle_radius": 0.01}
TURNED = GROUND | {"pose": {"position": [0, 0, 0], "rpy": [0, 0, 1]}}
BACK = {  # how far each has moved away from grains above it, or inside of it [m]
    "hole_plate": lambda wall: [-wall["point"][2]],
    "box": lambda wall: [*(-c for c in wall["low"]), *(c - 1 for c in wall["high"])],
    "terrain": lambda wall: [-wall["pose"]["position"][2]],
}


@pytest.mark.parametrize("wall", [PLATE, BOX, GROUND, TURNED])
def test_chance_moves_other_walls_where_there_are_no_planes(wall):
    """Repeats of a bed from a file in a box were the same to the bit, and by chance alone nothing seemed to happen."""
    round_about = {"type": "cylinder", "point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.1}
    parsed = {"fills": [{"file": "bed.npz"}], "boundaries": [wall, round_about]}
    (first, other), (second, _) = (repeated(parsed, repeat, FACTS)["boundaries"] for repeat in (1, 2))
    assert first != second
    assert other == round_about
    assert first.get("pose", {}).get("rpy") == wall.get("pose", {}).get("rpy")
    for moved in (first, second):
        assert all(0.0 < way < 1e-3 * FACTS.radius for way in BACK[wall["type"]](moved))


def test_grains_of_files_are_not_made_larger():
    """The particles of tools alone grew, by which a bed from a file seemed to be as good with larger grains."""
    coarse = next(one for one in CHOICES if one.group == "grain size")
    tools = {"tools": {"plate": {"particle_radius": 0.002}}}
    for fills in ([{"file": "bed.npz"}], []):
        with pytest.raises(SceneError, match="fills: "):
            coarse.apply({"fills": fills} | tools, FACTS)
    mixed = coarse.apply({"fills": [{"file": "bed.npz"}, {"radius": 0.01, "count": 8}]} | tools, FACTS)
    assert mixed["fills"][1]["radius"] == pytest.approx(0.015)


def test_linear_springs_are_softer_where_materials_are():
    """Softer materials alone change nothing of a bed of linear springs."""
    soft = next(one for one in CHOICES if one.title == "stiffness: E x 0.1")
    parsed = {"materials": {"a": {"young": 1e9}}, "pairs": [{"stiffness": 2e4, "shear_stiffness": "1e4"}, {"friction": 0.5}]}
    assert soft.apply(parsed, FACTS) == {
        "materials": {"a": {"young": 1e8}},
        "pairs": [{"stiffness": 2e3, "shear_stiffness": 1e3}, {"friction": 0.5}],
    }
