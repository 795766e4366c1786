"""What a run comes down to: peaks of forces against a tool's motion, and what it carried and lost on the way."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import World, load_scene
from sand_sim.report import summary_text
from sand_sim.sinks.run_log import RunLog


def test_draft_is_against_the_motion_lift_is_down_and_what_is_lost_is_spilled(tmp_path):
    """The phase ``carry`` of the small scene lasts from 0.3 to 0.4 s."""
    world = World(load_scene(write_small_scene(tmp_path)))
    first = world.observe()
    log = RunLog(world.scene)
    rows = [  # time, velocity, force of the sand, mass
        (0.1, [0.3, 0.4, 1.0], [-3.0, -4.0, 9.0], 0.5),  # 5 N against the motion, which is 3 to 4
        (0.2, [-0.1, 0.0, 0.0], [-20.0, 7.0, -2.0], 0.7),  # pushed along; drawn down by 2 N
        (0.3, [0.0, 0.0, 0.5], [50.0, 0.0, -4.0], 0.9),  # no draft where nothing moves sideways
        (0.34, [0.1, 0.0, 0.0], [-1.0, 0.0, -6.0], 0.8),
        (0.4, [0.1, 0.0, 0.0], [-1.0, 0.0, -5.0], 0.6),
        (0.5, [0.1, 0.0, 0.0], [-1.0, 0.0, -1.0], 0.0),
    ]
    for number, (time, velocity, force, mass) in enumerate(rows):
        felt = {"world_force": np.array(force), "torque": number * np.array([0.3, -0.4, 0.0])}
        report = replace(first.tools[0], velocity=np.array(velocity), carried=mass, **felt)
        log.write(replace(first, time=time, steps=number, tools=(report,)))
    told = log.summarise()["tools"]["plate"]
    assert told["peak_force_N"] == pytest.approx(50.16, abs=0.01)
    assert told["peak_draft_N"] == pytest.approx(5.0)
    assert told["peak_lift_N"] == pytest.approx(6.0)
    assert told["peak_pull_N"] == pytest.approx(20.0)
    assert told["peak_bearing_N"] == pytest.approx(9.0)
    text = summary_text(log.summarise())
    assert re.search("plate: peak pull +20.0 N", text), "as it is more than the draft"
    assert re.search("plate: peak bearing +9.0 N", text)
    assert told["peak_torque_Nm"] == pytest.approx(5 * 0.5)
    assert told["carried_kg"] == pytest.approx(0.6)
    assert told["spilled_kg"] == pytest.approx(0.9 - 0.6)
    assert told["carried_weight_N"] == pytest.approx((4.0 + 6.0 + 5.0) / 3.0)


def test_doubts_that_have_passed_are_told(tmp_path):
    """Energy from nowhere that has been dissipated since, and grains that were too fast for a while."""
    world = World(load_scene(write_small_scene(tmp_path)))
    first, log = world.observe(), RunLog(world.scene)
    lost, deep = "J appeared from nowhere; take a smaller time step", "% of a radius; stiffen"
    rows = [  # energy gained, doubts
        (0.0, ()),
        (0.2, (f"overlap reached 11.2 {deep}", f"0.2 {lost}", "grains move at 9 m/s, which asks for a time step of 1e-07 s")),
        (3e-1, (f"overlap reached 12.3 {deep}; or a wall?", f"3e-01 {lost}")),
        (0.0, (f"overlap reached 12.3 {deep}; or a wall?",)),
    ]
    for number, (gained, doubts) in enumerate(rows):
        log.write(replace(first, time=0.1 * number, steps=number, health=replace(first.health, gained=gained, doubts=doubts)))
    resumed = RunLog(world.scene)
    resumed.unpack(log.pack())
    resumed.last = log.last
    for told in (log.summarise(), resumed.summarise()):
        assert told["energy_J"]["gained"] == pytest.approx(0.3)
        assert told["doubts"] == [
            f"overlap reached 12.3 {deep}; or a wall?",
            f"3e-01 {lost} (at t = 0.2 s)",
            "grains move at 9 m/s, which asks for a time step of 1e-07 s (at t = 0.1 s)",
        ]


@pytest.mark.parametrize("pull", [0.0, 2.0])
def test_a_tool_that_met_no_grain_is_told(tmp_path, pull):
    """As where a mesh of one's own lies elsewhere in its frame than was thought."""
    world = World(load_scene(write_small_scene(tmp_path)))
    first, log = world.observe(), RunLog(world.scene)
    log.write(replace(first, steps=1, tools=(replace(first.tools[0], world_force=np.array([0.0, 0.0, pull])),)))
    log.write(replace(first, steps=2))
    text = summary_text(log.summarise())
    assert ("plate  " in text, "met no grain" in text, "plate: peak lift" in text) == (not pull, not pull, bool(pull))


def test_the_history_holds_what_walls_bear(tmp_path):
    """Floor, sides and plunger of a box together bear the weight of the bed; a log goes on from what another has packed."""
    box = {"type": "box", "name": "bin", "material": "steel", "low": [-0.005, -0.005, 0.0], "high": [0.04, 0.04, 0.1]}
    lid = {
        "type": "plunger",
        "name": "lid",
        "material": "steel",
        "point": [0.0, 0.0, 0.05],
        "normal": [0.0, 0.0, -1.0],
        "force": 0.5,
    }
    lid |= {"max_speed": 0.1}
    box |= {"open": ["top"]}
    world = World(load_scene(write_small_scene(tmp_path, boundaries=[box, lid], settle={"time": 0.2}, tools={})))
    log = RunLog(world.scene)
    for _ in range(30):
        world.step(world.frame_steps)
        log.write(world.observe())
    columns = log.columns()
    names = [name for name in columns if name.endswith(".force")]
    assert set(names) == {f"wall.bin/{side}.force" for side in ("front", "back", "left", "right", "bottom")} | {"wall.lid.force"}
    assert columns["wall.lid.position"].shape == columns["wall.lid.force"].shape == (30, 3)
    weight = 9.81 * float(log.last.grains.mass.sum())
    borne = np.sum([columns[name] for name in names], axis=0)[-5:].mean(axis=0)
    assert borne == pytest.approx([0.0, 0.0, -weight], abs=0.02 * weight)
    assert columns["wall.lid.force"][-5:, 2].mean() == pytest.approx(0.5, rel=0.02)
    again = RunLog(world.scene)
    again.unpack(log.pack())
    assert again.columns().keys() == columns.keys()
