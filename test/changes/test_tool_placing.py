"""A tool put somewhere else at once: as if it had begun there, and all else goes on."""

import numpy as np
import pytest
import trimesh
from drawn import NO_TURN, drawn, memories, same_state
from scenes import write_small_scene

from sand_sim import CommandError, ToolPose, World, load_scene

ABOVE, TURNED = np.array([0.015, 0.015, 0.06]), np.array([0.0, -np.sin(0.2), 0.0, np.cos(0.2)])
BESIDE = np.array([0.08, 0.015, 0.03])


@pytest.mark.parametrize("contact", ["rough", "smooth"])
def test_it_begins_there_as_if_the_scene_had_said_so(tmp_path, contact):
    """Pushed against the side of the bed from where it was put, it gives the wrenches of a tool that was there, to the bit."""

    def pushed(world):
        found = []
        world.apply(ToolPose("plate", BESIDE - [0.03, 0.0, 0.0], TURNED, world.time + 0.08))
        for _ in range(10):
            world.step(round(0.008 / world.time_step))
            seen = world.observe()
            found.append([*seen.tool("plate").force, *seen.tool("plate").torque, seen.health.dissipated])
        return np.array(found)

    tools = {"plate": {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 1.0, "contact": contact}}
    worlds = []
    for position, turn in ((ABOVE, NO_TURN), (BESIDE, TURNED)):
        tools["plate"]["pose"] = {"position": position.tolist(), "orientation": turn.tolist()}
        worlds.append(World(load_scene(write_small_scene(tmp_path, tools=tools))))
    worlds[0].place_tool("plate", BESIDE, 3.0 * TURNED)  # of any length
    found, expected = map(pushed, worlds)
    assert np.abs(expected[:, :6]).max() > 0.1
    assert np.array_equal(found, expected)
    worlds[0].reset()
    assert worlds[0].observe().tool("plate").position == pytest.approx(ABOVE)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
@pytest.mark.parametrize("contact", ["rough", "smooth"])
def test_out_of_the_bed_all_else_stays_and_energy_is_accounted_for(tmp_path, integrator, contact):
    thickness = {"rough": 0.004, "smooth": 0.008}[contact]  # rough ones are a particle thicker
    trimesh.creation.box((0.06, 0.06, thickness)).export(tmp_path / "one.stl")
    further = {"mesh": "one.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 1.0, "contact": contact}
    further["pose"] = {"position": ABOVE.tolist()}
    world = drawn(tmp_path, solver={"precision": "double", "integrator": integrator}, tools={"plate": further})
    before, kept = world.observe(), memories(world)
    assert len(world.tool_contacts("plate")) > 5
    world.place_tool("plate", ABOVE)
    after, found, report = world.observe(), memories(world), world.observe().tool("plate")
    assert len(world.tool_contacts("plate")) == 0
    assert found.keys() == {key for key in kept if key[0] != "tool"}
    assert all(np.array_equal(found[key], kept[key]) for key in found)
    assert np.array_equal(after.grains.position, before.grains.position)
    assert (after.time, after.steps, report.swept) == (before.time, before.steps, before.tool("plate").swept)
    assert report.position == pytest.approx(ABOVE)
    assert not np.any([report.velocity, report.spin, report.force, report.torque])
    assert report.work == pytest.approx(before.health.tool_work, rel=1e-12)
    assert after.health.tool_work == before.health.tool_work
    assert after.health.elastic < 0.95 * before.health.elastic
    assert after.health.dissipated == pytest.approx(before.health.dissipated, abs=1e-9 * before.health.elastic)
    world.step(1000)
    later = world.observe()
    assert later.health.gained < 1e-3 * before.health.elastic
    assert later.tool("plate").work == report.work
    assert not [doubt for doubt in later.health.doubts if "nowhere" in doubt]


def test_what_it_had_been_told_is_forgotten(tmp_path):
    """It rests where it was put, and goes on from there no faster than it may."""
    world = World(load_scene(write_small_scene(tmp_path)))
    world.apply(ToolPose("plate", ABOVE + [0.1, 0.0, 0.0], NO_TURN, 0.2))
    world.step(100)
    world.place_tool("plate", BESIDE)
    assert world.resting("plate")
    world.step(100)
    assert world.observe().tool("plate").position == pytest.approx(BESIDE)
    world.apply(ToolPose("plate", BESIDE + [0.0, 0.0, 0.05], NO_TURN, world.time + 0.051))
    with pytest.raises(CommandError, match="would move at 2"):
        world.apply(ToolPose("plate", BESIDE + [0.0, 0.0, 0.1], NO_TURN, world.time + 0.05))


def test_the_ground_on_the_way_is_not_swept(tmp_path):
    """From one side of the bed to the other; sent there it sweeps what lies between."""
    world, there = World(load_scene(write_small_scene(tmp_path))), BESIDE * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.012]
    upright = np.array([0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])
    for position in (there, there - [0.13, 0.0, 0.0]):
        world.place_tool("plate", position, upright)
    assert world.observe().tool("plate").swept == 0.0
    world.apply(ToolPose("plate", there, upright, 0.2))
    world.step(round(0.2 / world.time_step))
    assert world.observe().tool("plate").swept > 5e-6


def test_a_state_knows_where_it_is(tmp_path):
    world = drawn(tmp_path)
    world.place_tool("plate", BESIDE)
    state = world.save()
    world.apply(ToolPose("plate", BESIDE - [0.03, 0.0, 0.0], NO_TURN, world.time + 0.1))
    world.step(200)
    expected, fresh = world.save(), World(world.scene)
    fresh.restore(state)
    fresh.apply(ToolPose("plate", BESIDE - [0.03, 0.0, 0.0], NO_TURN, fresh.time + 0.1))
    fresh.step(200)
    assert same_state(fresh.save(), expected)


@pytest.mark.parametrize(
    ("tool", "position", "orientation", "message"),
    [
        ("plate", [0.015, 0.015, 0.01], None, r"cuts into \d+ grains by more than 0.1 of a radius, the deepest at .*put there"),
        ("plate", [0.0, 0.0], None, r"position must be of shape \(3,\)"),
        ("plate", [0.0, np.nan, 0.1], None, "must be finite"),
        ("plate", [0.0, 0.0, 0.1], [0.0, 0.0, 0.0, 0.0], "orientation is"),
        ("plate", [0.0, 0.0, 1e300], None, "far from the domain, .* is it in metres"),
        ("spade", [0.0, 0.0, 0.1], None, "'spade' is unknown; known are plate"),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(tmp_path, tool, position, orientation, message):
    world = drawn(tmp_path)
    world.observe()
    before = world.save()
    with pytest.raises(CommandError, match=message):
        world.place_tool(tool, position, orientation)
    assert same_state(world.save(), before)
