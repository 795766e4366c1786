"""Few bodies: equilibrium, bouncing, conservation, reproducibility."""

import numpy as np
import pytest
from scenes import floor, record

from sand_sim import SceneError

SAND = {"density": 2650.0, "young": 1e7, "poisson": 0.3}
GRAVITY = [0.0, 0.0, -9.81]
HIGH = {"low": [-0.1, -0.1, -0.01], "high": [0.1, 0.1, 0.4]}


@pytest.mark.parametrize("precision", ["double", "single"])
def test_stack_of_ten(make_world, precision):
    """Ten equal Hertz spheres on a rigid floor; overlaps follow from the weights above."""
    radius, number, start = 0.005, 10, 0.0
    position = np.column_stack([np.zeros(number), np.zeros(number), start + radius * (2.0 * np.arange(number) + 1.0) * 0.9985])
    world = make_world(
        position,
        radius,
        material=SAND,
        restitution=0.2,
        friction=0.0,
        gravity=[0.0, 0.0, -9.81],
        boundaries=floor(),
        precision=precision,
    )
    world.step(round(0.6 / world.time_step))
    observation = world.observe()
    z = observation.grains.position[:, 2]
    assert observation.health.fastest < 1e-5
    assert radius - z[0] == pytest.approx(25.844e-6, rel=1e-3)
    assert 2.0 * radius - (z[1] - z[0]) == pytest.approx(48.181e-6, rel=1e-3)
    assert 2.0 * radius - (z[9] - z[8]) == pytest.approx(11.136e-6, rel=1e-3)
    assert z[9] == pytest.approx(94.6913e-3, rel=1e-6)
    assert -observation.wall("floor").force[2] == pytest.approx(0.136117, rel=1e-3)


def test_bouncing_ball(make_world):
    """The n-th peak is ``e^(2n) h0``, all is over after ``sqrt(2 h0/g) (1+e)/(1-e)``, then the ball lies in its own dent.

    From the third bounce on gravity during the contact tells: peaks are lower by more than 1 %, whatever the time step.
    """
    radius, height, restitution, young = 0.005, 0.02, 0.7, 1e8
    world = make_world(
        [[0.0, 0.0, radius + height]],
        radius,
        material=SAND | {"young": young},
        restitution=restitution,
        friction=0.0,
        gravity=[0.0, 0.0, -9.81],
        boundaries=floor(),
        domain={"low": [-0.1, -0.1, -0.05], "high": [0.1, 0.1, 0.1]},
        precision="single",
        time_step=2e-6,  # a 25th of the first contact
        threads=1,
    )
    falls = np.sqrt(2.0 * height / 9.81)
    over = falls * (1.0 + restitution) / (1.0 - restitution)
    every = 200
    history = record(world, round(1.05 * over / world.time_step / every), every)
    z, time = history["position"][:, 0, 2] - radius, history["time"]
    ends = falls * (1.0 + 2.0 * np.cumsum(restitution ** np.arange(1, 3)))
    for n, (begin, end) in enumerate(zip([falls, *ends[:-1]], ends, strict=True), start=1):
        during = (time > begin) & (time < end)
        assert z[during].max() == pytest.approx(restitution ** (2 * n) * height, rel=1e-2)
    weight = 2650.0 * 4 / 3 * np.pi * radius**3 * 9.81
    dent = (3.0 * weight * (1.0 - 0.3**2) / (4.0 * young * np.sqrt(radius))) ** (2.0 / 3.0)
    assert time[z > 0.0][-1] == pytest.approx(over, rel=2e-2)
    world.step(round(0.1 / world.time_step))
    assert radius - world.observe().grains.position[0, 2] == pytest.approx(dent, rel=1e-3)


@pytest.mark.parametrize("x", [0.11, 0.5, -3.0])
def test_grains_that_start_outside_of_the_domain_are_refused(make_world, x):
    """Those next to it and those beyond all lattice coordinates; the good ones are not lost instead."""
    with pytest.raises(SceneError, match="domain: 1 of 3 grains start outside of it, the first at"):
        make_world([[0.0, 0.0, 0.1], [x, 0.0, 0.1], [0.0, 0.0, 0.2]], 0.005, domain=HIGH, precision="single")


@pytest.mark.parametrize("far", [1e7, 1e30])
def test_a_domain_in_which_grains_get_lost_is_refused(make_world, far):
    """Such as somebody gives who means an endless one; kernels crashed in it."""
    with pytest.raises(
        SceneError, match=r"domain: positions are resolved to .* the smallest radius is 0\.005 m; make it smaller"
    ):
        domain = {"low": [-far] * 3, "high": [far] * 3}
        make_world([[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]], 0.005, domain=domain, precision="single")


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
@pytest.mark.parametrize(("young", "speed"), [(1e9, 3.0), (7e10, 1.2)])
def test_short_steps_fall_as_fast_as_long_ones(make_world, young, speed, integrator):
    """A step of gravity is a few units in the last place of a float32 velocity; rounded alike each time, it would not be 9.81."""
    world = make_world(
        [[0.0, 0.0, 0.3]],
        0.0005,
        velocity=[0.0, 0.0, -speed],
        material=SAND | {"young": young},
        gravity=GRAVITY,
        boundaries=floor(),
        domain=HIGH,
        precision="single",
        integrator=integrator,
    )
    assert 9.81 * world.time_step < 60 * np.spacing(np.float32(speed))
    world.step(5000)
    velocity = world.observe().grains.velocity[0, 2]
    assert -(velocity + speed) / world.time == pytest.approx(9.81, rel=1e-4)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_grain_that_creeps_less_than_a_quantum_a_step_arrives(make_world, precision):
    quantum = make_world([[0.0, 0.0, 0.1]], 0.005, precision=precision, domain=HIGH).assembly.lattice.quantum
    speed = 0.2 * quantum / 1e-5
    world = make_world([[0.0, 0.0, 0.1]], 0.005, velocity=[0.0, speed, 0.0], precision=precision, domain=HIGH, time_step=1e-5)
    assert world.assembly.lattice.quantum == quantum
    world.step(1000)
    assert world.observe().grains.position[0, 1] == pytest.approx(200.0 * quantum, abs=1.01 * quantum)


def test_short_steps_slow_a_sliding_sphere(make_world):
    """By ``mu g``, while it takes up spin at ``5/2 mu g/R``."""
    radius, friction, young = 0.0005, 0.3, 1e9
    mass = 2650.0 * 4 / 3 * np.pi * radius**3
    dent = (3.0 * mass * 9.81 * (1.0 - 0.3**2) / (4.0 * young * np.sqrt(radius))) ** (2.0 / 3.0)
    world = make_world(
        [[0.0, 0.0, radius - dent]],
        radius,
        velocity=[1.0, 0.0, 0.0],
        material=SAND | {"young": young},
        friction=friction,
        gravity=GRAVITY,
        boundaries=floor(),
        domain=HIGH,
        precision="single",
    )
    world.step(round(0.01 / world.time_step))
    grains = world.observe().grains
    assert (1.0 - grains.velocity[0, 0]) / world.time == pytest.approx(friction * 9.81, rel=1e-3)
    assert grains.spin[0, 1] / world.time == pytest.approx(2.5 * friction * 9.81 / radius, rel=1e-3)


def gas(number=60, seed=0):
    """Grains of three sizes flying into each other in free space."""
    random = np.random.default_rng(seed)
    side = int(np.ceil(number ** (1 / 3)))
    lattice = np.stack(np.meshgrid(*[range(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:number]
    radius = random.choice([0.002, 0.003, 0.004], number)
    position = 0.009 * lattice + random.uniform(-4e-4, 4e-4, (number, 3))
    inward = position.mean(axis=0) - position
    return position, radius, 8.0 * inward + random.normal(0.0, 0.2, (number, 3)), random.normal(0.0, 30.0, (number, 3))


def momenta(grains, density=2500.0):
    mass = density * 4 / 3 * np.pi * grains.radius.astype(float)[:, None] ** 3
    velocity, spin = grains.velocity.astype(float), grains.spin.astype(float)
    linear = (mass * velocity).sum(axis=0)
    turning = 0.4 * mass * grains.radius.astype(float)[:, None] ** 2 * spin
    return linear, (np.cross(grains.position, mass * velocity) + turning).sum(axis=0), np.abs(mass * velocity).sum()


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-13), ("single", 2e-7)])
def test_isolated_grains_keep_their_momenta(make_world, precision, tolerance):
    """To rounding, with friction, and in the middle of contacts too."""
    position, radius, velocity, spin = gas()
    material = {"density": 2500.0, "young": 1e7, "poisson": 0.25}
    domain = {"low": [-0.2] * 3, "high": [0.25] * 3}
    world = make_world(position, radius, velocity=velocity, spin=spin, material=material, domain=domain, precision=precision)
    before, turning_before, scale = momenta(world.observe().grains)
    contacts = []
    for _ in range(15):
        world.step(200)
        observation = world.observe()
        after, turning_after, _ = momenta(observation.grains)
        contacts.append(observation.health.contacts)
        assert np.abs(after - before).max() < tolerance * scale
        assert np.abs(turning_after - turning_before).max() < tolerance * scale * 0.05
    assert max(contacts) > 3
    assert observation.health.dissipated > 0.0


@pytest.mark.parametrize("precision", ["double", "single"])
def test_elastic_frictionless_gas_keeps_its_energy(make_world, precision):
    position, radius, velocity, _ = gas(seed=5)
    box = {"type": "box", "name": "box", "material": "wall", "low": [-0.01] * 3, "high": [0.05] * 3}
    world = make_world(
        position,
        radius,
        velocity=velocity,
        restitution=1.0,
        friction=0.0,
        contact={"tangential": "none"},
        boundaries=[box],
        precision=precision,
    )
    start = world.observe().health
    world.step(round(0.1 / world.time_step))
    health = world.observe().health
    assert health.contacts + health.deepest > 0
    total = start.kinetic + start.elastic
    assert abs(health.kinetic + health.elastic - total) < 5e-5 * total


def test_floor_carries_the_weight(make_world):
    """A wide bed at rest between frictionless side walls."""
    random = np.random.default_rng(2)
    lattice = np.stack(np.meshgrid(range(8), range(8), range(6), indexing="ij"), -1).reshape(-1, 3)
    position = 0.0105 * lattice + 0.00525 + random.uniform(-2e-4, 2e-4, (len(lattice), 3))
    box = {"type": "box", "name": "box", "material": "wall", "low": [0.0] * 3, "high": [0.084, 0.084, 0.2], "open": ["top"]}
    parsed = {
        "material": SAND,
        "restitution": 0.1,
        "friction": 0.0,
        "gravity": [0.0, 0.0, -9.81],
        "boundaries": [box],
        "precision": "single",
    }
    world = make_world(position, 0.005, **parsed)
    world.step(round(1.5 / world.time_step))
    observation = world.observe()
    weight = observation.grains.mass.sum() * 9.81
    assert -observation.wall("box/bottom").force[2] == pytest.approx(weight, rel=1e-3)
    assert observation.health.retired == 0


def test_swings_in_a_cylinder(make_world):
    """A frictionless sphere in a lying cylinder is a pendulum of length R - r; its small swings take 2 pi sqrt((R - r)/g)."""
    radius, pipe = 0.005, 0.05
    swing = (pipe - radius) * np.sin(0.1)
    world = make_world(
        [[0.0, swing, pipe - (pipe - radius) * np.cos(0.1)]],
        radius,
        material=SAND,
        restitution=1.0,
        friction=0.0,
        gravity=[0.0, 0.0, -9.81],
        boundaries=[{"type": "cylinder", "material": "wall", "point": [0.0, 0.0, pipe], "axis": [2.0, 0.0, 0.0], "radius": pipe}],
        domain={"low": [-0.1] * 3, "high": [0.1] * 3},
        precision="single",
    )
    every = 50
    history = record(world, round(1.0 / world.time_step / every), every)
    y, time = history["position"][:, 0, 1], history["time"]
    crossings = time[1:][(y[:-1] < 0.0) & (y[1:] >= 0.0)]
    period = 2.0 * np.pi * np.sqrt((pipe - radius) / 9.81) * (1.0 + 0.1**2 / 16.0)
    assert np.diff(crossings).mean() == pytest.approx(period, rel=5e-3)
    assert y.max() == pytest.approx(swing, rel=1e-2)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_same_bits_on_any_number_of_threads(make_world, threads):
    """Grains, contact lists and sums are the same to the bit, also when searches come in between."""
    digests = []
    for lanes in (1, threads):
        position, radius, velocity, spin = gas(120, seed=9)
        world = make_world(position, radius, velocity=velocity, spin=spin, precision="single", threads=lanes)
        world.step(2500)
        observation = world.observe()
        health = observation.health
        digests.append((observation.grains, (health.kinetic, health.elastic, health.contacts)))
    (one, sums), (many, sums_of_many) = digests
    for name in ("identity", "position", "velocity", "spin"):
        assert np.array_equal(getattr(one, name), getattr(many, name))
    assert sums == sums_of_many


def test_far_from_the_origin_the_bits_are_the_same(make_world):
    """A scene moved by more than 10 km moves by more than 10 km."""
    position, radius, velocity, spin = gas(30, seed=4)
    position = np.round(position * 2.0**30) / 2.0**30  # exact in double precision there, too
    found = []
    for shift in (np.zeros(3), np.array([8192.0, -8192.0, 4096.0])):
        domain = {"low": (shift - 0.125).tolist(), "high": (shift + 0.125).tolist()}
        world = make_world(position + shift, radius, velocity=velocity, spin=spin, domain=domain, precision="single")
        world.step(1500)
        found.append(world.observe().grains)
        assert np.abs(found[-1].position - shift - position).max() > 1e-3
    assert np.array_equal(found[0].velocity, found[1].velocity)
    assert np.array_equal(found[0].spin, found[1].spin)


@pytest.mark.parametrize("precision", ["double", "single"])
def test_lost_reactions_show_in_the_momentum_residual(make_world, precision):
    """A heap has none but for rounding; once reactions are lost, as by a broken list, the run says that it cannot be trusted."""
    position = np.array([[0.0, 0.0, 0.0051], [0.0102, 0.0, 0.0051], [0.005, 0.001, 0.0142]])
    world = make_world(position, 0.005, gravity=[0.0, 0.0, -9.81], boundaries=floor(), precision=precision)
    for _ in range(20):
        world.step(50)
        health = world.observe().health
        assert health.momentum_residual < 1e-5
    assert health.contacts > 2
    world.assembly.solver.arrays.met.starts.zero_()
    world.step(20)
    health = world.observe().health
    assert health.momentum_residual > 1e-2
    assert any("no counterpart" in doubt for doubt in health.doubts)
