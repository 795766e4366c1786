"""Friction where the normal turns while a grain spins about it: springs know which way it had in the middle of the step."""

import numpy as np
import pytest
import trimesh

from sand_sim.tool_motion.playing import commands_at

GRAVITY, TURNS = 9.81, 30.0  # [m/s^2], [rad/s] around the cylinder


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_ball_that_runs_round_in_an_upright_cylinder_comes_up_again(make_world, integrator):
    """The golfer's dilemma (Gualtieri et al. 2006, Am. J. Phys. 74, 497): ``z = -g / (q W^2) (1 - cos(W sqrt(q / (1 + q)) t))``.

    q is the inertia over ``m arm^2``, 2/5 for a rigid ball; this one lies in the wall by 0.2 % of its radius.
    """
    wide, radius, density, young, poisson = 0.05, 0.01, 2500.0, 1e8, 0.25
    pressed = density * 4 / 3 * np.pi * radius**3 * (wide - radius) * TURNS**2
    dent = (3.0 * pressed * (1.0 - poisson**2) / (4.0 * young * np.sqrt(radius))) ** (2.0 / 3.0)  # on a rigid plane
    orbit, arm = wide - radius + dent, radius - dent
    world = make_world(
        [[orbit, 0.0, 0.0]],
        radius,
        velocity=[0.0, TURNS * orbit, 0.0],
        spin=[0.0, 0.0, -TURNS * orbit / arm],
        material={"density": density, "young": young, "poisson": poisson},
        friction=2.0,
        gravity=[0.0, 0.0, -GRAVITY],
        boundaries=[
            {"name": "cup", "type": "cylinder", "material": "wall", "point": [0, 0, 0], "axis": [0, 0, 1], "radius": wide}
        ],
        domain={"low": [-0.1, -0.1, -0.3], "high": [0.1, 0.1, 0.3]},
        contact={"tangential": "mindlin"},
        integrator=integrator,
        threads=1,
    )
    inertia = 0.4 * (radius / arm) ** 2
    lowest, rate = -2.0 * GRAVITY / (inertia * TURNS**2), TURNS * np.sqrt(inertia / (1.0 + inertia))
    height, expected = [], []
    for _ in range(40):
        world.step(round(2.0 * np.pi / rate / 20 / world.time_step))
        height.append(world.observe().grains.position[0, 2])
        expected.append(0.5 * lowest * (1.0 - np.cos(rate * world.time)))
    assert np.abs(np.subtract(height, expected)).max() < 5e-4 * -lowest
    moving = world.observe().health
    assert abs(moving.dissipated) < 1e-5 * moving.kinetic


@pytest.mark.parametrize(
    ("precision", "integrator"), [("single", "velocity_verlet"), ("double", "velocity_verlet"), ("double", "symplectic_euler")]
)
def test_two_stuck_grains_that_turn_about_each_other_and_spin_keep_their_energy(make_world, precision, integrator):
    """No slip, no loss: all that moves is rigid."""
    radius, spin = 1e-3, np.array([200.0, 0.0, 200.0])
    arm = radius * (1.0 - 1e-3)
    velocity = np.cross(spin, [arm, 0.0, 0.0])
    world = make_world(
        [[-arm, 0.0, 0.0], [arm, 0.0, 0.0]],
        radius,
        velocity=[-velocity, velocity],
        spin=[spin, spin],
        material={"density": 2500.0, "young": 1e8, "poisson": 0.25},
        friction=5.0,
        restitution=1.0,
        numbers={"adhesion": 1.0},
        contact={"cohesion": "dmt"},
        precision=precision,
        integrator=integrator,
        domain={"low": [-0.01] * 3, "high": [0.01] * 3},
        threads=1,
    )
    world.step(round(10 * 2.0 * np.pi / 200.0 / world.time_step))
    health = world.observe().health
    assert health.contacts == 1
    assert abs(health.dissipated) < 1e-4 * health.kinetic


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_a_grain_that_sticks_to_a_turning_tool_and_spins_on_it_keeps_its_energy(make_world, tmp_path, integrator):
    """It swings up and down the face, as the golfer's ball, and nothing slips."""
    trimesh.creation.box((0.02, 0.02, 0.02)).export(tmp_path / "box.stl")
    radius, turning, young, poisson = 1e-3, 50.0, 1e8, 0.25
    ease = 2.0 * (1.0 - poisson**2) / young  # of both materials, which are the same
    dent = (3.0 * 2.0 * np.pi * radius * ease / (4.0 * np.sqrt(radius))) ** (2.0 / 3.0)
    orbit, material = 0.01 + radius - dent, {"density": 2500.0, "young": young, "poisson": poisson}
    way = [{"time": 0.02 * k, "position": [0, 0, 0], "rpy": [0, 0, 0.02 * k * turning]} for k in range(4)]
    tool = {
        "mesh": str(tmp_path / "box.stl"),
        "material": "wall",
        "particle_radius": 0.002,
        "contact": "smooth",
        "max_speed": 2.0,
    }
    world = make_world(
        [[orbit, 0.0, 0.0]],
        radius,
        velocity=[0.0, turning * orbit, 0.0],
        spin=[200.0, 0.0, turning],
        material=material,
        wall=material,
        friction=5.0,
        numbers={"adhesion": 1.0},
        contact={"cohesion": "dmt"},
        domain={"low": [-0.05] * 3, "high": [0.05] * 3},
        tools={"box": tool | {"max_speed": 2.0, "trajectory": way}},
        frame_rate=1000,
        integrator=integrator,
        threads=1,
    )
    lost = []
    for frame in range(60):
        for command in commands_at(world.scene, (frame + 1) / 1000):
            world.apply(command)
        world.step(world.frame_steps)
        lost.append(world.observe().health.dissipated)
    seen = world.observe()
    assert seen.grains.position[0, 2] > 0.003
    assert seen.health.contacts == 1
    assert abs(lost[-1] - lost[19]) < 5e-7 * seen.health.kinetic
