"""What the user is told before a run, though nothing is wrong enough to refuse the scene."""

import re

import numpy as np
import pytest
from scenes import floor, write_small_scene

from sampler.cores import available_cores
from sand_sim import CommandError, SceneError, ToolVelocity, World, load_scene
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
        ({"numbers": {"rolling_friction": 0.0}}, []),  # as much as says that there is none
        (
            {"numbers": {"rolling_friction": 20.0}, "contact": {"rolling": "constant"}},
            ["pairs: 'grain' and '(grain|wall)' have a rolling_friction of 20; it is the tangent of an angle, not the"] * 2,
        ),
        ({"friction": 4.0, "material": {"density": 12.0, "young": 1e7, "poisson": 0.25}}, []),
        (
            {"friction": 35.0},
            ["pairs: 'grain' and '(grain|wall)' have a friction of 35; it is the tangent of an angle, not the"] * 2,
        ),
        (
            {"material": {"density": 2.6, "young": 1e7, "poisson": 0.25}},
            ["materials.grain: a density of 2.6 kg/m.3 is that of a foam; is it in g/cm.3\\?$"],
        ),
        (
            {"material": {"density": 2600, "young": 70.0, "poisson": 0.25}},
            ["materials.grain: a young of 70 Pa is that of a jelly; is it in MPa or GPa\\?$"],
        ),
        (
            {"liquid": LIQUID | {"surface_tension": 72}, "contact": {"cohesion": "capillary"}},
            ["liquid: no liquid has a surface_tension of 72 N/m; is it in mN/m\\?$"],
        ),
        (
            {"numbers": {"adhesion": 50.0}, "contact": {"cohesion": "dmt"}},
            [f"pairs: 'grain' and '{other}' have an adhesion of 50 J/m.2, .* is it in mJ/m.2\\?$" for other in ("grain", "wall")],
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
        return make_world([[0.0, 0.0, 0.02]], 0.005, settle={"time": time, "speed": 0.01, "fall": "free"}, **place)

    early = settled(0.05)  # 15 mm above the floor, it falls for 55 ms
    assert early.warnings == [
        "settle: grains still move at 0.49 m/s (root mean square) after 0.05 s, speed 0.01 m/s was asked; "
        "give it more time or ask for less"
    ]
    assert np.allclose(early.observe().grains.speed, 9.81 * 0.05, rtol=0.01)
    assert settled(1.0).warnings == []


def test_velocities_that_are_spent_before_time_zero_are_told(make_world):
    bed = {"position": [[0.0, 0.0, 0.005], [0.02, 0.0, 0.005]], "radius": 0.005, "boundaries": floor(), "gravity": [0, 0, -9.81]}
    thrown = make_world(**bed, velocity=[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], settle={"time": 0.5})
    assert [warning[:34] for warning in thrown.warnings] == ["settle: fill 'fills[0]' is given a"]
    assert make_world(**bed, velocity=[0.0, 0.0, -0.02], settle={"time": 0.5}).warnings == []  # left over from another scene


def test_grains_that_leave_while_they_settle_are_told(make_world):
    further = {"gravity": [0.0, 0.0, -9.81], "restitution": 0.3, "settle": {"time": 0.5, "speed": 0.01, "fall": "free"}}
    further |= {"domain": {"low": [-0.1, -0.1, -0.1], "high": [0.3, 0.1, 0.1]}}
    disc = {"type": "hole_plate", "name": "disc", "material": "wall", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
    disc |= {"hole_radius": 0.0, "radius": 0.02}
    places = [[0.0, 0.0, 0.005], [0.1, 0.0, 0.005], [0.2, 0.0, 0.005]]
    world = make_world(places, 0.005, boundaries=[disc], **further)
    assert world.warnings[0].startswith("settle: 2 of 3 grains left the domain while they settled; close the boundaries")
    assert len(world.observe().grains) == 1
    with pytest.raises(SceneError, match="settle: all grains have left the domain; give the scene a floor"):
        make_world(places[1:], 0.005, boundaries=[disc], **further)


def test_a_bed_struck_off_before_it_settles_is_told(tmp_path):
    region = {"low": [0.0, 0.0, 0.0], "high": [0.06, 0.06, 0.2]}
    bed = {"name": "bed", "material": "sand", "radius": 0.005, "region": region, "height": 0.03}
    world = World(load_scene(write_small_scene(tmp_path, fills=[bed], tools={})))
    assert world.warnings == ["fills: 'bed' is struck off at its 'height' before it settles; give 'settle' a time"]


def test_a_run_and_a_plan_tell_before_it_begins(tmp_path, capsys):
    path = write_small_scene(tmp_path, liquid=LIQUID, duration=0.02)
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "warning: liquid: has no effect" in capsys.readouterr().err
    assert main(["plan", str(path), "--no-measure"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[lines.index("without effect") + 1].startswith("  liquid: has no effect")
    assert "numbers that may be in another unit" not in lines
    light = {name: {"density": density, "young": 1e7, "poisson": 0.25} for name, density in (("sand", 2.6), ("steel", 7800.0))}
    assert main(["plan", str(write_small_scene(tmp_path, materials=light)), "--no-measure"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[lines.index("numbers that may be in another unit") + 1].endswith("is it in g/cm^3?")


def test_a_world_refuses_a_velocity_and_says_what_it_takes(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    velocity = ToolVelocity("plate", np.array([0.0, 0.0, -0.1]), np.zeros(3))
    with pytest.raises(CommandError, match="give it those of 'pose_after"):
        world.apply(velocity)
    world.apply(world.pose_after(velocity, 0.1))
    assert world.arrival("plate") == pytest.approx(0.1)  # at that velocity, not as fast as the tool may
    world.step(world.frame_steps)
    assert world.observe().tool("plate").velocity == pytest.approx(velocity.linear, abs=1e-6)


def test_more_threads_than_cores_are_told_and_not_all_started(make_world):
    cores = available_cores()
    world = make_world([[0.0, 0.0, 0.0]], 0.005, threads=1000)
    assert world.assembly.solver.device.lanes == 2 * cores
    assert world.warnings == [f"solver.threads: 1000 on {cores} cores wait for one another; ask for at most {cores}"]
    assert make_world([[0.0, 0.0, 0.0]], 0.005, threads=1).warnings == []
