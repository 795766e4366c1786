"""A free rigid body put somewhere else at once: as if the scene had it there, and all else goes on."""

import numpy as np
import pytest
import trimesh
from drawn import drawn, memories, same_state

from sand_sim import CommandError, World

TURNED = np.array([0.0, np.sin(0.3), 0.0, np.cos(0.3)])
DUMBBELL = {"spheres": [[-0.01, 0, 0, 0.01], [0.012, 0, 0, 0.008]], "material": "sand"}
START, FAR = [-0.1, -0.1, 0.2], np.array([-0.1, 0.1, 0.15])
GRAVITY = 9.81


def with_bodies(tmp_path, **further):
    """The small scene in the middle of a motion, with a body of spheres and one of a mesh that fall."""
    trimesh.creation.box((0.02, 0.03, 0.01)).export(tmp_path / "brick.stl")
    brick = {"mesh": "brick.stl", "material": "sand", "particle_radius": 0.003, "pose": {"position": [0.15, 0.15, 0.25]}}
    bodies = {"bell": DUMBBELL | {"pose": {"position": START}}, "brick": brick}
    return drawn(tmp_path, bodies=bodies, **further)


def body(world, name="bell"):
    return next(report for report in world.observe().bodies if report.name == name)


@pytest.mark.parametrize("name", ["bell", "brick"])
@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_it_flies_from_there_as_galilei_and_euler_say(tmp_path, name, integrator):
    world = with_bodies(tmp_path, solver={"precision": "double", "integrator": integrator})
    model = next(model for model in world.assembly.bodies if model.body.name == name)
    velocity, about = np.array([0.3, -0.2, 0.4]), np.array([0.0, 0.0, 5.0])
    axis = model.shape.axes[:, 2]  # about a principal axis it turns evenly
    world.place_body(name, FAR, velocity=velocity, spin=np.linalg.norm(about) * axis, orientation=[0.0, 0.0, 0.0, 1.0])
    at = body(world, name)
    assert at.position == pytest.approx(FAR, abs=1e-9)
    assert at.velocity == pytest.approx(velocity, abs=1e-9)
    assert at.spin == pytest.approx(5.0 * axis, abs=1e-9)
    steps = 100
    world.step(steps)
    time, later = steps * world.time_step, body(world, name)
    falls = 0.5 * GRAVITY * time * (time if integrator == "velocity_verlet" else time + world.time_step)
    centre = FAR + model.shape.middle + velocity * time - [0.0, 0.0, falls]
    turn = np.array([*(np.sin(2.5 * time) * axis), np.cos(2.5 * time)])
    assert abs(later.orientation @ turn) == pytest.approx(1.0, abs=1e-9)
    x, y, z, w = later.orientation
    arm = model.shape.middle + 2.0 * np.cross([x, y, z], np.cross([x, y, z], model.shape.middle) + w * model.shape.middle)
    assert later.position + arm == pytest.approx(centre, abs=1e-7)
    assert later.velocity == pytest.approx(velocity - [0.0, 0.0, GRAVITY * time], abs=1e-9)


def test_all_else_stays_and_energy_is_accounted_for(tmp_path):
    world = with_bodies(tmp_path, solver={"precision": "double"})
    before, kept, contacts = world.observe(), memories(world), world.tool_contacts("plate")
    was = body(world)
    world.place_body("bell", FAR, TURNED, velocity=[0.0, 0.0, 1.0])
    after, found = world.observe(), memories(world)
    others = before.grains.identity != 32
    assert np.array_equal(after.grains.identity, before.grains.identity)
    assert np.array_equal(after.grains.position[others], before.grains.position[others])
    assert found.keys() == kept.keys()
    assert all(np.array_equal(found[key], kept[key]) for key in found)
    assert world.tool_contacts("plate").wrench == pytest.approx(contacts.wrench, rel=1e-12)
    gained = 0.5 * was.mass * (1.0 - was.velocity @ was.velocity)
    assert after.health.kinetic - before.health.kinetic == pytest.approx(gained, rel=1e-6)
    assert after.health.dissipated == pytest.approx(before.health.dissipated, rel=1e-9)
    assert after.health.retired == before.health.retired
    assert (after.time, after.steps, after.tool("plate").work) == (before.time, before.steps, before.tool("plate").work)
    world.step(200)
    assert not [doubt for doubt in world.observe().health.doubts if "nowhere" in doubt]


@pytest.mark.parametrize("threads", [1, 2])
def test_it_comes_to_rest_on_the_floor(tmp_path, threads):
    """On the floor, leaning from its larger sphere to the smaller one; a state of then knows where it is."""
    world = with_bodies(tmp_path, solver={"precision": "double", "threads": threads})
    world.place_body("bell", [-0.1, 0.1, 0.0101])
    world.step(round(0.4 / world.time_step))
    at = body(world)
    assert at.position[2] == pytest.approx(0.01 - 0.002 * 10.0 / 22.0, abs=1e-4)
    assert np.linalg.norm(at.velocity) < 0.05
    state, fresh = world.save(), World(world.scene)
    world.step(50)
    fresh.restore(state)
    fresh.step(50)
    assert same_state(fresh.save(), world.save())
    world.reset()
    assert body(world).position == pytest.approx(START)


def test_one_that_has_left_the_domain_comes_back(tmp_path):
    world = with_bodies(tmp_path)
    world.place_body("bell", FAR, velocity=[-5.0, 0.0, 0.0])
    world.step(round(0.05 / world.time_step))
    gone = world.observe()
    assert [report.name for report in gone.bodies] == ["brick"]
    assert gone.health.retired == 1
    world.place_body("bell", FAR, TURNED)
    back = world.observe()
    assert [report.name for report in back.bodies] == ["bell", "brick"]
    assert body(world).orientation == pytest.approx(TURNED)
    assert back.health.dissipated == pytest.approx(gone.health.dissipated, abs=1e-6 * gone.health.kinetic)
    world.step(100)
    assert body(world).velocity[2] == pytest.approx(-GRAVITY * 100 * world.time_step, rel=1e-5)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"body": "rock"}, "body 'rock' is unknown; known are bell, brick"),
        ({"position": [0.0, 0.0]}, "body 'bell': position must be 3 numbers"),
        ({"position": "here"}, "body 'bell': position must be 3 numbers"),
        ({"velocity": 1.0}, "body 'bell': velocity must be 3 numbers"),
        ({"spin": [0.0, np.nan, 0.0]}, "body 'bell': spin must be finite"),
        ({"orientation": [0.0] * 4}, "body 'bell': orientation is"),
        ({"position": [0.0, 0.0, 5.0]}, "body 'bell': its centre would be at .* the domain is"),
        ({"velocity": [900.0, 0.0, 0.0]}, "body 'bell': a sphere of it would cross half its radius in a step"),
        ({"position": [0.015, 0.015, 0.01]}, "body 'bell' has no room there: it overlaps grains"),
        ({"position": [-0.1, -0.1, 0.005]}, "body 'bell' has no room there: it overlaps wall 'floor'"),
        ({"position": [0.025, 0.015, 0.03]}, "body 'bell' has no room there: it overlaps tool 'plate'"),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(tmp_path, asked, message):
    world = with_bodies(tmp_path)
    world.observe()
    before = world.save()
    with pytest.raises(CommandError, match=message):
        world.place_body(**{"body": "bell", "position": FAR} | asked)
    assert same_state(world.save(), before)
    brick = body(world, "brick")
    with pytest.raises(CommandError, match=r"overlaps (grains, )?body 'brick'"):
        world.place_body("bell", brick.position)
    world.place_body("bell", body(world).position + [0.005, 0.0, 0.0])  # where it would overlap itself


def test_what_is_left_out_stays_as_it_is(tmp_path):
    world = with_bodies(tmp_path, solver={"precision": "double"})
    world.place_body("bell", FAR, TURNED, [0.3, 0.0, 0.0], [0.0, 2.0, 0.0])
    world.place_body("bell", None, velocity=None, spin=[0.0, 0.0, 1.0])
    at = body(world)
    assert at.position == pytest.approx(FAR, abs=1e-9)
    assert at.orientation == pytest.approx(TURNED, abs=1e-9)
    assert at.velocity == pytest.approx([0.3, 0.0, 0.0], abs=1e-9)
    assert at.spin == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    world.place_body("bell", FAR)
    assert np.concatenate([body(world).velocity, body(world).spin]) == pytest.approx(np.zeros(6), abs=1e-12)
