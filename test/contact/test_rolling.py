"""Rolling and twisting resistance against closed forms."""

import numpy as np
import pytest
import trimesh
from scenes import floor, record

RADIUS, YOUNG, POISSON, DENSITY, GRAVITY = 0.005, 1e7, 0.3, 2500.0, 9.81
MATERIAL = {"density": DENSITY, "young": YOUNG, "poisson": POISSON}
MASS = DENSITY * 4 / 3 * np.pi * RADIUS**3
INERTIA = 0.4 * MASS * RADIUS**2


def dent(weight):
    """Overlap [m] at which a floor carries a weight [N]."""
    return (3.0 * weight * (1.0 - POISSON**2) / (4.0 * YOUNG * np.sqrt(RADIUS))) ** (2.0 / 3.0)


def on_floor(make_world, law, slope=0.0, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), precision="double", **numbers):
    """A sphere in its own dent in a floor, under gravity tilted by a slope [rad]."""
    return make_world(
        [[0.0, 0.0, RADIUS - dent(MASS * GRAVITY * np.cos(slope))]],
        RADIUS,
        velocity=velocity,
        spin=spin,
        material=MATERIAL,
        gravity=[GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope)],
        boundaries=floor(),
        domain={"low": [-1.0, -0.1, -0.1], "high": [1.0, 0.1, 0.1]},
        contact=law,
        precision=precision,
        threads=1,
        numbers={"friction": 0.8} | numbers,
    )


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_rests_on_a_slope_up_to_its_rolling_friction(make_world, friction):
    """At rest for ``tan(slope) < mu_r``, beyond it rolls with ``a = 5/7 g (sin (1 - dent/r) - mu_r cos)``."""
    below, above = np.arctan(friction) * 0.97, np.arctan(friction) * 1.03
    world = on_floor(make_world, {"rolling": "spring"}, slope=below, rolling_friction=friction)
    world.step(round(0.4 / world.time_step))
    before = world.observe().grains
    world.step(round(1.0 / world.time_step))
    after = world.observe()
    assert np.abs(after.grains.position - before.position).max() < 1e-6 * RADIUS
    assert after.health.fastest < 1e-6

    world = on_floor(make_world, {"rolling": "spring"}, slope=above, rolling_friction=friction)
    world.step(round(0.2 / world.time_step))
    early, begin = world.observe().grains.velocity[0, 0], world.time
    world.step(round(0.2 / world.time_step))
    arm = 1.0 - dent(MASS * GRAVITY * np.cos(above)) / RADIUS
    expected = 5.0 / 7.0 * GRAVITY * (np.sin(above) * arm - friction * np.cos(above))
    assert (world.observe().grains.velocity[0, 0] - early) / (world.time - begin) == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("law", ["constant", "spring"])
def test_rolling_friction_slows_a_rolling_sphere(make_world, law):
    """``a = -5/7 mu_r g``."""
    friction, speed = 0.05, 0.3
    world = on_floor(
        make_world, {"rolling": law}, velocity=[speed, 0.0, 0.0], spin=[0.0, speed / RADIUS, 0.0], rolling_friction=friction
    )
    world.step(round(0.1 / world.time_step))
    early, begin = world.observe().grains.velocity[0, 0], world.time
    world.step(round(0.3 / world.time_step))
    late = world.observe().grains.velocity[0, 0]
    assert late > 0.1
    assert (late - early) / (world.time - begin) == pytest.approx(-5.0 / 7.0 * friction * GRAVITY, rel=5e-3)


@pytest.mark.parametrize(("friction", "radius", "speed", "span"), [(0.002, 2.5e-3, 1.0, 0.4), (0.1, 1e-7, 5e-5, 3e-5)])
def test_weak_resistance_is_not_lost_in_single_precision(make_world, friction, radius, speed, span):
    """``a = -5/7 mu_r g``, of which a step gives a few units in the last place of a velocity, also where grains are tiny."""
    weight = DENSITY * 4 / 3 * np.pi * radius**3 * GRAVITY
    depth = (3.0 * weight * (1.0 - POISSON**2) / (4.0 * YOUNG * np.sqrt(radius))) ** (2.0 / 3.0)
    room = max(10.0 * radius, 2.0 * speed * span)
    world = make_world(
        [[0.0, 0.0, radius - depth]],
        radius,
        velocity=[speed, 0.0, 0.0],
        spin=[0.0, speed / radius, 0.0],
        material=MATERIAL,
        gravity=[0.0, 0.0, -GRAVITY],
        boundaries=floor(),
        domain={"low": [-room] * 3, "high": [room] * 3},
        contact={"rolling": "spring"},
        numbers={"rolling_friction": friction},
        precision="single",
        threads=1,
    )
    world.step(round(span / 8 / world.time_step))
    early, begin = world.observe().grains.velocity[0, 0], world.time
    world.step(round(span / world.time_step))
    late = world.observe().grains.velocity[0, 0]
    assert (early - late) / (world.time - begin) == pytest.approx(5.0 / 7.0 * friction * GRAVITY, rel=5e-3)


def test_static_pile_does_not_rattle(make_world):
    """A pyramid without side walls stands still on rolling springs; on a torque whose sign follows the motion it does not."""
    layers = []
    for level, edge in enumerate((3, 2, 1)):
        row = 2.0 * RADIUS * (np.arange(edge) - 0.5 * (edge - 1))
        x, y = np.meshgrid(row, row)
        height = RADIUS * (1.0 + np.sqrt(2.0) * level)
        layers.append(np.column_stack([x.ravel(), y.ravel(), np.full(edge * edge, height)]))
    fastest = {}
    for law in ("spring", "constant"):
        world = make_world(
            np.concatenate(layers),
            RADIUS,
            material=MATERIAL,
            restitution=0.3,
            numbers={"friction": 0.6, "rolling_friction": 0.3},
            contact={"rolling": law},
            gravity=[0.0, 0.0, -GRAVITY],
            boundaries=floor(),
        )
        world.step(round(0.6 / world.time_step))
        observation = world.observe()
        fastest[law] = max(observation.health.fastest, RADIUS * np.abs(observation.grains.spin).max())
        top = observation.grains.position[-1]  # of a fallen pyramid, lower by half a radius
        assert top == pytest.approx([0.0, 0.0, RADIUS * (1.0 + 2.0 * np.sqrt(2.0))], abs=0.05 * RADIUS)
    assert fastest["spring"] < 1e-6
    assert fastest["constant"] > 10.0 * fastest["spring"]


def test_twisting_stops_a_spinning_top(make_world):
    """``2/3 a mu F_n`` stops a sphere that spins about the vertical; it does not wander."""
    friction, spin = 0.3, 5.0
    weight = MASS * GRAVITY
    patch = np.sqrt(RADIUS * dent(weight))
    expected = spin * INERTIA / (2.0 / 3.0 * patch * friction * weight)
    world = on_floor(make_world, {"twisting": "marshall"}, spin=[0.0, 0.0, spin], friction=friction)
    history = record(world, 100, round(1.2 * expected / 100 / world.time_step))
    time, rate = history["time"], history["spin"][:, 0, 2]
    first = int(np.argmax(rate < 0.0))
    stop = np.interp(0.0, [-rate[first - 1], -rate[first]], [time[first - 1], time[first]])
    assert stop == pytest.approx(expected, rel=1e-2)
    halfway = np.interp(0.5 * expected, time, rate)
    assert halfway == pytest.approx(0.5 * spin, rel=1e-2)
    assert np.abs(rate[-1]) < 0.2 * spin  # what the twisted patch gives back
    assert np.abs(history["velocity"]).max() < 1e-6


def test_twisting_is_not_lost_in_single_precision(make_world):
    """Its arm is the patch, so that a step takes a few units in the last place of a fast spin."""
    friction, spin, weight = 0.1, 500.0, MASS * GRAVITY
    world = on_floor(make_world, {"twisting": "marshall"}, spin=[0.0, 0.0, spin], friction=friction, precision="single")
    world.step(round(0.02 / world.time_step))
    early, begin = world.observe().grains.spin[0, 2], world.time
    world.step(round(0.1 / world.time_step))
    expected = 2.0 / 3.0 * np.sqrt(RADIUS * dent(weight)) * friction * weight / INERTIA
    late = world.observe().grains.spin[0, 2]
    assert (early - late) / (world.time - begin) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("particle", [0.001, 0.0004])
@pytest.mark.parametrize("surface", ["wall", "tool"])
def test_surfaces_of_particles_resist_rolling_as_flat_ones(make_world, tmp_path, surface, particle):
    """However fine the particles are; those hold a grain on slopes of a few hundredths by themselves."""
    friction = 0.3

    def moved(slope):
        further = {"boundaries": floor()}
        if surface == "wall":
            further["boundaries"][0]["rough"] = {"radius": particle, "spacing": 1.2 * particle}
        else:
            trimesh.creation.box((0.04, 0.04, 0.01)).export(tmp_path / "plate.stl")
            plate = {
                "mesh": "plate.stl",
                "material": "wall",
                "particle_radius": particle,
                "pose": {"position": [0.0, 0.0, -0.005]},
            }
            further = {"tools": {"plate": plate}}
        world = make_world(
            [[0.0, 0.0, RADIUS + particle]],
            RADIUS,
            material=MATERIAL,
            gravity=[GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope)],
            domain={"low": [-0.1] * 3, "high": [0.1] * 3},
            contact={"rolling": "spring"},
            threads=1,
            numbers={"friction": 1.0, "rolling_friction": friction},
            **further,
        )
        world.step(round(0.3 / world.time_step))  # into a dimple
        early = world.observe().grains.position[0, 0]
        world.step(round(0.1 / world.time_step))
        return world.observe().grains.position[0, 0] - early

    assert abs(moved(np.arctan(friction - 0.01))) < 1e-4 * RADIUS
    assert moved(np.arctan(friction + 0.08)) > RADIUS
