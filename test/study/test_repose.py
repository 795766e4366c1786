"""The angle at which grains come to rest."""

from types import SimpleNamespace

import numpy as np
import pytest
from scenes import SceneMaker

from sand_sim import SceneError, World, read_scene
from sand_sim.cli.main import main
from sand_sim.study import repose

SMALL = 45.0, 4.0, 12.0
WHERE = {"region": {"low": [-0.05, -0.05, 0.0], "high": [0.05, 0.05, 0.2]}}


def sand(tmp_path, friction=0.5, rolling=0.3, **further):
    numbers = {"friction": friction, "rolling_friction": rolling}
    fields = {"gravity": [0.0, 0.0, -9.81], "precision": "single", "contact": {"rolling": "spring"}, "numbers": numbers}
    fields["material"] = {"density": 2500.0, "young": 3e6, "poisson": 0.25}  # large soft grains take large steps
    fields["fills"] = [{"material": "grain", "name": "bed", "radius": 0.005, "count": 10} | WHERE]
    return read_scene(SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.005, **fields | further), tmp_path)


@pytest.mark.parametrize("angle", [15.0, 30.0, 40.0])
def test_the_slope_of_a_wedge_is_its_angle(angle):
    """Grains in no order below a surface that rises from a layer at the ledge to 24 diameters."""
    place = np.random.default_rng(0).uniform([0.0, 0.0, 0.0], [100.0, 6.0, 24.0], (200_000, 3))
    place = place[place[:, 2] < np.minimum(24.0, 1.0 + place[:, 0] * np.tan(np.radians(angle)))]
    slope, level = repose._slope(SimpleNamespace(position=place, radius=np.full(len(place), 0.5)), 1.0)
    assert level == pytest.approx(24.5, abs=0.2)
    assert np.degrees(np.arctan(np.polyfit(*slope.T, 1)[0])) == pytest.approx(angle, abs=1.0)


def test_sand_that_slides_and_rolls_less_easily_rests_steeper(tmp_path):
    stages, found = set(), []
    for bed in (sand(tmp_path, 0.3, 0.0), sand(tmp_path, 0.5, 0.4)):
        found.append(repose.find_repose(bed, "bed", 1, tmp_path, lambda stage, share: stages.add(stage), SMALL))
    assert {"settling", "flowing"} <= stages
    assert 12.0 < found[0].angle < found[1].angle - 6.0
    assert found[1].angle < 45.0
    assert found[1].doubts == ()


def test_clumps_lie_over_the_ledge_as_they_lay_behind_the_gate(tmp_path, monkeypatch):
    """A file tells the sizes of spheres as large, not how far a clump reaches: they were half as large again, and flew apart."""
    seen = []

    class Seen(World):
        def __init__(self, *words):
            super().__init__(*words)
            seen.append(self.observe())
            if len(seen) == 2:
                raise InterruptedError

    monkeypatch.setattr(repose, "World", Seen)
    fill = {"material": "grain", "name": "bed", "shape": "tetrahedron", "radius": 0.005, "count": 10} | WHERE
    with pytest.raises(InterruptedError):
        repose.find_repose(sand(tmp_path, fills=[fill]), "bed", 1, tmp_path, size=(12.0, 4.0, 4.0))
    before, after = seen
    np.testing.assert_allclose(after.grains.mass, before.grains.mass, rtol=1e-5)
    assert after.health.deepest == pytest.approx(before.health.deepest, rel=0.01)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"gravity": [0.0, 0.0, 0.0]}, "gravity: "),
        ({"fills": [{"material": "grain", "name": "bed", "file": "grains_1.npz"}]}, "fills: 'bed' is read from a file"),
        ({"fills": [{"material": "grain", "name": "dust", "radius": 0.002, "count": 3} | WHERE]}, "no 'bed'; the scene has dust"),
    ],
)
def test_what_has_no_angle_is_refused(tmp_path, fields, told):
    with pytest.raises(SceneError, match=told):
        repose.find_repose(sand(tmp_path, 0.5, **fields), "bed", 1, tmp_path)


def test_the_verb_tells_the_angles_and_what_is_doubtful(monkeypatch, capsys):
    angles = iter([31.0, 32.5])
    one = lambda *_: repose.Repose(next(angles), np.zeros((3, 2)), 10_000, ("overlaps",))  # noqa: E731
    monkeypatch.setattr("sand_sim.cli.repose.find_repose", one)
    assert main(["repose", "dig"]) == 0
    output = capsys.readouterr().out.splitlines()
    assert output[0] == "dig: the slope of 'bed' at a ledge comes to rest at 31.8 degrees, 31.0 to 32.5 in 2 beds"
    assert output[1:] == ["  not to be trusted: overlaps"]


def test_the_verb_refuses_grains_that_are_not_there(capsys):
    assert main(["repose", "dig", "--fill", "gravel"]) == 1
    assert capsys.readouterr().err.strip().splitlines()[-1] == "sand_sim: fills: there is no 'gravel'; the scene has bed"
