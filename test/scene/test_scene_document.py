"""What ``docs/scenes.md`` shows is read as it stands there, and means what is said beside it."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from sand_sim import read_scene, rotation
from sand_sim.scene.types import SizeDistribution

DOCUMENT = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
FILL = {"material": "sand", "radius": 0.003, "count": 10, "region": {"low": [0, 0, 0], "high": [1, 1, 1]}}
BARE = {
    "materials": {"sand": {"density": 2600, "young": 1e7, "poisson": 0.25}},
    "pairs": [{"between": ["sand", "sand"], "restitution": 0.5, "friction": 0.5}],
    "fills": [FILL],
}


@pytest.fixture
def shown():
    """All examples as one scene, with the numbers and the material that they take for granted."""
    content = {}
    for block in re.findall(r"```yaml\n(.*?)```", DOCUMENT, re.DOTALL):
        content |= yaml.safe_load(block)
    content["materials"]["stone"] = content["materials"]["sand"]
    numbers = {"restitution": 0.5, "friction": 0.5}
    others = [("sand", "stone"), ("stone", "stone"), ("stone", "steel")]
    content["pairs"] += [{"between": list(names)} | numbers for names in others]
    for rule in content["pairs"]:
        rule["rolling_friction"] = 0.1
    return content


def test_examples_are_read(shown):
    scene = read_scene(shown, Path.cwd())
    assert scene.contact.rolling == "spring"
    assert (scene.liquid.saturation, scene.liquid.surface_tension) == (0.1, 0.072)
    assert scene.fills[0].size == SizeDistribution("uniform", low=0.006, high=0.0072)
    assert scene.fills[1].file == Path.cwd() / "grains.npz"
    rock, bell = (next(body for body in scene.bodies if body.name == name) for name in ("rock", "bell"))
    assert rock.pose.orientation == pytest.approx(rotation.from_rpy(0.1, 0.0, 0.0))
    assert (bell.velocity, bell.spin) == ((0, 0, -1), (0, 5, 0))
    bucket = scene.tool("bucket")
    assert (bucket.scale, bucket.trajectory[1].phase) == (0.001, "cut")
    assert scene.tool("scoop").link == "scoop_link"
    assert (scene.solver.time_step, scene.solver.skin, scene.solver.threads) == (None, None, None)


def test_what_is_left_out_is_as_documented(shown):
    bare = read_scene(dict(BARE), Path.cwd())
    example = read_scene(shown, Path.cwd())
    for name in ("gravity", "frame_rate", "solver"):
        assert getattr(bare, name) == getattr(example, name), name
    assert bare.duration == 1.0
    assert bare.settle.time == 0.0
    tool = {"mesh": "m.stl", "material": "sand", "particle_radius": 0.002}
    moved = tool | {"trajectory": [{"time": 0.5, "position": [1, 2, 3]}, {"time": 2.5, "position": [1, 2, 4]}]}
    scene = read_scene(BARE | {"tools": {"still": tool, "moved": moved}}, Path.cwd())
    assert scene.duration == 2.5
    assert scene.tool("still").max_speed == 2.0
    assert scene.tool("still").pose.position == (0.0, 0.0, 0.0)
    assert scene.tool("moved").pose.position == (1, 2, 3)
    assert {one.contact for one in scene.tools} == {"rough"}


@pytest.mark.parametrize(
    ("radius", "size"),
    [
        (0.003, SizeDistribution("constant", mean=0.003)),
        ({"uniform": [0.003, 0.004]}, SizeDistribution("uniform", low=0.003, high=0.004)),
        (
            {"normal": {"mean": 0.004, "deviation": 0.0005, "low": 0.0035}},
            SizeDistribution("normal", mean=0.004, deviation=0.0005, low=0.0035, high=0.005),
        ),
        (
            {"table": {"radii": [0.003, 0.004, 0.005], "weights": [1, 2, 5]}},
            SizeDistribution("table", radii=(0.003, 0.004, 0.005), weights=(1, 2, 5)),
        ),
    ],
)
def test_radii_are_read_as_they_are_given(radius, size):
    assert read_scene(BARE | {"fills": [FILL | {"radius": radius}]}, Path.cwd()).fills[0].size == size


def test_volume_of_a_bridge_may_be_given_instead(shown):
    """0.931 times the saturation: 4/3 pi R^3 of solid, 0.4/0.6 of it pores, shared among six bridges of two grains each."""
    factor = float(re.search(r"it is ([0-9.]+) times the saturation", DOCUMENT)[1])
    assert factor == pytest.approx(4.0 / 3.0 * np.pi * 0.4 / 0.6 / 3.0, abs=5e-4)
    shown["liquid"] = {"bridge_volume": 0.01}
    assert read_scene(shown, Path.cwd()).liquid.saturation == pytest.approx(0.01 / factor, rel=1e-3)
