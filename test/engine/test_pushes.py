"""Free bodies pushed from outside, against closed forms and an independent integration of Newton's and Euler's equations."""

import numpy as np
import pytest
import trimesh
from drawn import same_state
from scenes import floor

from sand_sim import CommandError
from sand_sim.integrator import INTEGRATORS
from sand_sim.rotation import to_matrices

BALL = {"spheres": [[0.0, 0.0, 0.0, 0.1]], "mass": 2.0, "inertia": [0.008, 0.008, 0.008]}
STEP = {"time_step": 1e-3, "force_time_step": True}


def brick(tmp_path, **further):
    """A brick whose frame lies in a corner of it."""
    mesh = trimesh.creation.box((0.06, 0.1, 0.04))
    mesh.apply_translation([0.03, 0.05, 0.02])
    mesh.export(tmp_path / "brick.stl")
    return {"mesh": "brick.stl", "particle_radius": 0.004, "mass": 0.6} | further


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_a_ball_takes_up_momentum_and_the_work_that_is_done(make_bodies, precision, integrator):
    """``v = F t / m``, ``w = T t / I``; the work is what the ball has in the end, and none is lost or comes from nowhere."""
    world = make_bodies({"ball": BALL}, precision=precision, solver=STEP | {"integrator": integrator})
    force, torque = np.array([0.3, -0.2, 0.1]), np.array([0.0, 2e-3, -1e-3])
    world.push_body("ball", force, torque)
    world.step(400)
    seen, time = world.observe(), world.time
    ball, health = seen.body("ball"), seen.health
    later = 0.0 if integrator == "velocity_verlet" else world.time_step
    assert ball.velocity == pytest.approx(force / 2.0 * time, rel=1e-5)
    assert ball.position == pytest.approx(0.5 * force / 2.0 * time * (time + later), rel=1e-5)
    assert ball.spin == pytest.approx(torque / 0.008 * time, rel=1e-5)
    energy = 0.5 * (2.0 * ball.velocity @ ball.velocity + 0.008 * ball.spin @ ball.spin)
    assert health.kinetic == pytest.approx(energy, rel=1e-5)
    assert health.tool_work == pytest.approx(energy, rel=1e-5)
    assert abs(health.dissipated) < 1e-5 * energy
    assert health.gained < 1e-6 * energy
    assert not health.momentum_residual > 1e-6
    world.push_body("ball")
    world.step(100)
    assert world.observe().body("ball").velocity == pytest.approx(ball.velocity, rel=1e-5)
    assert world.observe().health.tool_work == pytest.approx(energy, rel=1e-5)


def moved(state, mass, inertia, force, torque, lever):
    """Rates of position, velocity, axes and angular momentum of a body, from Newton and Euler; ``lever`` in its frame."""
    _, velocity, axes, momentum = state
    spin = axes @ ((axes.T @ momentum) / inertia)
    turning = np.cross(spin, axes, axisb=0, axisc=0)
    return velocity, force / mass, turning, torque + np.cross(axes @ lever, force)


def test_a_brick_pushed_at_its_corner_tumbles_as_an_independent_integration_says(make_bodies, tmp_path):
    """Runge and Kutta's method of fourth order, with a twentieth of the step; the force stays at the corner as it goes round."""
    pose = {"position": [0.1, -0.2, 0.05], "rpy": [0.3, -0.5, 1.0]}
    world = make_bodies({"brick": brick(tmp_path, pose=pose, spin=[0.0, 3.0, 1.0])}, solver={"time_step": 1e-4})
    model, begin = world.assembly.bodies[0], world.observe().body("brick")
    force, torque = np.array([0.5, 0.2, -0.3]), np.array([0.0, 4e-3, 2e-3])
    world.push_body("brick", force, torque)
    world.step(4000)
    seen = world.observe()

    own = to_matrices(begin.orientation)
    axes, lever = own @ model.shape.axes, -model.shape.axes.T @ model.shape.middle
    inertia = model.mass * model.gyration
    state = [begin.position - axes @ lever, np.zeros(3), axes, axes @ (inertia * (axes.T @ [0.0, 3.0, 1.0]))]
    act = (model.mass, inertia, force, torque, lever)
    dt = 0.4 / 2000
    for _ in range(2000):
        first = moved(state, *act)
        second = moved([s + 0.5 * dt * r for s, r in zip(state, first, strict=True)], *act)
        third = moved([s + 0.5 * dt * r for s, r in zip(state, second, strict=True)], *act)
        fourth = moved([s + dt * r for s, r in zip(state, third, strict=True)], *act)
        rates = zip(first, second, third, fourth, strict=True)
        state = [s + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d) for s, (a, b, c, d) in zip(state, rates, strict=True)]
    position, velocity, axes, momentum = state
    there = seen.body("brick")
    assert np.linalg.norm(velocity) > 0.3
    assert there.velocity == pytest.approx(velocity, abs=1e-9)
    assert there.position == pytest.approx(position + axes @ lever, abs=1e-6)
    assert to_matrices(there.orientation) @ model.shape.axes == pytest.approx(axes, abs=1e-5)
    spin = axes @ ((axes.T @ momentum) / inertia)
    assert there.spin == pytest.approx(spin, abs=1e-4)
    energy = 0.5 * (model.mass * velocity @ velocity + spin @ momentum)
    about_axes = (own @ model.shape.axes).T @ [0.0, 3.0, 1.0]
    start = 0.5 * inertia @ about_axes**2
    assert seen.health.tool_work == pytest.approx(energy - start, rel=1e-4)


@pytest.mark.parametrize(("pull", "slides"), [(0.9, False), (1.2, True)])
def test_a_block_slides_once_it_is_pulled_harder_than_friction_holds(make_bodies, pull, slides):
    """Coulomb: it rests while ``F < mu m g``, else it gains ``F / m - mu g``; mu is 0.5."""
    feet = [[x, y, 0.02, 0.02] for x, y in ((-0.06, -0.04), (0.06, -0.04), (0.0, 0.08))]
    block = {"spheres": feet, "mass": 0.5, "inertia": [1e-3, 1e-3, 1e-3]}
    world = make_bodies({"block": block}, gravity=[0, 0, -9.81], boundaries=floor(), restitution=0.3, precision="single")
    bound = 0.5 * 0.5 * 9.81
    world.push_body("block", [pull * bound, 0.0, 0.0])
    world.step(round(0.05 / world.time_step))
    before = world.observe()
    world.step(round(0.1 / world.time_step))
    after = world.observe()
    gained = (after.body("block").velocity[0] - before.body("block").velocity[0]) / (after.time - before.time)
    assert gained == pytest.approx((pull - 1.0) * 0.5 * 9.81 if slides else 0.0, abs=0.01)
    assert after.wall("floor").force[2] == pytest.approx(-0.5 * 9.81, rel=0.02)
    assert after.health.gained == 0.0
    assert after.health.momentum_residual < 1e-5
    way = after.body("block").position[0] - before.body("block").position[0]
    assert after.health.tool_work - before.health.tool_work == pytest.approx(pull * bound * way, rel=1e-4, abs=1e-8)  # 5 nm


def test_only_the_body_that_is_meant_is_pushed_and_a_reset_ends_it(make_bodies):
    bodies = {f"ball{k}": BALL | {"pose": {"position": [0.3 * k, 0.0, 0.0]}} for k in range(3)}
    world = make_bodies(bodies, solver=STEP)
    world.push_body("ball1", [0.0, 1.0, 0.0])
    world.step(50)
    velocities = np.array([body.velocity for body in world.observe().bodies])
    state = world.save()
    assert velocities == pytest.approx(np.array([[0.0] * 3, [0.0, 0.5 * world.time, 0.0], [0.0] * 3]), abs=1e-12)
    world.step(50)
    far = world.save()
    world.restore(state)
    world.step(50)
    assert same_state(world.save(), far), "what is saved knows what pushes"
    world.reset()
    world.step(50)
    assert np.abs([body.velocity for body in world.observe().bodies]).max() == 0.0


def test_clumps_of_a_fill_are_not_pushed_in_place_of_a_body(make_bodies):
    """They are rigid bodies to the solver as well, before those of the scene."""
    fill = {"material": "stone", "shape": "tetrahedron", "radius": 0.02, "count": 7}
    fill["region"] = {"low": [0.2, 0.2, 0.2], "high": [0.7, 0.7, 0.7]}
    world = make_bodies({"ball": BALL, "other": BALL | {"pose": {"position": [0, 0.4, 0]}}}, solver=STEP, fills=[fill])
    start = world.observe().grains
    world.push_body("other", [0.0, 0.0, 1.0])
    world.step(50)
    seen = world.observe()
    assert seen.body("other").velocity[2] == pytest.approx(0.5 * world.time, rel=1e-9)
    assert np.array_equal(seen.grains.velocity[:-1], start.velocity[:-1])
    assert len(seen.grains) == 9


@pytest.mark.parametrize(
    ("body", "force", "told"),
    [
        ("wheel", [0.0] * 3, "body 'wheel' is unknown; known are ball"),
        ("ball", [0.0] * 2, "body 'ball': force must be 3 numbers"),
        ("ball", [0.0, 0.0, np.nan], "body 'ball': force must be finite"),
        ("ball", [0.0, 0.0, 1e6], "body 'ball': would be torn away by"),
        ("ball", [0.0, 0.0, 1e300], "body 'ball': would be torn away by"),
    ],
)
def test_a_push_that_makes_no_sense_is_refused(make_bodies, body, force, told):
    with pytest.raises(CommandError, match=told):
        make_bodies({"ball": BALL}, solver=STEP).push_body(body, force)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_body_that_is_put_elsewhere_is_pushed_no_more(make_bodies, integrator):
    """It has the velocity that it was given, at once and later."""
    world = make_bodies({"ball": BALL}, solver=STEP | {"integrator": integrator})
    world.push_body("ball", [1.0, 0.0, 0.0], [0.0, 0.01, 0.0])
    world.step(20)
    work = world.observe().health.tool_work
    world.place_body("ball", [0.0, 0.3, 0.0], velocity=[0.0, 0.2, 0.0])
    for _ in range(2):
        seen = world.observe()
        assert seen.body("ball").velocity == pytest.approx([0.0, 0.2, 0.0], abs=1e-12)
        assert seen.body("ball").spin == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
        assert seen.health.gained < 1e-12
        world.step(20)
    assert abs(work) > 1e-5


def test_a_body_that_has_left_is_not_pushed(make_bodies):
    world = make_bodies({"ball": BALL | {"velocity": [8.0, 0.0, 0.0]}}, solver=STEP)
    world.step(200)
    with pytest.raises(CommandError, match="body 'ball' has left the domain; 'place_body' puts it back"):
        world.push_body("ball", [1.0, 0.0, 0.0])
    world.place_body("ball", [0.0, 0.0, 0.0])
    world.push_body("ball", [1.0, 0.0, 0.0])
    world.step(100)
    assert world.observe().body("ball").velocity[0] == pytest.approx(0.05, rel=1e-9)
