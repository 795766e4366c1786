"""Scenes with entries changed on the command line."""

import argparse
import json
import shutil
from dataclasses import replace

import pytest
from scenes import write_small_scene

from sand_sim import SceneError, load_scene
from sand_sim.cli import changes
from sand_sim.cli.main import main


def changed(scene, *words):
    parser = argparse.ArgumentParser()
    changes.add_argument(parser)
    return changes.load_changed(scene, parser.parse_args([word for text in words for word in ("--set", text)]).set)


def test_entries_are_changed_and_nothing_else(tmp_path):
    scene = write_small_scene(tmp_path)
    written = load_scene(scene)
    found = changed(scene, "duration=0.06", "materials.sand.density=1900", "solver.precision=double")
    assert (found.duration, found.materials[0].density, found.solver.precision) == (0.06, 1900.0, "double")
    sand = replace(found.materials[0], density=written.materials[0].density)
    assert replace(found, duration=written.duration, materials=(sand, *found.materials[1:]), solver=written.solver) == written
    assert changed(scene) == written


def test_files_are_those_of_the_working_folder_or_beside_the_scene(tmp_path, monkeypatch):
    scenes, here = tmp_path / "scenes", tmp_path / "here"
    scenes.mkdir()
    here.mkdir()
    scene = write_small_scene(scenes)
    shutil.copy(scenes / "plate.stl", here / "mine.stl")
    shutil.copy(scenes / "plate.stl", scenes / "other.stl")
    monkeypatch.chdir(here)
    for name, path in (("mine.stl", here / "mine.stl"), ("other.stl", scenes / "other.stl")):
        found = changed(scene, f"tools.plate.mesh={name}")
        assert (found.folder / found.tools[0].mesh).samefile(path)


def test_files_of_ones_home_are_found(tmp_path, monkeypatch):
    """No shell makes a path of ~ where it stands in a scene file, or behind a sign of equality."""
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.chdir(tmp_path)
    scene = write_small_scene(tmp_path)
    for name in ("plate.stl", "bed.npz"):
        shutil.move(tmp_path / name, home / name)
    assert load_scene(scene).fills[0].file == tmp_path / "bed.npz"
    words = ["--set", "tools.plate.mesh=~/plate.stl", "--set", "fills.0.file=~/bed.npz", "--duration=0.02"]
    assert main(["run", "small.yaml", *words, "--out=~/out", "--checkpoint=~/states"]) == 0
    assert (home / "out" / "small.json").is_file()
    assert list((home / "states").iterdir())
    assert not (tmp_path / "~").exists()


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("materials.sand.density=heavy", r"small\.yaml: materials\.sand\.density: must be a number"),
        ("tools.plate.mehs=mine.stl", r"small\.yaml: tools\.plate.*'mehs'"),
        ("duration.more=1", r"cannot change duration\.more in this scene: 'more' is asked of 0\.4, which has no entries"),
        ("fills.1.radius=0.004", r"cannot change fills\.1\.radius in this scene: '1' is none of the numbers from 0 to 0"),
        ("pairs.sand.friction=0.4", r"cannot change pairs\.sand\.friction .*: 'sand' is none of the numbers from 0 to \d"),
    ],
)
def test_a_wrong_change_is_refused_by_name(tmp_path, word, message):
    with pytest.raises(SceneError, match=message):
        changed(write_small_scene(tmp_path), word)


def test_a_change_to_nothing_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        changed(write_small_scene(tmp_path), "tools=null")
    assert "tools=null" in capsys.readouterr().err


def test_a_scene_that_cannot_be_read_is_refused_before_it_is_changed(tmp_path):
    (tmp_path / "broken.yaml").write_text("materials: [")
    with pytest.raises(SceneError, match=r"broken\.yaml: is not valid YAML"):
        changed(tmp_path / "broken.yaml", "duration=1")


def test_run_and_plan_take_changes(tmp_path, capsys):
    scene = write_small_scene(tmp_path)
    assert main(["run", str(scene), "--set", "duration=0.04", "--out", str(tmp_path)]) == 0
    assert json.loads((tmp_path / "small.json").read_text())["simulated_s"] == pytest.approx(0.04)
    capsys.readouterr()
    assert main(["plan", str(scene), "--set", "solver.time_step=1e-5", "--no-measure", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["time_step"]["value"] == pytest.approx(1e-5, rel=0.05)
