"""Changing a scene file in its place."""

import pytest
import yaml

from sand_sim.study.scene_writing import change_text, write_scene

TEXT = """# A scene.
name: one  # its name

materials:
  sand: {density: 2600, young: 2.0e7}   # soft
  steel: {density: 7800}

fills:
  - name: bed
    radius: {uniform: [0.006, 0.0072]}
    seed: 1

# What is left.
settle: {time: 0.6}
solver:
  threads: 1

  # Nothing more.
duration: 4.2
"""


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (("materials", "sand", "young"), 2e6, "  sand: {density: 2600, young: 2000000.0}   # soft"),
        (("materials", "steel", "young"), 1e9, "  steel: {density: 7800, young: 1000000000.0}"),
        (("fills", 0, "radius"), {"uniform": [0.01, 0.02]}, "    radius: {uniform: [0.01, 0.02]}"),
        (("fills", 0, "shape"), "tetrahedron", "    shape: tetrahedron"),
        (("solver", "skin"), 0.001, "  skin: 0.001"),
        (("contact",), {"normal": "linear"}, "contact: {normal: linear}"),
        (("name",), "two", "name: two  # its name"),
    ],
)
def test_one_line_changes_and_all_others_stay(path, value, line):
    edited = yaml.safe_load(TEXT)
    inner = edited
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    changed = change_text(TEXT, edited)
    assert yaml.safe_load(changed) == edited
    assert line in changed.splitlines()
    before, after = TEXT.splitlines(), changed.splitlines()
    assert len([one for one in before if one not in after]) <= 1
    assert len([one for one in after if one not in before]) == 1


def test_relative_paths_start_at_the_new_folder(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/a.stl").write_text("solid")
    for name in ("arm.urdf", "hills.csv", "rock.npz", "clump.csv"):
        (tmp_path / name).write_text("something")
    source = tmp_path / "scene.yaml"
    source.write_text(
        "fills: [{shape: clump.csv}, {shape: sphere}]  # two\ntools:\n"
        "  one: {mesh: meshes/a.stl}\n  two: {mesh: package://robot/b.stl}\n  three: {urdf: arm.urdf}\n"
        "boundaries: [{mesh: meshes/a.stl}, {heights: hills.csv}]\n"
        "bodies: {rock: {spheres: rock.npz}, bell: {spheres: [[0, 0, 0, 1]]}}\n"
    )
    target = tmp_path / "further/new.yaml"
    assert write_scene(source, yaml.safe_load(source.read_text()), target)
    written = target.read_text()
    assert "# two" in written
    assert yaml.safe_load(written) == {
        "fills": [{"shape": "../clump.csv"}, {"shape": "sphere"}],
        "tools": {
            "one": {"mesh": "../meshes/a.stl"},
            "two": {"mesh": "package://robot/b.stl"},
            "three": {"urdf": "../arm.urdf"},
        },
        "boundaries": [{"mesh": "../meshes/a.stl"}, {"heights": "../hills.csv"}],
        "bodies": {"rock": {"spheres": "../rock.npz"}, "bell": {"spheres": [[0, 0, 0, 1]]}},
    }


def test_a_scene_of_bodies_alone_is_written_too(tmp_path):
    source = tmp_path / "scene.yaml"
    source.write_text("bodies: {bell: {spheres: [[0, 0, 0, 1]]}}\ntools:\nduration: 1\n")
    edited = yaml.safe_load(source.read_text()) | {"duration": 2}
    assert write_scene(source, edited, tmp_path / "new.yaml")
    assert yaml.safe_load((tmp_path / "new.yaml").read_text()) == edited


def test_what_cannot_be_changed_in_its_place_is_written_anew(tmp_path):
    source = tmp_path / "scene.yaml"
    source.write_text("fills: []\nname: one  # a name\nduration: 1\n")
    edited = {"fills": [], "name": "two"}
    assert not write_scene(source, edited, tmp_path / "new.yaml")
    assert yaml.safe_load((tmp_path / "new.yaml").read_text()) == edited
