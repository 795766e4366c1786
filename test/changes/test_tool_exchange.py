"""Another mesh for a tool while its world runs."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from drawn import NO_TURN, drawn, memories, same_state
from scenes import write_small_scene

from sand_sim import CommandError, SceneError, ToolPose, World, load_scene


def box(tmp_path, name, edges, up=0.0):
    mesh = trimesh.creation.box(edges)
    mesh.apply_translation([0.0, 0.0, up])
    mesh.export(tmp_path / name)
    return name


def test_same_shape_feels_the_same_grains(tmp_path):
    """Under another name: contacts where they were and as deep; what they remember of shear has gone, and nothing else."""
    world = drawn(tmp_path, solver={"precision": "double"})
    before, contacts, kept = world.observe(), world.tool_contacts("plate"), memories(world)
    world.set_tool_mesh("plate", box(tmp_path, "again.stl", (0.06, 0.06, 0.004)))
    after, now = world.observe(), world.tool_contacts("plate")
    assert now.identity.tolist() == contacts.identity.tolist()
    assert now.overlap == pytest.approx(contacts.overlap, abs=1e-12)
    assert now.point == pytest.approx(contacts.point, abs=1e-12)
    found = memories(world)
    assert found.keys() == {key for key in kept if key[0] != "tool"}
    assert all(np.array_equal(found[key], kept[key]) for key in found)
    assert np.array_equal(after.grains.position, before.grains.position)
    report, was = after.tool("plate"), before.tool("plate")
    for name in ("position", "orientation", "velocity", "spin"):
        assert np.array_equal(getattr(report, name), getattr(was, name))
    assert (report.work, report.swept, after.steps) == (was.work, was.swept, before.steps)


def test_the_file_of_the_grains_may_have_gone(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    (tmp_path / "bed.npz").unlink()
    world.set_tool_mesh("plate", box(tmp_path, "wider.stl", (0.08, 0.06, 0.004)))
    assert np.ptp(world.tools[0].body.points, axis=0) == pytest.approx([0.08, 0.06, 0.004], abs=1e-6)


def particles_of(world, tool):
    tools = world.assembly.solver.arrays.tools
    return tools.particles.numpy()[tools.tool_of.numpy() == tool].copy()


def test_other_tools_go_on(tmp_path):
    """A shield pushed against the side of the bed keeps what its contacts remember when the plate, listed before it, changes."""
    box(tmp_path, "plate.stl", (0.06, 0.06, 0.004))
    common = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 1.0}
    start, upright = {"time": 0.0, "position": [0.015, 0.015, 0.06]}, {"rpy": [0.0, np.pi / 2, 0.0]}
    tools = {
        "plate": common | {"trajectory": [start]},
        "shield": common | {"trajectory": [{"time": 0.0, "position": [-0.02, 0.015, 0.03]} | upright]},
    }
    world = drawn(tmp_path, tools=tools)
    turn = world.observe().tool("shield").orientation
    world.apply(ToolPose("shield", np.array([0.01, 0.015, 0.03]), turn, world.time + 0.06))
    world.step(round(0.05 / world.time_step))
    world.observe()
    kept = {key: value for key, value in memories(world).items() if key[0] == "tool"}
    own = particles_of(world, 1)
    contacts = world.tool_contacts("shield")
    assert len(contacts) >= 3
    world.set_tool_mesh("plate", box(tmp_path, "smaller.stl", (0.04, 0.04, 0.004)))
    assert np.array_equal(particles_of(world, 1), own)
    assert len(particles_of(world, 0)) != len(particles_of(world, 1))
    found = {key: value for key, value in memories(world).items() if key[0] == "tool"}
    assert len(kept) > len(found) > 0
    assert all(np.array_equal(found[key], kept[key]) for key in found)
    assert world.tool_contacts("shield").wrench == pytest.approx(contacts.wrench, rel=1e-5, abs=1e-7)


def test_energy_of_the_exchange_is_accounted_for(tmp_path):
    """A plate 0.1 mm lower stores more in its contacts; that is no motion, and none of it has been dissipated."""
    world = drawn(tmp_path, solver={"precision": "double"})
    before = world.observe().health
    world.set_tool_mesh("plate", box(tmp_path, "lower.stl", (0.06, 0.06, 0.004), up=-0.0001))
    after = world.observe().health
    assert after.elastic > 1.05 * before.elastic
    assert after.dissipated == pytest.approx(before.dissipated, abs=1e-9 * before.elastic)
    world.step(300)
    assert not [doubt for doubt in world.observe().health.doubts if "nowhere" in doubt]


def test_new_shape_is_what_grains_meet(tmp_path):
    """A block that reaches 8 mm further down presses the bed where the plate does not touch it yet."""
    world = World(load_scene(write_small_scene(tmp_path)))
    world.apply(ToolPose("plate", np.array([0.015, 0.015, 0.028]), NO_TURN, 0.1))
    world.step(round(0.1 / world.time_step))
    assert len(world.tool_contacts("plate")) == 0
    block = box(tmp_path, "block.stl", (0.06, 0.06, 0.012), up=-0.004)
    with pytest.raises(CommandError, match="cuts into 16 grains"):
        world.set_tool_mesh("plate", block)
    world.apply(ToolPose("plate", np.array([0.015, 0.015, 0.035]), NO_TURN, 0.2))
    world.step(round(0.1 / world.time_step))
    world.set_tool_mesh("plate", block)
    assert world.tools[0].mesh.bounds[0, 2] == pytest.approx(-0.01)
    world.apply(ToolPose("plate", np.array([0.015, 0.015, 0.031]), NO_TURN, 0.3))
    world.step(round(0.1 / world.time_step))
    contacts = world.tool_contacts("plate")
    assert len(contacts) > 10
    assert contacts.point[:, 2].max() < 0.031 - 0.01
    assert world.observe().tool("plate").force[2] > 0.0


@pytest.mark.parametrize(
    ("mesh", "scale", "reason", "message"),
    [
        ("nowhere.stl", 1.0, "bad_mesh", "tools.plate.mesh: .*nowhere.stl"),
        ("broken.stl", 1.0, "bad_mesh", "tools.plate.mesh"),
        ("deep.stl", 1.0, "blocked", r"cuts into \d+ grains by more than 0.1 of a radius, the deepest at"),
        ("plate.stl", 0.0, "bad_mesh", "scale must be positive"),
        ("plate.stl", np.nan, "bad_mesh", "scale must be positive"),
        ("plate.stl", 30.0, "too_large", "the domain is only 0.45 m wide"),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(tmp_path, mesh, scale, reason, message):
    world = drawn(tmp_path)
    (tmp_path / "broken.stl").write_bytes(b"solid nothing of the kind")
    box(tmp_path, "deep.stl", (0.06, 0.06, 0.02))
    world.observe()  # which renews contact lists
    before = world.save()
    with pytest.raises(CommandError, match=message) as error:
        world.set_tool_mesh("plate", mesh, scale)
    assert error.value.reason == reason
    assert same_state(world.save(), before)
    with pytest.raises(CommandError, match="'spade' is unknown"):
        world.set_tool_mesh("spade", "plate.stl")


def test_a_tool_that_asks_for_a_smaller_time_step_is_refused_and_changes_nothing(tmp_path, monkeypatch):
    """One of which a grain touches many particles at once; the sampler makes none such of the same radius."""
    world = drawn(tmp_path)
    fine = replace(world.tools[0], body=replace(world.tools[0].body, spacing=1e-4))
    monkeypatch.setattr("sand_sim.changes.tool_exchange.model_tool", lambda *options: fine)
    world.observe()
    before = world.save()
    with pytest.raises(CommandError, match=r"particles 0\.0001 m apart, which ask for a time step of") as error:
        world.set_tool_mesh("plate", "plate.stl")
    assert error.value.reason == "too_fine"
    assert same_state(world.save(), before)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_larger_tool_widens_the_lattice(tmp_path, precision):
    """A plate three times as wide, as of a grab that takes up a larger bucket: all else stays where it is to half a quantum."""
    world = drawn(tmp_path, solver={"precision": precision})
    world.apply(ToolPose("plate", np.array([0.02, 0.015, 0.08]), NO_TURN))
    world.step(round(0.1 / world.time_step))
    world.add_grains([[0.1, 0.1, 0.05]], 0.005)
    world.remove_grains([7])
    before, kept, quantum = world.observe(), memories(world), world.assembly.lattice.quantum
    state = world.save()
    world.set_tool_mesh("plate", box(tmp_path, "wide.stl", (0.18, 0.18, 0.004)))
    after, coarser = world.observe(), world.assembly.lattice.quantum
    assert 1.05 * quantum < coarser < 1.5 * quantum
    assert world.assembly.lattice.room > world.tools[0].extent
    assert np.array_equal(after.grains.identity, before.grains.identity)
    assert np.abs(after.grains.position - before.grains.position).max() <= 0.51 * coarser + 0.5 * quantum + 1e-16
    assert np.abs(after.grains.radius - before.grains.radius).max() <= 0.51 * coarser + 1e-9 * (precision == "single")
    found = memories(world)
    assert found.keys() == kept.keys()
    assert all(np.array_equal(found[key], kept[key]) for key in found)
    assert after.health.dissipated == pytest.approx(before.health.dissipated, rel=1e-12)
    assert after.health.elastic == pytest.approx(before.health.elastic, rel=1e-3)
    wide = world.save()
    world.step(200)
    expected = world.save()
    fresh = World(world.scene)
    fresh.restore(wide)
    fresh.step(200)
    assert same_state(fresh.save(), expected)
    world.restore(state)
    assert world.assembly.lattice.quantum == quantum
    assert same_state(world.save(), state)


def test_states_know_their_tools(tmp_path):
    world = drawn(tmp_path)
    loaded, scene = World(world.scene).save(), world.scene
    first = world.save()
    world.set_tool_mesh("plate", box(tmp_path, "lower.stl", (0.06, 0.06, 0.004), up=-0.0001))
    second = world.save()
    world.step(50)
    expected = world.save()
    world.restore(first)
    assert world.tools[0].tool.mesh == "plate.stl"
    fresh = World(scene)
    for one in (world, fresh):
        one.restore(second)
        assert one.tools[0].tool.mesh == "lower.stl"
        one.step(50)
        assert same_state(one.save(), expected)
        one.reset()
        assert one.tools[0].tool.mesh == "plate.stl"
        assert same_state(one.save(), loaded)


def test_a_state_names_no_mesh_outside_the_roots(tmp_path):
    """A file of a state may come from a stranger."""
    (tmp_path / "here").mkdir()
    (tmp_path / "outside").mkdir()
    path = write_small_scene(tmp_path / "here")
    secret = tmp_path / "outside" / "secret.stl"
    trimesh.creation.box((0.03, 0.03, 0.004)).export(secret)
    world = World(load_scene(path))
    world.set_tool_mesh("plate", str(secret))
    state, other = world.save(), World(load_scene(path))
    before = other.save()
    for put in (other.check_state, other.restore):
        with pytest.raises(SceneError, match="lies outside the folders"):
            put(state)
    assert same_state(other.save(), before)
    world.reset()
    world.restore(state)
    assert world.tools[0].mesh.extents == pytest.approx([0.03, 0.03, 0.004]), "its own"
