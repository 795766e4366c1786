"""What the user is told before a run, though nothing is wrong enough to refuse the scene."""

import re

import numpy as np
import pytest
from scenes import floor, write_small_scene

from sand_sim import CommandError, World, load_scene
from sand_sim.border import ToolVelocity
from sand_sim.cli.main import main

LIQUID = {"bridge_volume": 0.01}


@pytest.mark.parametrize(
    ("further", "told"),
    [
        ({}, []),
        ({"numbers": {"rolling_friction": 0.1}, "contact": {"rolling": "constant"}}, []),
        (
            {"numbers": {"rolling_friction": 0.1}},
            ["pairs: 'rolling_friction' has no effect; .* would have to say rolling: constant, or rolling: spring$"],
        ),
        ({"numbers": {"adhesion": 0.1}}, ["pairs: 'adhesion' has no effect; .* say cohesion: dmt, or cohesion: jkr$"]),
        ({"liquid": LIQUID, "contact": {"cohesion": "capillary"}}, []),
        ({"liquid": LIQUID}, ["liquid: has no effect; the section 'contact' would have to say cohesion: capillary$"]),
    ],
)
def test_what_is_given_for_a_law_that_is_not_chosen_is_told(make_world, further, told):
    world = make_world([[0.0, 0.0, 0.0], [0.011, 0.0, 0.0]], 0.005, **further)
    assert len(world.warnings) == len(told)
    for warning, pattern in zip(world.warnings, told, strict=True):
        assert re.match(pattern, warning)


def test_grains_that_have_not_come_to_rest_are_told(make_world):
    def settled(time):
        place = {"boundaries": floor(), "gravity": [0.0, 0.0, -9.81], "restitution": 0.3}
        return make_world([[0.0, 0.0, 0.02]], 0.005, settle={"time": time, "speed": 0.01}, **place)

    early = settled(0.05)  # 15 mm above the floor, it falls for 55 ms
    assert early.warnings == [
        "settle: grains still move at 0.49 m/s (root mean square) after 0.05 s, speed 0.01 m/s was asked; "
        "give it more time or ask for less"
    ]
    assert np.allclose(early.observe().grains.speed, 9.81 * 0.05, rtol=0.01)
    assert settled(1.0).warnings == []


def test_a_run_and_a_plan_tell_before_it_begins(tmp_path, capsys):
    path = write_small_scene(tmp_path, liquid=LIQUID, duration=0.02)
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "warning: liquid: has no effect" in capsys.readouterr().err
    assert main(["plan", str(path), "--no-measure"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[lines.index("without effect") + 1].startswith("  liquid: has no effect")


def test_a_world_refuses_a_velocity_and_says_what_it_takes(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    velocity = ToolVelocity("plate", np.array([0.0, 0.0, -0.1]), np.zeros(3))
    with pytest.raises(CommandError, match="give it those of 'pose_after"):
        world.apply(velocity)
    world.apply(world.pose_after(velocity, 0.1))
    assert world.arrival("plate") > 0.0
