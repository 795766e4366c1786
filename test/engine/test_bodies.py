"""Clumps and free rigid bodies against closed forms and invariants."""

import numpy as np
import pytest
import trimesh
from body_worlds import MATERIALS
from scenes import floor

from sand_sim import SceneError, World, read_scene, rotation
from sand_sim.contact.damping import damping_ratio, restitution_of_damping
from sand_sim.scene.shapes import shape_of_spheres, tetrahedron


def angular_momentum(world, observation):
    """Of all bodies about the origin, from their reports, shape (3,) [kg m^2/s]."""
    total = np.zeros(3)
    for model, row in zip(world.assembly.bodies, range(len(observation.grains)), strict=True):
        grains = observation.grains
        turn = grains.orientation[row]
        local = rotation.rotate(rotation.inverse(turn), grains.spin[row]) * model.gyration * model.mass
        total += rotation.rotate(turn, local) + model.mass * np.cross(grains.position[row], grains.velocity[row])
    return total


@pytest.mark.parametrize(
    ("precision", "integrator"), [("double", "velocity_verlet"), ("single", "velocity_verlet"), ("single", "symplectic_euler")]
)
def test_torque_free_tumbling(make_bodies, precision, integrator):
    """I = (1, 2, 3), spin (0.01, 10, 0): flips about the middle axis every 2.873142 s (elliptic integral), for ever."""
    top = {"spheres": [[0.0, 0.0, 0.0, 0.1]], "mass": 1.0, "inertia": [1.0, 2.0, 3.0], "spin": [0.01, 10.0, 0.0]}
    world = make_bodies({"top": top}, precision=precision, solver={"time_step": 1e-3, "integrator": integrator})
    energy, before, flips = world.observe().health.kinetic, 10.0, []
    while len(flips) < 11:
        world.step(10)
        body = world.observe().body("top")
        middle = rotation.rotate(rotation.inverse(body.orientation), body.spin)[1]
        if middle * before < 0.0:
            flips.append(world.time - 0.01 * abs(middle) / (abs(middle) + abs(before)))
        before = middle
    assert (flips[-1] - flips[0]) / 10.0 == pytest.approx(2.873142, rel=1e-3)
    assert world.observe().health.kinetic == pytest.approx(energy, rel=1e-5)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_top_speed_is_that_of_the_fastest_sphere_of_a_body(make_bodies, integrator):
    """``|v + w x r|``: a clump that flies or turns meets others as fast as that, and asks for as short a step."""
    ends = [[-0.05, 0.0, 0.0, 0.01], [0.05, 0.0, 0.0, 0.01]]
    bar = {"spheres": ends, "velocity": [0.0, 3.0, 0.0], "spin": [0.0, 0.0, 20.0]}
    health = make_bodies({"bar": bar}, solver={"integrator": integrator}).observe().health
    assert health.fastest == pytest.approx(3.0 + 20.0 * 0.05, rel=1e-6)


def test_spheres_of_a_body_know_how_they_moved_over_the_last_step(make_bodies):
    """Friction springs grow by that; with the arms of now it would be off by half the angle that the body turns by in a step."""
    ends = [[-0.05, 0.0, 0.0, 0.01], [0.05, 0.0, 0.0, 0.01]]
    bar = {"spheres": ends, "velocity": [0.1, 0.0, 0.0], "spin": [0.0, 0.0, 50.0]}
    world = make_bodies({"bar": bar}, solver={"time_step": 1e-4, "force_time_step": True})
    world.step(20)
    grains, quantum = world.assembly.solver.arrays.grains, world.assembly.lattice.quantum
    before = grains.place.numpy()[:, :3].astype(float)
    world.step(1)
    way = quantum * (grains.place.numpy()[:, :3] - before)
    assert np.linalg.norm(way, axis=1).max() > 2e-4
    assert grains.half_motion.numpy() * world.time_step == pytest.approx(way, abs=1e-8)


def test_contacts_of_two_bodies_are_those_of_their_spheres(make_bodies):
    """A dumbbell on another one, 10 um deep: F = 4/3 E* sqrt(R*) d^(3/2) at each end, none between the balls of one of them."""
    balls, deep = [[-0.01, 0.0, 0.0, 0.01], [0.01, 0.0, 0.0, 0.01]], 1e-5
    upper = {"spheres": balls, "pose": {"position": [0.0, 0.0, 0.02 - deep]}}
    contacts = make_bodies({"lower": {"spheres": balls}, "upper": upper}).grain_contacts()
    up = np.where(contacts.first == 1, 1.0, -1.0)
    assert sorted(contacts.first + contacts.second) == [1, 1]
    assert sorted(contacts.point[:, 0]) == pytest.approx([-0.01, 0.01], abs=1e-9)
    assert contacts.overlap == pytest.approx([deep, deep], rel=1e-6)
    force = 4.0 / 3.0 * 0.5e7 / (1.0 - 0.25**2) * np.sqrt(0.005) * deep**1.5
    assert up * contacts.force[:, 2] == pytest.approx([force, force], rel=1e-6)


def test_off_centre_impact_follows_rigid_body_theory(make_bodies):
    """A dumbbell's sphere hits a smooth floor: ``J = (1 + e) v / (1/m + a^2/I)``, one for translation, one for rotation."""
    spheres = [[-0.02, 0.0, 0.0, 0.005], [0.02, 0.0, 0.0, 0.005]]
    tilt = 0.5
    low = 0.02 * np.sin(tilt) + 0.005
    pose = {"position": [0.0, 0.0, low + 1e-5], "rpy": [0.0, tilt, 0.0]}
    bell = {"spheres": spheres, "pose": pose, "velocity": [0.0, 0.0, -0.5]}
    contact = {"tangential": "none"}
    world = make_bodies({"bell": bell}, restitution=1.0, friction=0.0, boundaries=floor(), contact=contact)
    mass, inertia = world.assembly.bodies[0].mass, world.assembly.bodies[0].mass * world.assembly.bodies[0].gyration[1]
    arm = 0.02 * np.cos(tilt)
    impulse = 2.0 * 0.5 / (1.0 / mass + arm**2 / inertia)
    observation = world.observe()
    while observation.body("bell").position[2] < low + 2e-5 or world.time < 1e-4:
        world.step(10)
        observation = world.observe()
    body = observation.body("bell")
    assert body.velocity[2] == pytest.approx(-0.5 + impulse / mass, abs=2e-3)
    assert abs(body.spin[1]) == pytest.approx(impulse * arm / inertia, rel=5e-3)
    assert body.velocity[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("columns", "rows", "expected"), [(1, 1, 0.5), (2, 1, 0.39), (3, 1, 0.33), (3, 3, 0.19)])
def test_spheres_that_hit_at_once_bounce_less_as_documented(make_bodies, columns, rows, expected):
    """Each has a dashpot for the whole mass, so that n of them damp as one contact ``sqrt(n)`` times as strongly damped."""
    spheres = [[0.012 * column, 0.012 * row, 0.0, 0.006] for column in range(columns) for row in range(rows)]
    world = make_bodies(
        {"plate": {"spheres": spheres, "pose": {"position": [0.0, 0.0, 0.007]}, "velocity": [0.0, 0.0, -0.5]}},
        boundaries=floor(),
    )
    world.step(round(0.02 / world.time_step))
    plate = world.observe().body("plate")
    assert plate.velocity[2] / 0.5 == pytest.approx(expected, abs=0.01)
    ratio = np.sqrt(columns * rows) * damping_ratio(0.5, exponent=1.5)
    assert restitution_of_damping(1.5, np.array([ratio]))[0] == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("clump", "expected"), [("tetrahedron", 0.43), ("dumbbell", 0.40)])
def test_clumps_hit_across_one_of_their_spheres_bounce_less_as_documented(make_bodies, clump, expected):
    """They yield by turning, too, ``1 + a^2/k^2`` times as much, and are damped for their whole mass all the same."""
    ends = {"tetrahedron": tetrahedron().centres, "dumbbell": np.array([[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]])}[clump]
    hit, others = ends[0], ends[1:] - ends[0]
    across = np.linalg.svd(hit[None])[2][1:]  # of the ways across, the one that is farthest from all other spheres
    ways = [np.cos(turn) * across[0] + np.sin(turn) * across[1] for turn in np.linspace(0.0, 2.0 * np.pi, 721)]
    way = max(ways, key=lambda one: np.linalg.norm(2.0 * one - others, axis=1).min())
    ball = {"spheres": [[0.0, 0.0, 0.0, 0.005]], "mass": 1.0, "inertia": [1e-5] * 3, "velocity": (-0.02 * way).tolist()}
    ball |= {"pose": {"position": (0.005 * (hit + 2.0001 * way)).tolist()}}
    rows = 0.005 * np.column_stack([ends, np.ones(len(ends))])
    world = make_bodies({"clump": {"spheres": rows.tolist()}, "ball": ball}, contact={"tangential": "none"}, friction=0.0)
    while world.time < 1e-3 or len(world.grain_contacts()):
        world.step(20)
    seen = world.observe()
    body = seen.body("clump")
    away = body.velocity + np.cross(body.spin, rotation.rotate(body.orientation, 0.005 * hit)) - seen.body("ball").velocity
    assert -(away @ way) / 0.02 == pytest.approx(expected, abs=0.01)
    ratio = damping_ratio(0.5, exponent=1.5) * np.sqrt(1.0 + hit @ hit / shape_of_spheres(ends, np.ones(len(ends))).gyration[2])
    assert restitution_of_damping(1.5, np.array([ratio]))[0] == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("single", 2e-6)])
def test_colliding_bodies_conserve_momentum_and_angular_momentum(make_bodies, precision, tolerance):
    random = np.random.default_rng(4)
    corners = 0.006 / np.sqrt(8.0) * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    spheres = [[*corner, 0.005] for corner in corners.tolist()]
    places = 0.022 * (np.stack(np.meshgrid(range(2), range(2), range(2), indexing="ij"), -1).reshape(-1, 3) - 0.5)
    bodies = {}
    for k, place in enumerate(places):
        pose = {"position": place.tolist(), "rpy": random.uniform(0.0, 3.0, 3).tolist()}
        velocity, spin = (-60.0 * place).tolist(), random.normal(0.0, 30.0, 3).tolist()
        bodies[f"b{k}"] = {"spheres": spheres, "pose": pose, "velocity": velocity, "spin": spin}
    world = make_bodies(bodies, precision=precision)
    first = world.observe()
    mass = first.grains.mass[:, None].astype(float)
    scale = np.abs(mass * first.grains.velocity).sum()
    turning = angular_momentum(world, first)
    size = sum(
        np.linalg.norm(model.mass * np.cross(p, v))
        for model, p, v in zip(world.assembly.bodies, first.grains.position, first.grains.velocity + 1.0, strict=True)
    )
    met = 0
    for _ in range(30):
        world.step(round(3e-4 / world.time_step))
        now = world.observe()
        met = max(met, now.health.contacts)
        momentum = (mass * now.grains.velocity).sum(axis=0) - (mass * first.grains.velocity).sum(axis=0)
        assert np.abs(momentum).max() < tolerance * scale
        assert np.abs(angular_momentum(world, now) - turning).max() < 20.0 * tolerance * size
    assert met > 4
    assert now.health.dissipated > 0.0


def test_elastic_bodies_keep_their_energy(make_bodies):
    spheres = [[0.0, 0.0, 0.0, 0.005], [0.004, 0.0, 0.0, 0.004], [0.0, 0.005, 0.0, 0.003]]
    bodies = {
        "a": {"spheres": spheres, "velocity": [0.3, 0.0, 0.0], "spin": [0.0, 20.0, 30.0]},
        "b": {"spheres": spheres, "velocity": [-0.3, 0.0, 0.0], "pose": {"position": [0.02, 0.003, 0.0], "rpy": [1.0, 0.4, 2.0]}},
    }
    world = make_bodies(bodies, restitution=1.0, friction=0.0, contact={"tangential": "none"})
    energy = world.observe().health.kinetic
    met = 0
    for _ in range(40):
        world.step(50)
        met = max(met, world.observe().health.contacts)
    health = world.observe().health
    assert met > 0
    assert health.kinetic + health.elastic == pytest.approx(energy, rel=1e-3)


@pytest.mark.parametrize(
    ("degrees", "rests", "duration"),
    [(26.0, True, 1.0), (27.2, False, 1.0), pytest.param(26.0, True, 10.0, marks=pytest.mark.slow)],
)
def test_clump_on_a_slope(make_bodies, degrees, rests, duration):
    """A clump that stands on three spheres rests for ``tan(slope) < mu``, here mu = 0.5 and 26.57 degrees."""
    slope, radius = np.radians(degrees), 0.005
    feet = np.column_stack([np.cos([0, 2.0944, 4.1888]), np.sin([0, 2.0944, 4.1888]), np.zeros(3)]) * 0.008
    spheres = [[*foot, radius] for foot in feet.tolist()]
    clump = {"spheres": spheres, "pose": {"position": [0.0, 0.0, radius]}}
    gravity = [9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)]
    world = make_bodies({"clump": clump}, gravity=gravity, boundaries=floor(), restitution=0.3)
    world.step(round(0.3 / world.time_step))
    start = world.observe().body("clump").position[0]
    world.step(round(duration / world.time_step))
    moved = world.observe().body("clump").position[0] - start
    assert (moved < 1e-4 * duration * 2.0 * radius) == rests  # 1e-3 of a diameter in ten seconds


def test_mesh_body_rests_with_its_weight_on_the_floor(make_bodies, tmp_path):
    trimesh.creation.box((60.0, 40.0, 20.0)).export(tmp_path / "brick.stl")
    brick = {"mesh": "brick.stl", "scale": 0.001, "particle_radius": 0.003, "pose": {"position": [0.0, 0.0, 0.0131]}}
    world = make_bodies({"brick": brick}, gravity=[0.0, 0.0, -9.81], boundaries=floor(), restitution=0.2, precision="single")
    weight = 2500.0 * 0.06 * 0.04 * 0.02 * 9.81
    above = np.array([[0.0, 0.0, 0.0131 + 0.01 + 0.003 + 0.005]])
    assert world.assembly.bodies[0].distance(above) == pytest.approx([0.005], rel=1e-3)
    world.step(round(1.0 / world.time_step))
    observation = world.observe()
    assert observation.body("brick").mass * 9.81 == pytest.approx(weight, rel=1e-6)
    assert observation.wall("floor").force[2] == pytest.approx(-weight, rel=1e-3)
    assert np.linalg.norm(observation.body("brick").velocity) < 1e-4
    upright = rotation.rotate(observation.body("brick").orientation, np.array([0.0, 0.0, 1.0]))
    assert upright[2] > 0.999


def clump_bed(tmp_path, **further):
    numbers = {"restitution": 0.4, "friction": 0.5}
    parsed = {
        "materials": MATERIALS,
        "pairs": [{"between": ["stone", "stone"]} | numbers, {"between": ["stone", "wall"]} | numbers],
        "fills": [
            {"material": "stone", "shape": "tetrahedron", "radius": {"uniform": [0.004, 0.005]}, "count": 40, "seed": 2}
            | {"region": {"low": [-0.03, -0.03, 0.0], "high": [0.03, 0.03, 0.2]}},
            {"material": "stone", "radius": 0.004, "count": 10}
            | {"region": {"low": [-0.03, -0.03, 0.2], "high": [0.03, 0.03, 0.25]}},
        ],
        "boundaries": [
            {
                "type": "box",
                "name": "bin",
                "material": "wall",
                "low": [-0.03, -0.03, 0.0],
                "high": [0.03, 0.03, 0.3],
                "open": ["top"],
            }
        ],
    }
    return World(read_scene(parsed | further, tmp_path))


def test_clumps_and_spheres_come_to_rest_together(tmp_path):
    world = clump_bed(tmp_path, settle={"time": 2.0, "speed": 1e-4})
    observation = world.observe()
    grains = observation.grains
    weight = grains.mass.astype(float).sum() * 9.81
    assert len(grains) == 50
    assert len(observation.spheres) == 170
    assert np.array_equal(grains.identity, np.arange(50))
    assert sum(wall.force[2] for wall in observation.walls) == pytest.approx(-weight, rel=5e-3)  # the sides carry some of it
    equal = 4.0 / 3.0 * np.pi * 2500.0 * np.array([0.004, 0.005]) ** 3
    assert np.all((grains.mass[:40] > 0.99 * equal[0]) & (grains.mass[:40] < 1.01 * equal[1]))
    assert observation.health.deepest < 0.1
    assert np.all(observation.spheres.position[:, 2] > 0.0)


def test_clumps_are_the_same_to_the_bit_on_any_number_of_threads_and_after_a_restore(tmp_path):
    worlds = [clump_bed(tmp_path, solver={"threads": threads}) for threads in (1, 2)]
    for world in worlds:
        world.step(1500)
    saved = worlds[0].save()
    worlds[0].step(1500)
    for _ in range(15):  # looking changes nothing
        worlds[1].step(100)
        worlds[1].observe()
    third = clump_bed(tmp_path)
    third.restore(saved)
    third.step(1500)
    states = [world.observe() for world in (*worlds, third)]
    for other in states[1:]:
        for name in ("position", "velocity", "spin", "orientation"):
            assert getattr(states[0].grains, name).tobytes() == getattr(other.grains, name).tobytes()


def test_body_that_leaves_is_retired_whole(make_bodies):
    spheres = [[0.0, 0.0, 0.0, 0.01], [0.03, 0.0, 0.0, 0.01]]
    world = make_bodies(
        {
            "lost": {"spheres": spheres, "velocity": [5.0, 0.0, 0.0], "spin": [10.0, 20.0, 30.0]},
            "kept": {"spheres": spheres, "pose": {"position": [0, 0.5, 0]}},
        }
    )
    world.step(round(0.4 / world.time_step))
    observation = world.observe()
    assert observation.grains.identity.tolist() == [0], "bodies are numbered in the order of their names"
    assert len(observation.spheres) == 2
    assert [body.name for body in observation.bodies] == ["kept"]
    assert observation.health.retired == 1
    assert observation.health.dissipated == pytest.approx(0.0, abs=1e-9)  # what it has carried off is not lost


def test_light_body_gets_a_small_enough_step(make_bodies):
    """A ball far lighter than its material hits a floor elastically at the automatic step: it leaves as fast as it came."""
    steps = []
    for mass in (1.3e-3, 1e-6):
        ball = {"spheres": [[0.0, 0.0, 0.0, 0.005]], "mass": mass, "velocity": [0.0, 0.0, -0.5]}
        ball |= {"inertia": [0.4 * mass * 0.005**2] * 3, "pose": {"position": [0.0, 0.0, 0.0051]}}
        world = make_bodies({"ball": ball}, restitution=1.0, friction=0.0, boundaries=floor())
        world.step(round(0.004 / world.time_step))
        assert world.observe().body("ball").velocity[2] == pytest.approx(0.5, rel=5e-3)
        steps.append(world.time_step)
    assert steps[1] / steps[0] == pytest.approx((1e-6 / 1.3e-3) ** 0.4, rel=0.05)  # as the contact time


def test_sheet_weighs_what_its_thickness_says(make_bodies, tmp_path):
    """A plate modelled as a surface of 0.1 x 0.06 m^2; sampled once, then taken from the cache."""
    corners = [[-0.05, -0.03, 0.0], [0.05, -0.03, 0.0], [0.05, 0.03, 0.0], [-0.05, 0.03, 0.0]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).export(tmp_path / "sheet.stl")
    body = {"mesh": str(tmp_path / "sheet.stl"), "particle_radius": 0.002}
    for thickness, expected in ((0.003, 0.003), (None, 0.004)):
        extra = {} if thickness is None else {"thickness": thickness}
        made = [make_bodies({"sheet": body | extra}).assembly.bodies[0] for _ in range(2)]
        assert made[0].mass == pytest.approx(MATERIALS["stone"]["density"] * 0.1 * 0.06 * expected, rel=1e-6)
        assert np.array_equal(made[0].shape.centres, made[1].shape.centres)
    for wrong in ({"thickness": 0.0}, {"sheets": "some"}):
        with pytest.raises(SceneError, match=f"bodies.sheet.{next(iter(wrong))}"):
            make_bodies({"sheet": body | wrong})


def test_short_steps_let_a_body_fall_as_fast_as_long_ones(make_bodies):
    stiff = MATERIALS | {"stone": MATERIALS["stone"] | {"young": 1e10}}
    pair = {"spheres": [[0.0, 0.0, 0.0, 0.001], [0.001, 0.0, 0.0, 0.001]], "velocity": [0.0, 0.0, -1.2]}
    world = make_bodies({"pair": pair}, precision="single", materials=stiff, gravity=[0.0, 0.0, -9.81])
    assert 9.81 * world.time_step < 60 * np.spacing(np.float32(1.2))
    world.step(5000)
    assert -(world.observe().body("pair").velocity[2] + 1.2) / world.time == pytest.approx(9.81, rel=1e-4)


def test_a_body_that_starts_outside_of_the_domain_is_refused(make_bodies):
    ball = {"spheres": [[0.0, 0.0, 0.0, 0.01]]}
    with pytest.raises(SceneError, match=r"domain: 1 of 2 grains start outside of it, the first at \[3\.0, 0\.0, 0\.0\] m"):
        make_bodies({"near": ball, "far": ball | {"pose": {"position": [3.0, 0.0, 0.0]}}})
