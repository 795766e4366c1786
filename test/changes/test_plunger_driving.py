"""Plungers that are driven otherwise in a running world: their motion in closed form, and energy that is accounted for."""

import numpy as np
import pytest
from scenes import floor

from sand_sim import CommandError
from sand_sim.integrator import INTEGRATORS

MASS, STEP = 0.1, {"time_step": 1e-4, "force_time_step": True}
FREE = {"low": [-0.05, -0.05, -0.05], "high": [0.05, 0.05, 0.5]}


def lid(height, **drive):
    entry = {"type": "plunger", "name": "lid", "material": "wall", "point": [0.0, 0.0, height], "normal": [0.0, 0.0, -1.0]}
    return entry | drive


def falls(world, height):
    """How far it has come down, and how fast it is."""
    report = world.observe().wall("lid")
    return np.array([height - report.position[2], -report.velocity[2]])


@pytest.fixture
def make_press(make_world):
    """One grain on a floor, and a lid above it."""

    def make(height=0.4, friction=0.0, **further):
        drive = {"force": 1.0, "mass": MASS, "max_speed": 5.0}
        drive = further.pop("drive", drive)
        further = {"restitution": 0.5, "domain": FREE, "threads": 1, "boundaries": [*floor(), lid(height, **drive)]} | further
        return make_world([[0.0, 0.0, 0.005]], 0.005, friction=friction, **further)

    return make


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_lid_in_the_air_goes_on_as_each_force_and_velocity_say(make_press, integrator):
    """``s += v t + F t^2 / 2 M``, ``v += F t / M``, exactly at all times, whenever the force changes; held, it stands."""
    world = make_press(integrator=integrator, **STEP)
    place, speed = 0.0, 0.0
    for force, steps in ((1.0, 100), (3.0, 50), (-2.0, 80)):
        world.drive_plunger("lid", force=force)
        world.step(steps)
        time = steps * world.time_step
        place, speed = place + speed * time + 0.5 * force / MASS * time**2, speed + force / MASS * time
        assert falls(world, 0.4) == pytest.approx([place, speed], rel=1e-9)
    world.drive_plunger("lid", velocity=-0.5)
    world.step(40)
    place -= 0.5 * 40 * world.time_step
    assert falls(world, 0.4) == pytest.approx([place, -0.5], rel=1e-9)
    world.drive_plunger("lid", force=1.0)
    world.step(60)
    time = 60 * world.time_step
    place, speed = place - 0.5 * time + 0.5 / MASS * time**2, -0.5 + time / MASS
    assert falls(world, 0.4) == pytest.approx([place, speed], rel=1e-9)
    world.drive_plunger("lid", velocity=0.0)
    world.step(60)
    assert falls(world, 0.4) == pytest.approx([place, 0.0], rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_floor_bears_each_load_and_energy_is_accounted_for(make_press, integrator):
    """Loaded, unloaded, loaded again, as in an oedometer."""
    drive = {"force": 1.0, "mass": 0.003, "max_speed": 5.0}
    world = make_press(height=0.01, gravity=[0.0, 0.0, -9.81], integrator=integrator, restitution=0.2, drive=drive)
    weight = float(world.observe().grains.mass[0]) * 9.81
    for force in (1.0, 5.0, 2.0, 5.0):
        world.drive_plunger("lid", force=force)
        world.step(round(0.1 / world.time_step))
        seen = world.observe()
        assert -seen.wall("floor").force[2] == pytest.approx(force + weight, rel=1e-3)
        assert seen.wall("lid").force[2] == pytest.approx(force, rel=1e-3)
    assert seen.health.gained < 1e-6 * seen.health.elastic
    assert seen.health.dissipated > 0.0
    stood = seen.wall("lid").position[2]
    world.drive_plunger("lid", velocity=0.0)
    world.step(round(0.05 / world.time_step))
    held = world.observe()
    assert held.wall("lid").position[2] == pytest.approx(stood, abs=1e-9), "and it no longer yields"
    assert held.health.gained < 1e-6 * held.health.elastic


def test_states_know_how_a_plunger_is_driven_and_a_reset_brings_the_first_force_back(make_press):
    world = make_press(**STEP)
    world.drive_plunger("lid", force=3.0)
    world.step(50)
    state = world.save()
    world.step(50)
    there = falls(world, 0.4)
    world.drive_plunger("lid", velocity=0.0)
    world.restore(state)
    world.step(50)
    assert np.array_equal(falls(world, 0.4), there)
    world.reset()
    world.step(100)
    assert falls(world, 0.4)[1] == pytest.approx(1.0 / MASS * world.time, rel=1e-9)


def test_a_plunger_that_moved_at_a_velocity_is_pressed_with_the_mass_of_the_grains(make_press):
    world = make_press(drive={"velocity": 0.2}, **STEP)
    world.step(10)
    mass = float(world.observe().grains.mass[0])
    with pytest.raises(CommandError, match="plunger 'lid': a force needs a max_speed"):
        world.drive_plunger("lid", force=1e-3)
    world.drive_plunger("lid", force=1e-3, max_speed=4.0)
    world.step(20)
    assert falls(world, 0.4)[1] == pytest.approx(0.2 + 1e-3 / mass * 20 * world.time_step, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "how", "told"),
    [
        ("press", {"force": 1.0}, "plunger 'press' is unknown; known are lid"),
        ("lid", {}, "plunger 'lid': give exactly one of 'force' .N. and 'velocity'"),
        ("lid", {"force": 1.0, "velocity": 1.0}, "plunger 'lid': give exactly one of"),
        ("lid", {"force": np.nan}, "plunger 'lid': force must be finite"),
        ("lid", {"velocity": "fast"}, "plunger 'lid': velocity must be a number"),
        ("lid", {"velocity": 1e6}, "plunger 'lid': velocity must be at most"),
        ("lid", {"velocity": 1.0, "max_speed": 1.0}, "plunger 'lid': max_speed goes with 'force'"),
        ("lid", {"force": 1.0, "max_speed": -1.0}, "plunger 'lid': a force needs a max_speed"),
    ],
)
def test_what_makes_no_sense_is_refused_and_changes_nothing(make_press, name, how, told):
    world = make_press(**STEP)
    before = world.save()
    with pytest.raises(CommandError, match=told):
        world.drive_plunger(name, **how)
    after = world.save()
    assert all(np.array_equal(after[key], before[key]) for key in before)
