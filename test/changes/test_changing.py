"""Grains put into and taken out of a running world: nothing else changes, energy is accounted for, states fit."""

import numpy as np
import pytest
import yaml
from drawn import NO_TURN, drawn, memories, same_state
from scenes import SceneMaker, floor, write_small_scene

from sand_sim import CommandError, ToolPose, UnstableError, World, load_scene, read_scene
from sand_sim.changes.carrying_over import expect_layout
from sand_sim.changes.clearance import overlapping

SMALL = 0.005
CLEAR = np.array([[0.1, 0.1, 0.05], [0.1, 0.115, 0.05], [-0.1, 0.0, 0.2]])
DENSITY = 2600.0


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("radius", [SMALL, 0.012])  # the larger one lays the cells of grains and of the tool anew
def test_new_grains_leave_all_else_as_it_is(tmp_path, precision, radius):
    world = drawn(tmp_path, solver={"precision": precision})
    before, contacts, kept = world.observe(), world.tool_contacts("plate"), memories(world)
    place = CLEAR * [1.0, 1.7, 1.0]
    assert world.add_grains(place, radius, velocity=[0.0, 0.0, -0.1]).tolist() == [32, 33, 34]
    after = world.observe()
    for name in ("identity", "position", "radius", "mass"):
        assert np.array_equal(getattr(after.grains, name)[:32], getattr(before.grains, name)), name
    epsilon = 1e-6 if precision == "single" else 1e-13
    assert after.grains.velocity[:32] == pytest.approx(before.grains.velocity, abs=epsilon)  # forces are summed in other order
    assert after.grains.position[32:] == pytest.approx(place, abs=1e-9)
    assert after.grains.velocity[32:] == pytest.approx(np.tile([0.0, 0.0, -0.1], (3, 1)), abs=1e-8)
    found = memories(world)
    assert len(kept) > 20
    assert {name for name, *_ in kept} == {"pair", "wall", "tool"}
    assert found.keys() == kept.keys()
    assert all(np.array_equal(found[key], kept[key]) for key in kept)
    now = world.tool_contacts("plate")
    assert len(now) == len(contacts)
    assert now.wrench == pytest.approx(contacts.wrench, rel=1e-5)
    assert after.health.elastic == pytest.approx(before.health.elastic, rel=1e-6)
    assert (after.time, after.steps, after.health.retired) == (before.time, before.steps, before.health.retired)
    assert after.tool("plate").work == before.tool("plate").work
    assert after.tool("plate").swept == before.tool("plate").swept


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_energy_of_new_grains_is_accounted_for(tmp_path, integrator):
    world = drawn(tmp_path, solver={"integrator": integrator, "precision": "double"})
    before, total = world.observe().health, world.save()["start"][0]
    world.add_grains(CLEAR, SMALL, velocity=[[0.5, 0.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.2]])
    after = world.observe().health
    mass = DENSITY * 4.0 / 3.0 * np.pi * SMALL**3
    kinetic = 0.5 * mass * (0.25 + 0.09 + 0.04)
    height = mass * 9.81 * (CLEAR[:, 2] - world.assembly.lattice.centre[2]).sum()
    assert world.save()["start"][0] - total == pytest.approx(kinetic + height, rel=1e-9)
    assert after.kinetic - before.kinetic == pytest.approx(kinetic, rel=1e-6)
    tiny = 1e-9 * mass * 9.81
    assert after.dissipated == pytest.approx(before.dissipated, abs=tiny)
    assert after.potential == pytest.approx(before.potential, abs=tiny)
    assert after.gained == before.gained
    world.step(200)  # they fall freely meanwhile
    later, twin = world.observe().health, drawn(tmp_path, solver={"integrator": integrator, "precision": "double"})
    twin.step(200)
    share = 1e-3 * abs(later.dissipated) + 1e-4 * mass * 9.81 * 0.01
    assert later.dissipated == pytest.approx(twin.observe().health.dissipated, abs=share)
    assert not [doubt for doubt in later.doubts if "nowhere" in doubt]


def test_new_grain_falls_as_galilei_says(tmp_path):
    world = drawn(tmp_path, solver={"precision": "double"})
    (identity,) = world.add_grains([0.1, 0.1, 0.2], SMALL, velocity=[0.2, 0.0, 0.0])
    steps = 1000
    world.step(steps)
    grains, time = world.observe().grains, steps * world.time_step
    assert grains.identity[-1] == identity
    assert grains.position[-1] == pytest.approx([0.1 + 0.2 * time, 0.1, 0.2 - 0.5 * 9.81 * time**2], abs=1e-9)
    assert grains.velocity[-1] == pytest.approx([0.2, 0.0, -9.81 * time], abs=1e-9)


def test_new_grains_meet_the_others(tmp_path):
    """A grain dropped on the bed comes to rest on it, one beside it on the floor; another one stays in the plate's way."""
    world = World(load_scene(write_small_scene(tmp_path)))
    world.add_grains([[0.15, 0.15, 0.006]], SMALL)
    world.step(round(0.3 / world.time_step))
    shown = world.observe()
    assert shown.grains.position[-1, 2] == pytest.approx(SMALL, abs=1e-5)
    assert np.abs(shown.grains.velocity[-1]).max() < 1e-3
    assert not [doubt for doubt in shown.health.doubts if "nowhere" in doubt]


@pytest.mark.parametrize(
    ("asked", "reason", "message"),
    [
        ({"position": [[0.0, 0.0, 0.0049], [0.1, 0.1, 0.1]]}, "blocked", r"1 of 2 grains .* 1 overlap grains \(first at \[0, 0,"),
        ({"position": [[0.1, 0.1, 0.1], [0.1, 0.1, 0.109]]}, "blocked", "2 of 2 grains .* 2 overlap one another"),
        ({"position": [[0.1, 0.1, 0.0049]]}, "blocked", "1 overlap wall 'floor'"),
        ({"position": [[0.1, 0.1, -0.03]]}, "blocked", "1 overlap wall 'floor'"),
        ({"position": [[0.015, 0.015, 0.0699]]}, "blocked", "1 overlap tool 'plate'"),
        ({"position": [[0.015, 0.015, 0.06]]}, "blocked", "1 overlap tool 'plate'"),  # within it
        ({"position": [[0.1, 0.1, 0.1], [9.0, 0.0, 0.0]]}, "outside", r"1 of 2 grains \(first at \[9, 0, 0\] m\) are outside"),
        ({"position": [[0.1, 0.1, 0.1]], "material": "steel"}, "unknown_material", "'steel' has no grains .* known are sand"),
        ({"position": [[0.1, 0.1, 0.1]], "radius": 0.004}, "too_small", "1 of 1 grains are smaller than 0.005 m"),
        ({"position": [[0.1, 0.1, np.nan]]}, "not_finite", "must be finite"),
        ({"position": [[0.1, 0.1, 0.1]], "radius": [0.005, 0.006]}, "shape", "must fit"),
        ({"position": [[0.1, 0.1]]}, "shape", "must fit"),
        ({"position": "here"}, "shape", "must fit"),
        ({"position": [[0.1, 0.1, 0.1]], "velocity": [0.0, 0.0, 1e4]}, "too_fast", "at most"),
    ],
)
def test_senseless_grains_are_refused_and_change_nothing(tmp_path, asked, reason, message):
    world = World(load_scene(write_small_scene(tmp_path)))
    before = world.save()
    with pytest.raises(CommandError, match=message) as error:
        world.add_grains(**({"radius": SMALL} | asked))
    assert error.value.reason == reason
    assert same_state(world.save(), before)


def test_new_grains_may_be_as_fast_as_half_a_radius_a_step(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    limit = 0.5 * SMALL / world.time_step
    with pytest.raises(CommandError, match=r"1 of 2 grains \(first at \[0\.1, 0\.1, 0\.2\] m\) are too fast"):
        world.add_grains([CLEAR[0], [0.1, 0.1, 0.2]], SMALL, velocity=[[0.0, 0.0, 0.0], [0.0, 1.01 * limit, 0.0]])
    world.add_grains([CLEAR[0]], SMALL, velocity=[0.0, 0.99 * limit, 0.0])
    world.step()  # is not taken for a run that blows up


def test_new_grains_are_as_heavy_and_as_soft_as_their_material(tmp_path):
    parsed = yaml.safe_load(write_small_scene(tmp_path).read_text())
    np.savez(tmp_path / "one.npz", position=[[0.1, -0.1, 0.1]], radius=[SMALL])
    zinc, sand, steel = {"density": 7100.0, "young": 2e6, "poisson": 0.4}, *parsed["materials"].values()
    materials = {"sand": sand, "steel": steel, "zinc": zinc}  # grains' are numbered before that of walls
    numbers = {"restitution": 0.3, "friction": 0.3}
    pairs = [*parsed["pairs"], *({"between": ["zinc", other]} | numbers for other in materials)]
    fills = [*parsed["fills"], {"material": "zinc", "file": "one.npz"}]
    world = World(read_scene(parsed | {"materials": materials, "pairs": pairs, "fills": fills}, tmp_path))
    for material in ("sand", "zinc"):
        (number,) = world.add_grains([[0.1 + 0.05 * (material == "zinc"), 0.1, 1.21 * SMALL]], 1.2 * SMALL, material)
        grains = world.observe().grains
        density = grains.mass[number] / (4.0 / 3.0 * np.pi * (1.2 * SMALL) ** 3)
        assert density == pytest.approx(materials[material]["density"], rel=1e-6)
    with pytest.raises(CommandError, match="known are"):
        world.add_grains([CLEAR[0]], SMALL)
    world.step(round(0.4 / world.time_step))
    low, weight = 1.2 * SMALL - world.observe().grains.position[number, 2], grains.mass[number] * 9.81
    young = 1.0 / sum((1.0 - one["poisson"] ** 2) / one["young"] for one in (zinc, steel))
    assert low == pytest.approx((0.75 * weight / (young * np.sqrt(1.2 * SMALL))) ** (2.0 / 3.0), rel=0.01)  # Hertz


def test_what_has_moved_is_in_the_way_where_it_is_now(tmp_path):
    ram = {"type": "plunger", "name": "ram", "material": "steel", "point": [0, 0, 0.2], "normal": [0, 0, -1], "velocity": 0.2}
    world = World(load_scene(write_small_scene(tmp_path, boundaries=[ram])))
    old, new = np.array([0.015, 0.015, 0.06]), np.array([0.05, 0.05, 0.08])
    world.apply(ToolPose("plate", new, NO_TURN, 0.1))
    world.step(round(0.1 / world.time_step))
    low = 0.2 - 0.2 * world.time
    for place, name in ((new, "tool 'plate'"), ([0.1, 0.1, low - 0.99 * SMALL], "wall 'ram'")):
        with pytest.raises(CommandError, match=f"1 overlap {name}"):
            world.add_grains([place], SMALL)
    assert len(world.add_grains([old, [0.1, 0.1, low - 1.01 * SMALL]], SMALL)) == 2


def test_touching_is_not_overlapping(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    world.add_grains([[0.1, 0.1, SMALL], [0.11, 0.1, SMALL]], SMALL)
    assert len(world.observe().grains) == 34
    assert world.add_grains(np.zeros((0, 3)), SMALL).tolist() == []


def test_overlaps_equal_brute_force():
    random = np.random.default_rng(2)
    one, other = random.uniform(0.0, 1.0, (200, 3)), random.uniform(-0.2, 1.3, (500, 3))
    small, large = random.uniform(0.005, 0.05, 200), random.uniform(0.005, 0.12, 500)
    first, second = (np.concatenate(rows) for rows in zip(*overlapping(one, small, other, large), strict=True))
    near = np.linalg.norm(one[:, None] - other, axis=2) < small[:, None] + large
    expected = np.argwhere(near)
    assert len(expected) > 100
    assert sorted(zip(first.tolist(), second.tolist(), strict=True)) == [tuple(pair) for pair in expected.tolist()]


def test_many_overlaps_are_counted_in_little_memory_or_refused(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    with pytest.raises(CommandError, match=r"3000 of 3000 grains .* 3000 overlap one another"):
        world.add_grains(np.full((3000, 3), 0.1), SMALL)
    with pytest.raises(CommandError, match=r"1\.0e\+12 pairs .* ask for fewer") as refused:
        world.add_grains(np.full((1_000_000, 3), 0.1), SMALL)
    assert refused.value.reason == "crowded"
    assert len(world.observe().grains) == 32


def test_stored_energy_goes_with_a_grain(tmp_path):
    """Three grains in a row at rest, each 50 um inside the next: with the last one 8/15 E* sqrt(R*) d^(5/2) goes."""
    overlap, young, poisson = 5e-5, 1e7, 0.25
    row = np.outer(np.arange(3), [2 * SMALL - overlap, 0.0, 0.0])
    world = SceneMaker(tmp_path).world(row, SMALL, domain={"low": [-0.1] * 3, "high": [0.1] * 3})
    stored = 8.0 / 15.0 * 0.5 * young / (1.0 - poisson**2) * np.sqrt(0.5 * SMALL) * overlap**2.5
    before, total = world.observe().health, world.save()["start"][0]
    assert before.elastic == pytest.approx(2 * stored, rel=1e-3)
    world.remove_grains([2])
    after = world.observe().health
    assert before.elastic - after.elastic == pytest.approx(stored, rel=1e-3)
    assert total - world.save()["start"][0] == pytest.approx(stored, rel=1e-3)
    assert after.dissipated == pytest.approx(0.0, abs=1e-9 * stored)
    world.step(2000)
    assert world.observe().health.gained < 1e-3 * stored


def test_grains_that_go_take_their_energy_along(tmp_path):
    world = drawn(tmp_path, solver={"precision": "double"})
    before = world.observe()
    gone = world.remove_grains(identity=[1, 5, 31])
    after = world.observe()
    assert gone.tolist() == [1, 5, 31]
    assert len(after.grains) == 29
    assert not np.isin([1, 5, 31], after.grains.identity).any()
    assert after.health.retired == before.health.retired
    assert before.health.elastic > 1.01 * after.health.elastic
    assert after.health.dissipated == pytest.approx(before.health.dissipated, abs=1e-12 * before.health.elastic)
    world.step(300)
    assert not [doubt for doubt in world.observe().health.doubts if "nowhere" in doubt]


def test_box_takes_what_is_inside(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    cloud = world.observe().grains
    gone = world.remove_grains(box=([-1.0, -1.0, 0.01], [1.0, 0.012, 1.0]))
    expected = cloud.identity[(cloud.position[:, 2] > 0.01) & (cloud.position[:, 1] < 0.012)]
    assert gone.tolist() == expected.tolist()
    assert len(world.observe().grains) == 32 - len(expected)
    world.remove_grains(box=([-1.0] * 3, [1.0] * 3))
    world.step(100)
    assert len(world.observe().grains) == 0
    assert world.add_grains([[0.0, 0.0, 0.1]], SMALL).tolist() == [32]
    world.step(100)
    assert len(world.observe().grains) == 1


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"identity": [3, 77, 99]}, "2 of 3 grains are not in the domain: 77, 99"),
        ({"identity": [0.5]}, "whole numbers"),
        ({"identity": "all"}, "whole numbers"),
        ({"identity": [[1], [2, 3]]}, "remove_grains: identities: "),
        ({}, "either identities or a box"),
        ({"identity": [3], "box": ([0.0] * 3, [1.0] * 3)}, "either identities or a box"),
        ({"box": ([1.0] * 3, [0.0] * 3)}, "box"),
    ],
)
def test_senseless_removals_are_refused(tmp_path, asked, message):
    world = World(load_scene(write_small_scene(tmp_path)))
    before = world.save()
    with pytest.raises(CommandError, match=message):
        world.remove_grains(**asked)
    assert same_state(world.save(), before)


def test_states_fit_before_and_after(tmp_path):
    """Back to fewer grains and forth to more, in this world and in a fresh one, and on to the bit; reset is as loaded."""
    world = drawn(tmp_path)
    scene = world.scene
    fewer = world.save()
    world.step(100)
    without = world.save()
    world.restore(fewer)
    world.add_grains(CLEAR, SMALL)
    world.step(30)
    world.remove_grains(identity=[3, 33])
    world.add_grains([[0.1, -0.1, 0.05]], 0.006)
    more = world.save()
    world.step(100)
    expected = world.save()
    assert world.observe().grains.identity.tolist() == [k for k in range(36) if k not in (3, 33)]
    world.restore(more)
    world.step(100)
    assert same_state(world.save(), expected)
    world.restore(fewer)
    world.step(100)
    assert same_state(world.save(), without)
    fresh = World(scene)
    loaded = fresh.save()
    fresh.restore(more)
    fresh.step(100)
    assert same_state(fresh.save(), expected)
    for one in (world, fresh):
        one.reset()
        assert same_state(one.save(), loaded)
        assert one.add_grains(CLEAR[:1], SMALL).tolist() == [32]


def test_state_of_another_scene_is_refused(tmp_path):
    maker, wide = SceneMaker(tmp_path), {"domain": {"low": [-1.0] * 3, "high": [1.0] * 3}, "boundaries": floor()}
    one = World(read_scene(maker.scene([[0.0, 0.0, 0.1], [0.1, 0.0, 0.1]], SMALL, **wide), tmp_path))
    other = World(read_scene(maker.scene([[0.0, 0.0, 0.1]], SMALL, **wide), tmp_path))
    before = other.save()
    with pytest.raises(ValueError, match="2 spheres and 0 tools, this scene 1 spheres, 0 added later"):
        other.restore(one.save())
    with pytest.raises(ValueError, match="it has 0 spheres"):
        other.restore({})
    springs = {"contact": {"rolling": "spring"}, "numbers": {"rolling_friction": 0.1}}
    law = World(read_scene(maker.scene([[0.0, 0.0, 0.1]], SMALL, **wide, **springs), tmp_path))
    unsigned = {name: rows for name, rows in law.save().items() if name != "scene"}  # as older states are
    with pytest.raises(ValueError, match=r"array '.*memory' is float"):
        other.restore(unsigned)
    rough = World(read_scene(maker.scene([[0.0, 0.0, 0.1]], SMALL, **wide, numbers={"friction": 0.9}), tmp_path))
    for put in (other.restore, other.check_state):
        with pytest.raises(ValueError, match="state: is of another scene: a material, law, wall, mesh or other field differs"):
            put(rough.save())
    assert same_state(other.save(), before)


def test_layout_of_a_state_is_told_by_what_was_added(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    loaded = world.save()
    world.add_grains(CLEAR, SMALL)
    state = world.save()
    like = expect_layout(loaded, state)
    assert like.keys() == state.keys()
    listed = ("owner", "partner", "memory", "order")
    for name, rows in state.items():
        assert rows.dtype == like[name].dtype, name
        assert rows.shape == like[name].shape or name.split(".")[-1] in listed, name
    for name, wrong in (("radius", -1.0), ("radius", np.nan), ("material", 7)):
        with pytest.raises(ValueError, match="added"):
            world.restore(state | {f"added.{name}": np.full(3, wrong)})
    with pytest.raises(ValueError, match="added"):
        world.restore(state | {"added.density": np.ones(2)})
    assert same_state(world.save(), state)


def test_blown_up_run_falls_back_to_the_moment_after(tmp_path, monkeypatch):
    world = drawn(tmp_path)
    world.add_grains(CLEAR, SMALL)
    after = world.save()

    def blow_up(steps):
        raise UnstableError("gone")

    with monkeypatch.context() as patch:
        patch.setattr(world.assembly.solver, "run", blow_up)
        with pytest.raises(UnstableError, match="gone; kept is the state at"):
            world.step(10)
    assert same_state(world.save(), after)
    world.step(10)


def test_clumps_and_bodies_come_along(tmp_path):
    """Beside clumps and a free body: new grains count on behind them, and what goes takes spin and stored energy along."""
    parsed = {
        "fills": [
            {"material": "sand", "shape": "tetrahedron", "radius": 0.005, "count": 20, "seed": 1}
            | {"region": {"low": [0.0, 0.0, 0.002], "high": [0.05, 0.05, 0.1]}}
        ],
        "bodies": {"ball": {"spheres": [[0.0, 0.0, 0.0, 0.008]], "material": "sand", "pose": {"position": [0.1, 0.1, 0.0081]}}},
        "solver": {"precision": "double"},
    }
    world = World(load_scene(write_small_scene(tmp_path, **parsed)))
    world.step(round(0.1 / world.time_step))
    before = world.observe()
    assert np.abs(before.grains.spin).max() > 1.0
    assert world.add_grains([[-0.1, 0.0, 0.1]], SMALL).tolist() == [21]
    with pytest.raises(CommandError, match="overlap"):
        world.add_grains([before.body("ball").position], SMALL)
    after = world.observe()
    assert np.array_equal(after.grains.orientation[:21], before.grains.orientation)
    assert after.body("ball").position == pytest.approx(before.body("ball").position, abs=0.0)
    tiny = 1e-9 * before.health.kinetic
    assert after.health.dissipated == pytest.approx(before.health.dissipated, abs=tiny)
    assert world.remove_grains(box=([-1.0] * 3, [1.0] * 3)).tolist() == [*range(20), 21]
    left = world.observe()
    assert left.grains.identity.tolist() == [20]
    assert left.health.dissipated == pytest.approx(before.health.dissipated, abs=tiny)
    world.step(50)
    world.reset()
    assert len(world.observe().grains) == 21


def test_new_grains_leave_contacts_of_a_smooth_tool(tmp_path):
    path = write_small_scene(tmp_path)
    scene = yaml.safe_load(path.read_text())
    scene["tools"]["plate"]["contact"] = "smooth"
    path.write_text(yaml.safe_dump(scene))
    world = World(load_scene(path))
    for at, position in ((0.1, [0.015, 0.015, 0.0214]), (0.2, [0.025, 0.015, 0.0214])):
        world.apply(ToolPose("plate", np.array(position), NO_TURN, at))
        world.step(round((min(at, 0.15) - world.time) / world.time_step))
    before, kept = world.tool_contacts("plate"), world.save()
    world.add_grains(CLEAR, SMALL)
    after, now = world.tool_contacts("plate"), world.save()
    assert len(before) > 3
    assert len(set(before.identity)) == len(before)
    one, other = np.argsort(before.identity), np.argsort(after.identity)
    assert np.array_equal(after.identity[other], before.identity[one])
    assert np.array_equal(after.force[other], before.force[one])
    for name in ("memory", "touch"):  # in whatever order
        assert np.any(kept[f"tool.{name}"])
        assert {row.tobytes() for row in now[f"tool.{name}"]} == {row.tobytes() for row in kept[f"tool.{name}"]}
    world.step(200)
    assert world.tool_contacts("plate").wrench[0] == pytest.approx(before.wrench[0], rel=0.5)
