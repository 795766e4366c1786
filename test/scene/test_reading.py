"""Scene files: what is read, and that every refusal names its field."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from good_scene import GOOD, changed
from scenes import write_small_scene

from sand_sim import SceneError, World, load_scene, read_scene
from sand_sim.config_folder import config_folder, find_scene
from sand_sim.scene.types import Fill, SizeDistribution

STONE = {"spheres": [[0.0, 0.0, 0.0, 0.01]], "material": "sand", "pose": {"position": [0.0, 0.0, 0.1]}}


def test_good_scene_is_read():
    scene = read_scene(copy.deepcopy(GOOD), Path.cwd())
    assert scene.materials[0].young == 1e7  # YAML reads 1e7 as text
    assert scene.pair("sand", "steel").numbers["friction"] == 0.2
    assert scene.gravity == (0.0, 0.0, -9.81)
    assert scene.tool("spade").scale == 1.0


def test_all_that_a_fill_tells_is_read():
    region = {"low": [0.0, 0.1, 0.2], "high": [0.3, 0.4, 0.5]}
    entry = {"name": "bed", "material": "Coarse Sand", "radius": 0.004, "region": region, "height": 0.05}
    entry |= {"shape": "tetrahedron", "velocity": [0.1, -0.2, 0.3], "seed": 7}
    parsed = changed(("fills", 0), entry)
    parsed["materials"]["Coarse Sand"] = parsed["materials"].pop("sand")
    parsed["pairs"] = yaml.safe_load(yaml.safe_dump(parsed["pairs"]).replace("- sand", "- Coarse Sand"))
    size = SizeDistribution("constant", mean=0.004)
    expected = Fill(
        "bed",
        "Coarse Sand",
        "tetrahedron",
        size,
        (0.0, 0.1, 0.2),
        (0.3, 0.4, 0.5),
        height=0.05,
        velocity=(0.1, -0.2, 0.3),
        seed=7,
    )
    assert read_scene(parsed, Path.cwd()).fills == (expected,)


def test_a_tool_meets_all_grains():
    """Of the boundary's material or not."""
    parsed = changed(("boundaries",), [])
    parsed["pairs"].pop(1)
    with pytest.raises(SceneError, match="pairs: no entry for 'sand' and 'steel', which can meet"):
        read_scene(parsed, Path.cwd())


def test_the_twist_of_mindlins_law_goes_with_it():
    contact = {"twisting": "marshall", "tangential": "mindlin"}
    assert read_scene(changed(("contact",), contact), Path.cwd()).contact.twisting == "marshall"


@pytest.mark.parametrize(("low", "high", "fits"), [(-0.1, 0.1, True), (0.1, 0.2, False)])
def test_the_height_of_a_fill_is_that_above_its_region(low, high, fits):
    region = {"low": [0.0, 0.0, low], "high": [0.1, 0.1, high]}
    parsed = changed(("fills", 0), {"name": "bed", "material": "sand", "radius": 0.004, "region": region, "height": 0.15})
    if fits:
        assert read_scene(parsed, Path.cwd()).fills[0].height == 0.15
        return
    with pytest.raises(SceneError, match=r"'bed' height 0.15 m does not fit its region; raise region.high\[2\] above 0.25"):
        read_scene(parsed, Path.cwd())


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (("materials", "sand", "density"), -1.0, "materials.sand.density: must be greater than 0 [kg/m^3], got -1"),
        (("materials", "sand", "poisson"), 0.7, "materials.sand.poisson: must be at least"),
        (("materials", "sand", "young"), "stiff", "materials.sand.young: must be a number [Pa], got 'stiff'"),
        (("materials", "sand", "young"), 10**400, "materials.sand.young: must be a number [Pa], got 1000"),
        (
            ("materials", "sand", "young"),
            1e300,
            "materials.sand.young: must be between 1e-30 and 1e+30 in size, or 0, got 1e+300",
        ),
        (("materials", "sand", "density"), 1e-300, "materials.sand.density: must be between 1e-30 and 1e+30 in size, or 0"),
        (("materials", "sand", "yuong"), 1.0, "materials.sand: unknown field 'yuong'; did you mean 'young'?"),
        (("materials", "sand", "density"), None, "materials.sand: the field 'density' is missing"),
        (("pairs", 0, "friction"), -0.1, "pairs[0].friction: must be at least 0, got -0.1"),
        (("pairs", 0, "restitution"), 0, "pairs[0].restitution: must be greater than 0"),
        (("pairs", 1), {"between": ["sand", "ice"], "restitution": 1, "friction": 1}, "pairs: unknown material 'ice'"),
        (("name",), "beds/wet", "name: becomes the name of files: without '/' and not beginning with '.', got 'beds/wet'"),
        (("name",), "..", "name: becomes the name of files"),
        (("pairs",), [GOOD["pairs"][0]], "pairs: no entry for 'sand' and 'steel'"),
        (("fills", 0, "radius"), -0.005, "fills[0].radius: must be greater than 0 [m]"),
        (("fills", 0, "radius"), {"uniform": [0.2, 0.1]}, "fills[0].radius: radii must be positive and in order"),
        (
            ("fills", 0, "radius"),  # (erf(3/sqrt(2)) - erf(2.4/sqrt(2))) / 2
            {"normal": {"mean": 0.003, "deviation": 1e-4, "low": 0.00324, "high": 0.0033}},
            "of a mean of 0.003 and a deviation of 0.0001 only 0.0068 lie between 0.00324 and 0.0033 [m], at least 0.01 must",
        ),
        (
            ("fills", 0, "radius"),
            {"normal": {"mean": 0.003, "deviation": 1e-4, "low": 0.004, "high": 0.005}},
            "fills[0].radius.normal: of a mean of 0.003 and a deviation of 0.0001 only 0 lie between 0.004 and 0.005 [m]",
        ),
        (
            ("fills", 0, "radius"),
            {"normal": {"mean": 0.003, "deviation": 1e-4, "low": 0.003, "high": 0.003}},
            "fills[0].radius.normal: of a mean of 0.003",
        ),
        (
            ("fills", 0, "radius"),
            {"normal": {"mean": 0.003, "deviation": 0.0, "low": 0.004, "high": 0.005}},
            "fills[0].radius.normal: of a mean of 0.003",
        ),
        (("fills", 0, "count"), 2.5, "fills[0].count: must be a whole number"),
        (("fills", 0, "height"), 0.05, "fills[0]: give exactly one of 'count', 'height' and 'file'"),
        (("fills", 0, "material"), "gravel", "unknown material 'gravel'"),
        (("tools", "spade", "material"), "gravel", "tools: 'spade' is of unknown material 'gravel'; known are sand, steel"),
        (("bodies",), {"stone": STONE | {"material": "gravel"}}, "bodies: 'stone' is of unknown material 'gravel'"),
        (("bodies",), {"stone": STONE | {"material": "steel"}}, "pairs: no entry for 'steel' and 'steel', which can meet"),
        (
            ("pairs",),
            [*GOOD["pairs"], GOOD["pairs"][1] | {"between": ["sand", "steel"]}],
            "pairs: sand and steel are given twice",
        ),
        (
            ("contact",),
            {"twisting": "marshall", "tangential": "none"},
            "contact.twisting: 'marshall' is the twist of Mindlin's",
        ),
        (("fills", 0, "region", "high"), [0.1, 0.1, -0.1], "fills[0].region: 'low'"),
        (("boundaries", 0, "type"), "sphere", "boundaries[0].type: unknown 'sphere'; known are plane, box, bin, cylinder"),
        (
            ("fills", 0, "radius"),
            {"normal": {"mean": 0.003, "deviation": 0.002}},
            "fills[0].radius.normal: is cut two deviations below the mean, at -0.001 m, which is no radius; give a 'low'",
        ),
        (
            ("fills", 0),
            {"material": "sand", "file": "bed.npz", "seed": 1},
            "fills[0].seed: has no effect on grains from a file, which says where and how large they are; leave it out",
        ),
        (("boundaries", 0, "normal"), [0, 0, 0], "boundaries[0].normal: must not be the zero vector"),
        (("boundaries", 0, "normal"), [0, 0, float("nan")], "boundaries[0].normal[2]: must be finite"),
        (("tools", "spade", "particle_radius"), 0, "tools.spade.particle_radius: must be greater than 0"),
        (("tools", "spade", "sheets"), "some", "tools.spade.sheets: unknown 'some'; known are auto, never, always"),
        (
            ("tools", "spade", "pose"),
            {"orientation": [0, 0, 0, 0]},
            "tools.spade.pose.orientation: must not be the zero quaternion",
        ),
        (("tools", "spade", "trajectory"), [{"time": 1}, {"time": 1}], "tools.spade.trajectory[1].time: must be later"),
        (
            ("tools", "spade", "trajectory"),
            [{"time": 0, "rpy": [0, 0, 0]}, {"time": 1, "rpy": [0, 6.2832, 0]}],
            "tools.spade.trajectory[1].rpy: is half a turn or more from [0.0, 0.0, 0.0] [rad] at the waypoint before",
        ),
        (
            ("tools", "spade", "trajectory"),
            [{"time": 1, "spin": [0, 0, 1]}],
            "tools.spade.trajectory[0]: a motion begins at the waypoint before",
        ),
        (
            ("tools", "spade", "trajectory"),
            [{"time": 0}, {"time": 1, "spin": [0, 1e9, 0]}],
            "tools.spade.trajectory[1].spin: must be at most 100000 [rad/s]",
        ),
        (
            ("tools", "spade", "trajectory"),
            [{"time": 0}, {"time": 1, "velocity": [0, 0, 1], "rpy": [0, 0, 0]}],
            "tools.spade.trajectory[1]: give either a pose (position, orientation, rpy) or a motion",
        ),
        (
            ("tools", "spade", "trajectory"),
            [{"time": 0}, {"time": 1, "oscillation": {"amplitude": [0, 0, 0], "frequency": 1}}],
            "tools.spade.trajectory[1].oscillation.amplitude: must not be the zero vector",
        ),
        (
            ("tools", "spade", "trajectory"),
            [{"time": 0}, {"time": 1, "oscillation": {"amplitude": [0, 0, 1e-3], "frequency": 0}}],
            "tools.spade.trajectory[1].oscillation.frequency: must be greater than 0 and at most 1000 [Hz]",
        ),
        (
            ("tools", "spade", "pose"),
            {"orientation": [0, 0, 0, 1], "rpy": [0, 1, 0]},
            "tools.spade.pose: give only one of 'orientation' and 'rpy'",
        ),
        (
            ("tools", "spade", "pose"),
            {"rpy": [0, 90, -45]},
            "tools.spade.pose.rpy: is in radians, and [0.0, 90.0, -45.0] is more than a whole turn; in degrees it would be "
            "[0.0, 1.5708, -0.7854]",
        ),
        (("tools", "spade", "trajectory"), [{"time": 0, "rpy": [0, 30, 0]}], "tools.spade.trajectory[0].rpy: is in radians"),
        (("tools", "my spade"), GOOD["tools"]["spade"], "tools.my spade: a tool's name becomes part of its topics"),
        (("tools", "sch\u00fcrfe"), GOOD["tools"]["spade"], "a tool's name becomes part of its topics"),
        (("contact",), {"normal": "hertzz"}, "contact.normal: unknown 'hertzz'; known are"),
        (("solver",), {"time_step": -1}, "solver.time_step: must be greater than 0 [s]"),
        (("solver",), {"threads": 1e9}, "solver.threads: must be at least 1 and at most 4096, got 1e+09"),
        (("solver",), {"precision": "half"}, "solver.precision: unknown 'half'"),
        (("gravity",), [0, 0], "gravity: must be a list of 3 numbers"),
        (("domain",), {"low": [0, 0, 0], "high": [0.05, 1, 1]}, "domain: must contain the region of fill"),
        (("liquid",), {"surface_tension": 0.07}, "liquid: give exactly one of 'saturation' of the pores and 'bridge_volume'"),
        (("liquid",), {"bridge_volume": 0.5}, "liquid.bridge_volume: must be greater than 0 and at most 0.279"),
        (("frame_rate",), 0, "frame_rate: must be greater than 0"),
        (("fills",), [], "fills: at least one fill, or one of 'bodies', is needed"),
    ],
)
def test_refusals_name_the_field_and_the_fix(path, value, named):
    with pytest.raises(SceneError) as caught:
        read_scene(changed(path, value), Path.cwd())
    assert named in str(caught.value)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("a: [1, 2", "is not valid YAML"),
        ("- 1\n- 2", "must be a mapping"),
        ("", "must be a mapping"),
        ("\x00", "is not valid YAML"),
        ("name: 2026-13-45", "is not valid YAML: month must be in 1..12"),
        ("name: !!timestamp tomorrow", "is not valid YAML"),
        (f"duration: {'9' * 5000}", "is not valid YAML"),
        ("[" * 5000, "is not valid YAML"),
        ("tools:\n  spade: {}\n  spade: {}", "'spade' is there twice in line 3, column 3"),
        ("duration: 1\nname: a\nduration: 2", "'duration' is there twice in line 3, column 1"),
    ],
)
def test_unreadable_files_are_refused_in_one_line(tmp_path, content, named):
    path = tmp_path / "scene.yaml"
    path.write_text(content)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert named in str(caught.value)
    assert "scene.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_is_refused(tmp_path, monkeypatch):
    with pytest.raises(SceneError, match="No such file"):
        load_scene(tmp_path / "nothing.yaml")
    with pytest.raises(SceneError, match="the package's own scenes are"):
        find_scene("nothing")
    with pytest.raises(SceneError, match=r"'typo/dig\.yaml': there is no such file"):
        find_scene("typo/dig.yaml")
    monkeypatch.chdir(tmp_path)  # where no file of the user's own bears a name of ours
    for name in ("dig.yaml", "config/dig.yaml", "./dig"):
        with pytest.raises(
            SceneError, match=f"scene '{name}': there is no such file in {tmp_path}; the package's own scenes are"
        ):
            find_scene(name)
    with pytest.raises(SceneError, match=r"'~nobody/dig\.yaml': there is no such file"):
        find_scene("~nobody/dig.yaml")
    (tmp_path / "mine.v2.yaml").write_text("")
    with pytest.raises(SceneError, match=r"there is no such file in .*; is 'mine\.v2\.yaml' meant\?"):
        find_scene("mine.v2")
    assert find_scene("mine.v2.yaml").resolve() == tmp_path / "mine.v2.yaml"
    assert find_scene("dig").name == "dig.yaml"


def test_a_scene_without_a_name_has_that_of_its_file(tmp_path):
    for written, name in (({}, "two buckets"), ({"name": "other"}, "other")):
        (tmp_path / "two buckets.yaml").write_text(yaml.safe_dump(GOOD | written))
        assert load_scene(tmp_path / "two buckets.yaml").name == name


def test_orientation_may_be_given_as_roll_pitch_yaw():
    tool = GOOD["tools"]["spade"] | {"pose": {"rpy": [0.0, 0.0, np.pi / 2]}}
    scene = read_scene(changed(("tools", "spade"), tool), Path.cwd())
    assert scene.tool("spade").pose.orientation == pytest.approx((0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))


def test_a_waypoint_stays_where_the_one_before_is_unless_it_says_otherwise():
    """A tool that should only turn, or only go on, went to the origin or turned back."""
    quarter = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    way = [
        {"time": 0},
        {"time": 1, "rpy": [0, 0, np.pi / 2]},
        {"time": 2, "position": [3, 2, 2]},
        {"time": 3, "orientation": [0, 0, 0, 1]},
    ]
    spade = GOOD["tools"]["spade"] | {"pose": {"position": [1, 2, 2]}, "trajectory": way}
    poses = [stop.pose for stop in read_scene(changed(("tools", "spade"), spade), Path.cwd()).tool("spade").trajectory]
    assert [pose.position for pose in poses] == [(1, 2, 2), (1, 2, 2), (3, 2, 2), (3, 2, 2)]
    turns = np.array([pose.orientation for pose in poses])
    np.testing.assert_allclose(turns, [(0, 0, 0, 1), quarter, quarter, (0, 0, 0, 1)], atol=1e-12)


def test_a_waypoint_goes_on_from_where_a_motion_ends():
    way = [
        {"time": 1, "position": [1, 2, 3]},
        {"time": 3, "velocity": [1, 0, 0], "spin": [0, 0, 2.25 * np.pi]},
        {"time": 3.25, "oscillation": {"amplitude": [0, 0, 0.5], "frequency": 1}},
        {"time": 4, "velocity": [0, 1, 0]},
        {"time": 5, "rpy": [0, 0, 6]},
    ]
    spade = GOOD["tools"]["spade"] | {"trajectory": way}
    poses = [stop.pose for stop in read_scene(changed(("tools", "spade"), spade), Path.cwd()).tool("spade").trajectory]
    places = np.array([pose.position for pose in poses])
    np.testing.assert_allclose(places, [(1, 2, 3), (3, 2, 3), (3, 2, 3.5), (3, 2.75, 3.5), (3, 2.75, 3.5)], atol=1e-12)
    half = np.array([0.0, 2.25 * np.pi, 2.25 * np.pi, 2.25 * np.pi, 3.0])
    meant = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=1)
    turns = np.array([pose.orientation for pose in poses])
    np.testing.assert_allclose(np.abs((turns * meant).sum(axis=1)), 1.0, atol=1e-12)


@pytest.mark.parametrize(("times", "lasts"), [((0.0, 4.0), 4.0), ((0.0,), 1.0)])
def test_a_scene_lasts_to_the_last_waypoint(times, lasts):
    trajectory = [{"time": time, "position": [0.0, 0.0, time]} for time in times]
    assert read_scene(changed(("tools", "spade", "trajectory"), trajectory), Path.cwd()).duration == lasts


@pytest.mark.parametrize("path", sorted(config_folder().glob("*.yaml")), ids=lambda path: path.stem)
def test_own_scenes_are_good(path):
    assert load_scene(path).name == yaml.safe_load(path.read_text())["name"]


@pytest.mark.parametrize(
    ("change", "named"),
    [({"fills": ()}, "fills: at least one fill"), ({"pairs": ()}, "pairs: no entry for 'sand' and 'sand'")],
)
def test_a_scene_that_was_changed_in_python_is_checked_again(tmp_path, change, named):
    with pytest.raises(SceneError, match=named):
        World(replace(load_scene(write_small_scene(tmp_path)), **change))


def test_a_pair_that_nothing_needs_may_lack_numbers(tmp_path):
    """A steel that nothing is made of, with a rule from another scene; the world is made and steps."""
    parsed = changed(("tools",), None)
    parsed["materials"]["ice"] = parsed["materials"]["steel"]
    parsed["pairs"] += [{"between": ["sand", "ice"], "restitution": 0.5}, {"between": ["ice", "ice"]}]
    for pair in parsed["pairs"][:2]:
        pair["rolling_friction"] = 0.1
    world = World(read_scene(parsed | {"contact": {"rolling": "spring"}}, tmp_path))
    world.step(1)
    assert world.steps == 1
