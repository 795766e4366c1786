"""Plungers: right momentum, right force, and that their own motion renews the contact lists."""

import numpy as np
import pytest
from scenes import floor

from sand_sim import World, read_scene

GRAVITY = 9.81
FREE = {"low": [-0.05, -0.05, -0.05], "high": [0.05, 0.05, 0.5]}


def plunger(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), **fields):
    entry = {"type": "plunger", "name": "plunger", "material": "wall", "point": list(point), "normal": list(normal)}
    return entry | fields


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("single", 1e-4)])
def test_plunger_gives_a_stack_the_right_momentum(make_world, precision, tolerance):
    """It lifts a stack at a given velocity: its impulse, work over velocity, is what the grains have and what gravity took.

    In single precision the velocities gather a rounding at every step.
    """
    radius, number, speed = 0.005, 6, 0.5
    position = [[0.0, 0.0, 2.02 * radius * (k + 0.5)] for k in range(number)]
    world = make_world(
        position,
        radius,
        gravity=[0.0, 0.0, -GRAVITY],
        restitution=0.1,
        friction=0.0,
        boundaries=[plunger(velocity=speed)],
        domain=FREE,
        precision=precision,
        integrator="symplectic_euler",
        threads=1,
    )
    for part in (0.01, 0.49):
        world.step(round(part / world.time_step))
        observation = world.observe()
        grains, health = observation.grains, observation.health
        mass = grains.mass.astype(float)
        impulse = float((mass * grains.velocity[:, 2]).sum() + mass.sum() * GRAVITY * world.time)
        assert health.tool_work / speed == pytest.approx(impulse, rel=tolerance)
        assert health.dissipated > 0.0
    assert grains.velocity[:, 2] == pytest.approx(np.full(number, speed), rel=1e-3)
    report = observation.wall("plunger")
    assert report.force[2] == pytest.approx(-mass.sum() * GRAVITY, rel=1e-3)
    assert report.position == pytest.approx([0.0, 0.0, speed * world.time])
    assert report.velocity == pytest.approx([0.0, 0.0, speed])


def test_a_pressed_plunger_that_meets_nothing_moves_as_a_free_mass(make_world):
    """``F t^2 / 2 M``, from the first step on."""
    force, mass = 1.0, 0.1
    world = make_world(
        [[0.0, 0.0, 0.005]],
        0.005,
        friction=0.0,
        boundaries=[*floor(), plunger(point=(0.0, 0.0, 0.4), normal=(0.0, 0.0, -1.0), force=force, mass=mass, max_speed=5.0)],
        domain=FREE,
        time_step=1e-5,
        force_time_step=True,
        threads=1,
    )
    for steps in (1, 99):
        world.step(steps)
        report = world.observe().wall("plunger")
        assert 0.4 - report.position[2] == pytest.approx(0.5 * force / mass * world.time**2, rel=1e-6)
        assert -report.velocity[2] == pytest.approx(force / mass * world.time, rel=1e-9)


def test_elastic_grain_leaves_a_plunger_at_twice_its_velocity(make_world):
    """It starts far away and at rest, so that nothing but the plunger's own travel can renew the contact lists."""
    speed = 2.0
    world = make_world(
        [[0.0, 0.0, 0.1]],
        0.005,
        restitution=1.0,
        friction=0.0,
        contact={"tangential": "none"},
        boundaries=[plunger(velocity=speed)],
        domain=FREE,
        threads=1,
    )
    world.step(round(0.06 / world.time_step))
    assert world.observe().grains.velocity[0] == pytest.approx([0.0, 0.0, 2.0 * speed], rel=1e-3)


def test_a_plunger_that_meets_a_grain_at_rest_makes_no_energy(make_world):
    """Looked at after every step, as for a tool."""
    radius, speed, restitution = 0.005, 0.5, 0.6
    world = make_world(
        [[0.0, 0.0, radius + 1e-4]],
        radius,
        restitution=restitution,
        friction=0.0,
        contact={"tangential": "none"},
        boundaries=[plunger(velocity=speed)],
        domain=FREE,
        threads=1,
    )
    for _ in range(round(2e-3 / world.time_step)):
        world.step()
        observation = world.observe()
        assert observation.health.doubts == ()
    mass = float(observation.grains.mass[0])
    assert observation.health.elastic == 0.0
    assert observation.health.tool_work == pytest.approx((1.0 + restitution) * mass * speed**2, rel=5e-3)


def hit_free_plunger(make_world, restitution, ratio):
    """A grain hits a plunger of ``ratio`` times its mass that no force drives; what is seen afterwards."""
    radius, speed = 0.005, 0.5
    mass = 2500.0 * 4 / 3 * np.pi * radius**3
    world = make_world(
        [[0.0, 0.0, 1.02 * radius]],
        radius,
        velocity=[0.0, 0.0, -speed],
        restitution=restitution,
        friction=0.0,
        boundaries=[plunger(force=0.0, mass=ratio * mass, max_speed=2.0)],
        domain=FREE,
        threads=1,
    )
    world.step(round(0.002 / world.time_step))
    return world.observe()


@pytest.mark.parametrize("ratio", [0.5, 1.0, 3.0])
def test_restitution_of_a_plunger_as_light_as_a_grain(make_world, ratio):
    """It yields, so that less mass is slowed down; momentum is shared."""
    after = hit_free_plunger(make_world, 0.5, ratio)
    grain, driven = after.grains.velocity[0, 2], after.wall("plunger").velocity[2]
    assert grain - driven == pytest.approx(0.5 * 0.5, abs=0.005 * 0.5)
    assert grain + ratio * driven == pytest.approx(-0.5, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 3.0])
def test_work_of_a_plunger_that_is_pushed_back(make_world, ratio):
    """Without damping, what it takes from the grain is what the grain loses."""
    after = hit_free_plunger(make_world, 1.0, ratio)
    before = 0.5 * float(after.grains.mass[0]) * 0.5**2
    assert after.health.kinetic - after.health.tool_work == pytest.approx(before, rel=2e-3)
    assert not after.health.doubts


def bed(make_world, press, side=4, layers=4, **further):
    """Frictionless grains in a box under a plunger."""
    pitch = 0.0105
    lattice = np.stack(np.meshgrid(range(side), range(side), range(layers), indexing="ij"), -1).reshape(-1, 3)
    position = pitch * lattice + 0.5 * pitch + np.random.default_rng(0).uniform(-2e-4, 2e-4, (len(lattice), 3))
    box = {"type": "box", "name": "box", "material": "wall", "low": [0, 0, 0], "high": [pitch * side, pitch * side, 0.2]}
    further = {"restitution": 0.2, "friction": 0.0, "gravity": [0.0, 0.0, -GRAVITY], "precision": "single"} | further
    return make_world(position, 0.005, boundaries=[box | {"open": ["top"]}, press], **further)


def test_floor_carries_weight_and_the_pressing_force(make_world):
    force = 2.0
    world = bed(make_world, plunger((0.0, 0.0, 0.05), (0.0, 0.0, -1.0), force=force, max_speed=2.0))
    world.step(round(1.2 / world.time_step))
    observation = world.observe()
    weight = observation.grains.mass.sum() * GRAVITY
    assert -observation.wall("box/bottom").force[2] == pytest.approx(weight + force, rel=1e-3)
    assert observation.wall("plunger").force == pytest.approx([0.0, 0.0, force], abs=1e-3 * force)
    assert np.abs(observation.wall("plunger").velocity).max() < 1e-4
    assert observation.wall("plunger").position[2] == pytest.approx(observation.grains.position[:, 2].max() + 0.005, abs=1e-4)
    health = observation.health
    assert health.tool_work == pytest.approx(force * (0.05 - observation.wall("plunger").position[2]), rel=0.01)
    assert health.dissipated > 0.0


@pytest.mark.parametrize(("tangential", "restitution"), [("mindlin", 0.5), ("mindlin", 0.05), ("none", 0.05)])
def test_a_light_lid_lies_still_on_a_layer_of_grains(make_world, tangential, restitution):
    """A twentieth of what they weigh, it has the contacts of all of them, and yields faster than any grain.

    It rattled at its top speed, which no balance of energy shows: a plunger has as much as its force gives it.
    """
    radius, side, overlap = 0.005, 6, 0.05  # of a radius, at rest
    layer = np.stack(np.meshgrid(range(side), range(side), indexing="ij"), -1).reshape(-1, 2)
    mass = 2500.0 * 4 / 3 * np.pi * radius**3 * side**2
    force = side**2 * 4 / 3 * 1e7 / (1.0 - 0.25**2) * radius**2 * overlap**1.5
    lid = plunger((0.0, 0.0, 2.0 * radius), (0.0, 0.0, -1.0), force=force, mass=0.0501 * mass, max_speed=1.0)
    world = make_world(
        2.0 * radius * np.column_stack([layer, np.full(len(layer), 0.5)]),
        radius,
        restitution=restitution,
        contact={"tangential": tangential},
        boundaries=[*floor(), lid],
        threads=1,
    )
    world.step(round(0.05 / world.time_step))
    for _ in range(10):
        world.step(7)
        observation = world.observe()
        assert np.abs(observation.wall("plunger").velocity).max() < 1e-9
        assert observation.wall("plunger").force[2] == pytest.approx(force, rel=1e-6)
    assert observation.health.doubts == ()


def test_floor_carries_four_sphere_grains_and_the_pressing_force(tmp_path):
    """Frictionless tetrahedra in a box: what they weigh is the mass of the union of their spheres."""
    force, low, high = 2.0, [0.0, 0.0, 0.0], [0.06, 0.06, 0.4]
    numbers = {"restitution": 0.2, "friction": 0.0}
    scene = {
        "materials": {"sand": {"density": 2500.0, "young": 1e7, "poisson": 0.25}},
        "pairs": [{"between": ["sand", "sand"]} | numbers],
        "fills": [
            {"material": "sand", "shape": "tetrahedron", "radius": 0.005, "region": {"low": low, "high": high}, "count": 50}
        ],
        "boundaries": [
            {"type": "box", "name": "box", "material": "sand", "low": low, "high": high, "open": ["top"]},
            plunger((0.0, 0.0, 0.15), (0.0, 0.0, -1.0), force=force, max_speed=1.0) | {"material": "sand"},
        ],
        "settle": {"time": 0.5, "speed": 1e-4},
    }
    world = World(read_scene(scene, tmp_path))
    world.step(round(1.0 / world.time_step))
    observation = world.observe()
    carried = observation.grains.mass.sum() * GRAVITY + force
    assert -observation.wall("box/bottom").force[2] == pytest.approx(carried, rel=1e-3)
    assert observation.wall("plunger").force[2] == pytest.approx(force, rel=1e-3)


def test_force_moves_a_free_plunger_as_a_mass_up_to_its_top_speed(make_world):
    press = plunger((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), force=3.0, mass=1.5, max_speed=0.1)
    world = make_world([[0.3, 0.0, 0.0]], 0.005, boundaries=[press], domain={"low": [-0.1] * 3, "high": [0.4] * 3}, threads=1)
    world.step(round(0.03 / world.time_step))
    report, time = world.observe().wall("plunger"), world.time
    assert report.velocity[0] == pytest.approx(2.0 * time, rel=1e-2)
    assert report.position[0] == pytest.approx(time**2, rel=1e-2)
    world.step(round(0.2 / world.time_step))
    assert world.observe().wall("plunger").velocity[0] == pytest.approx(0.1)


def test_travel_ends_the_motion(make_world):
    world = bed(make_world, plunger((0.0, 0.0, 0.05), (0.0, 0.0, -1.0), velocity=0.2, travel=0.016), threads=1)
    world.step(round(0.2 / world.time_step))
    report = world.observe().wall("plunger")
    assert report.position[2] == pytest.approx(0.034)
    assert not report.velocity.any()
    assert report.force[2] > 0.0


def test_plunger_waits_while_the_bed_settles_and_goes_back_on_reset(make_world):
    press = plunger((0.0, 0.0, 0.048), (0.0, 0.0, -1.0), velocity=0.1)
    world = bed(make_world, press, settle={"time": 0.05, "speed": 1e-4}, threads=1)
    start = world.observe()
    assert start.wall("plunger").position[2] == 0.048
    runs = []
    for _ in range(2):
        world.step(1000)
        runs.append(world.observe())
        world.reset()
    assert runs[0].wall("plunger").position[2] == pytest.approx(0.048 - 0.1 * runs[0].time)
    assert np.array_equal(runs[0].grains.position, runs[1].grains.position)
    assert np.array_equal(runs[0].wall("plunger").force, runs[1].wall("plunger").force)


def test_same_bits_on_any_number_of_threads(make_world):
    found = []
    for threads in (1, 2, 3):
        press = plunger((0.0, 0.0, 0.05), (0.0, 0.0, -1.0), force=5.0, max_speed=0.5)
        world = bed(make_world, press, side=6, friction=0.3, threads=threads)
        world.step(2000)
        found.append(world.observe())
    for other in found[1:]:
        assert np.array_equal(other.grains.position, found[0].grains.position)
        assert np.array_equal(other.wall("plunger").position, found[0].wall("plunger").position)
        assert other.health.tool_work == found[0].health.tool_work


def test_disc_presses_only_what_is_under_it(make_world):
    """A plunger with an edge comes down beside a grain and on another."""
    disc = plunger((0.0, 0.0, 0.03), (0.0, 0.0, -1.0), velocity=0.1, radius=0.02, travel=0.021)
    world = make_world(
        [[0.0, 0.0, 0.005], [0.0305, 0.0, 0.005]],
        0.005,
        gravity=[0.0, 0.0, -GRAVITY],
        boundaries=[*floor(), disc],
        domain={"low": [-0.1, -0.1, -0.02], "high": [0.1, 0.1, 0.1]},
        threads=1,
    )
    world.step(round(0.3 / world.time_step))
    observation = world.observe()
    weight = observation.grains.mass[0] * GRAVITY
    assert observation.grains.position[1] == pytest.approx([0.0305, 0.0, 0.005], abs=1e-5)
    assert observation.wall("plunger").force[2] == pytest.approx(-observation.wall("floor").force[2] - 2.0 * weight, rel=1e-3)
    assert observation.wall("plunger").force[2] > 10.0 * weight
