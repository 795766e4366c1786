"""Whole studies, small ones."""

import json
import subprocess
import sys
from dataclasses import replace

import pytest
import yaml
from scenes import write_small_scene

from sand_sim import SceneError, World, load_scene
from sand_sim.cli.main import main
from sand_sim.config_folder import find_scene
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.study.choices import CHOICES, REFERENCE
from sand_sim.study.pareto import Plan, Study
from sand_sim.study.quantity import Wrench
from sand_sim.study.table import chance_text
from sand_sim.study.variation import Edit, Variation, to


def chosen(*titles):
    return tuple(one for one in CHOICES if one.title in titles)


@pytest.fixture
def small(tmp_path):
    """A scene with a plate pressed onto a few grains, and its folder."""
    path = write_small_scene(tmp_path, solver={"threads": 1}, duration=0.3)
    return yaml.safe_load(path.read_text()), tmp_path


def test_small_study(small):
    impossible = Variation("contact law", "impossible", (Edit("contact.normal", to("rubber")),))
    far = Variation("time step", "far too long", (Edit("solver.time_step", to(0.01)),))
    variations = (*chosen("time step: safe x 2", "skin: 0.5 radii", "stiffness: E x 0.1", "time step: safe"), impossible, far)
    lines = []
    study = Study(*small, Plan("wrench", 10.0, 2, variations), lines.append)
    study.run()
    rows = {row.title: row for row in study.rows() if row.group != "together"}  # which hangs on the moment's run times
    assert set(rows) == {"as written", REFERENCE.title, *(one.title for one in variations)} - {"time step: safe"}
    for title in ("as written", "skin: 0.5 radii", REFERENCE.title):
        row = rows[title]
        assert row.runs >= 2
        assert row.trusted
        assert 0.0 < row.time.low <= row.time.middle <= row.time.high
        assert 0.0 <= row.error.low <= row.error.middle <= row.error.high
    assert rows[REFERENCE.title].steps == pytest.approx(4 * rows["as written"].steps, rel=0.05)
    assert "2 times the safe one" in rows["time step: safe x 2"].doubts[0]
    assert not rows["time step: safe x 2"].front
    assert "unknown 'rubber'" in rows["contact law: impossible"].refusal
    assert "times the safe step" in rows["time step: far too long"].refusal
    assert any(row.front for row in rows.values())
    variation, row = study.recommendation()
    assert row.within(10.0)
    assert variation.title == row.title
    assert any("repeat 2/2" in line for line in lines)


def test_best_of_each_choice_are_run_together(small, monkeypatch):
    """With run times made up: a softer material halves them, a thicker skin takes them to a third."""
    whole = Wrench.measure

    def measure(self, world, check):
        faster = 2.0 if world.scene.materials[0].young < 1e7 else 1.0
        return replace(whole(self, world, check), wall=12.0 / faster / (3.0 if world.scene.solver.skin else 1.0), doubts=())

    monkeypatch.setattr(Wrench, "measure", measure)
    study = Study(*small, Plan("wrench", 1e6, 2, chosen("skin: 0.5 radii", "stiffness: E x 0.3", "stiffness: E x 3")))
    study.run()
    variation, row = study.recommendation()
    assert row.title == "together: stiffness: E x 0.3, skin: 0.5 radii"
    assert (row.time.middle, row.runs) == (2.0, 2)
    edited = variation.apply(small[0], study.facts)
    assert edited["solver"]["skin"] == pytest.approx(0.0025)
    assert float(edited["materials"]["sand"]["young"]) == pytest.approx(3e6)


def test_nothing_is_recommended_where_nothing_is_good_enough(small):
    study = Study(*small, Plan("wrench", 1e-12, 2, ()))
    study.run()
    assert study.recommendation() is None


@pytest.mark.parametrize("walls", ["box", "none"])
def test_what_chance_does_is_measured_or_said_to_be_unknown(small, walls):
    """Of a bed from a file in a box all repeats were the same, and by chance alone they lay 0 % apart."""
    parsed, folder = small
    sides = {
        "type": "box",
        "name": "bin",
        "material": "steel",
        "low": [-0.01, -0.01, 0],
        "high": [0.05, 0.05, 0.2],
        "open": ["top"],
    }
    parsed |= {"boundaries": [sides] if walls == "box" else [], "duration": 0.1}
    study = Study(parsed, folder, Plan("spread", 1.0, 2, ()))
    study.run()
    if walls == "box":
        assert study.scatter() > 0.0
        assert " % apart" in chance_text(study.scatter())
    else:
        assert study.scatter() == 0.0
        assert "nothing is known of what chance does" in chance_text(study.scatter())


def test_interrupted_study_keeps_what_was_run(small):
    left = iter(range(200))

    def check():
        if next(left, None) is None:
            raise KeyboardInterrupt

    study = Study(*small, Plan("wrench", 1.0, 50, chosen("skin: 0.5 radii")), check=check)
    with pytest.raises(KeyboardInterrupt):
        study.run()
    assert {"as written", REFERENCE.title} <= {row.title for row in study.rows()}


def test_impact_converges_with_the_square_of_the_step(tmp_path):
    """Errors of the package's own impact fall with the square of the step, and only the finest meets a tight tolerance."""
    scene = tmp_path / "written.yaml"
    words = ["pareto", "impact", "--repeats", "3", "--tolerance", "0.0001", "--out", str(tmp_path), "--write", str(scene)]
    assert main(words) == 0
    report = json.loads((tmp_path / "impact_pareto.json").read_text())
    assert report["order_in_time_step"]["peak overlap"] == pytest.approx(2.0, abs=0.1)
    assert report["order_in_time_step"]["peak force"] == pytest.approx(2.0, abs=0.1)
    assert report["order_in_time_step"]["contact time"] == pytest.approx(2.0, abs=0.1)
    settings = {f"{one['group']}: {one['name']}": one for one in report["settings"]}
    assert settings["stiffness: E x 0.1"]["errors"]["contact time"]["middle"] == pytest.approx(10**0.4 - 1.0, rel=0.01)
    assert settings["stiffness: E x 0.1"]["errors"]["rebound"]["high"] < 1e-3
    assert report["recommended"] == "time step: safe / 8"
    assert (tmp_path / "impact_pareto.png").stat().st_size > 10_000
    original = find_scene("impact")
    assert load_scene(scene).solver.time_step == pytest.approx(settings["time step: safe / 8"]["time_step_s"])
    assert World(load_scene(scene)).time == 0.0  # its grains are found from the new folder
    assert [line for line in original.read_text().splitlines() if line.startswith("#")] == [
        line for line in scene.read_text().splitlines() if line.startswith("#")
    ]


def test_settings_that_blow_up_are_reported_and_the_study_goes_on(small, monkeypatch):
    whole = Wrench.measure

    def measure(self, world, check):
        if world.scene.solver.skin:
            raise UnstableError("a grain's velocity is not finite")
        return whole(self, world, check)

    monkeypatch.setattr(Wrench, "measure", measure)
    study = Study(*small, Plan("wrench", 10.0, 1, chosen("skin: 0.5 radii")))
    study.run()
    assert {row.title: row.refusal for row in study.rows()}["skin: 0.5 radii"] == "unstable: a grain's velocity is not finite"
    assert study.recommendation()[0].title == "as written"
    small[0]["solver"]["skin"] = 0.001
    with pytest.raises(SceneError, match="as written: a grain's velocity is not finite"):
        Study(*small, Plan("wrench", 10.0, 1, ())).run()


@pytest.mark.parametrize("name", ["impact", "column", "dig"])
def test_own_scenes_can_be_read(name):
    assert load_scene(find_scene(name)).name == name


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nothing"], "sand_sim: scene 'nothing': there is no such file"),
        (["dig", "--set", "solver.time_step=abc"], "sand_sim: solver.time_step: must be a number"),
        (["dig", "--set", "materials.young.more=1"], "sand_sim: "),
        (
            ["dig", "--quantity", "impact"],
            "sand_sim: gravity: the closed form of an impact is that without gravity; use [0, 0, 0], or another --quantity",
        ),
    ],
)
def test_refusals_are_one_line(capsys, tmp_path, words, message):
    assert main(["pareto", *words, "--quick", "--out", str(tmp_path)]) == 1
    errors = capsys.readouterr().err.strip().splitlines()
    assert errors[-1].startswith(message)


@pytest.mark.parametrize(
    "words",
    [
        ["--tolerance", "-1"],
        ["--tolerance", "x"],
        ["--repeats", "0"],
        ["--set", "x"],
        ["--set", "duration=[1, 2"],
        ["--quantity", "beauty"],
    ],
)
def test_wrong_options_are_refused(capsys, words):
    with pytest.raises(SystemExit):
        main(["pareto", "impact", *words])
    assert f"argument {words[0]}" in capsys.readouterr().err


def test_help():
    done = subprocess.run([sys.executable, "-m", "sand_sim", "pareto", "--help"], capture_output=True, text=True, check=True)
    for word in ("--tolerance", "--repeats", "--write FILE", "--quick", "--set PATH=VALUE"):
        assert word in done.stdout


def test_impact_needs_an_impact(small):
    parsed, folder = small
    parsed["gravity"] = [0, 0, 0]
    with pytest.raises(SceneError, match="an impact is one grain and one plane"):
        Study(parsed, folder, Plan("impact", 0.01, 1, ()))


def test_impacts_of_bodies_have_no_closed_form(small):
    parsed, folder = small
    ball = {"spheres": [[0, 0, 0, 0.01]], "material": "sand", "pose": {"position": [0.0, 0.0, 0.05]}}
    parsed |= {"gravity": [0, 0, 0], "fills": [], "tools": {}, "bodies": {"ball": ball}}
    with pytest.raises(SceneError, match="that of spheres, not of clumps or bodies; choose another --quantity"):
        Study(parsed, folder, Plan("impact", 0.01, 1, ()))
