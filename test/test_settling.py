"""How beds come to rest before time zero."""

import numpy as np
import pytest
from scenes import SceneMaker, floor

from sand_sim import World, read_scene

RADIUS, GRAVITY = 0.02, 9.81


def silo(tmp_path, **settle):
    """Weights over that of the grains that the floor and the wall of a pipe carry, which is eight radii high filled."""
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.0025, gravity=[0.0, 0.0, -GRAVITY], precision="single")
    region = {"low": [-RADIUS, -RADIUS, 0.0], "high": [RADIUS, RADIUS, 0.5]}
    scene["fills"] = [{"material": "grain", "radius": {"uniform": [0.0023, 0.0027]}, "region": region, "count": 1500}]
    pipe = {"type": "cylinder", "name": "pipe", "material": "wall", "point": [0, 0, 0], "axis": [0, 0, 1], "radius": RADIUS}
    scene |= {"boundaries": [*floor(), pipe], "settle": {"time": 4.0, "speed": 0.01} | settle}
    seen = World(read_scene(scene, tmp_path)).observe()
    weight = seen.grains.mass.sum() * GRAVITY
    return (-seen.wall(name).force[2] / weight for name in ("floor", "pipe"))


@pytest.mark.parametrize(
    ("settle", "least", "most"), [({}, 0.35, 0.8), ({"fall": 0.15}, 0.25, 0.6), ({"fall": "free"}, 0.9, 1.5)]
)
def test_the_walls_of_a_silo_bear_grains_that_do_not_fall_freely(tmp_path, settle, least, most):
    """Janssen: the floor bears ``l/H (1 - exp(-H/l))`` of the weight, ``l = R/(2 mu K)``, 0.26 for K = 0.5 at full friction.

    Of a column that falls freely walls are dragged down, and as it springs back they push.
    """
    on_floor, on_wall = silo(tmp_path, **settle)
    assert on_floor + on_wall == pytest.approx(1.0, abs=0.02)
    assert least < on_floor < most


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
@pytest.mark.parametrize("kind", ["grain", "body"])
def test_grains_fall_as_fast_as_asked(make_world, integrator, kind):
    """``v = v_0 (1 - exp(-g t / v_0))``, that of a rigid body too; both still fall as the time ends."""
    fastest, time = 0.2, 0.05
    further = {
        "integrator": integrator,
        "gravity": [0.0, 0.0, -GRAVITY],
        "settle": {"time": time, "fall": fastest, "speed": 1e-6},
    }
    if kind == "body":
        spheres = [[-0.004, 0.0, 0.0, 0.005], [0.004, 0.0, 0.0, 0.005]]
        further["bodies"] = {"bell": {"spheres": spheres, "material": "grain", "pose": {"position": [0.05, 0.0, 0.0]}}}
    world = make_world([[0.0, 0.0, 0.0]], 0.005, domain={"low": [-0.1] * 3, "high": [0.1] * 3}, **further)
    expected = fastest * (1.0 - np.exp(-GRAVITY * time / fastest))
    assert world.observe().grains.velocity[-1, 2] == pytest.approx(-expected, rel=0.05)


def test_time_zero_is_free_of_drag(make_world):
    world = make_world([[0.0, 0.0, 0.0]], 0.005, gravity=[0.0, 0.0, -GRAVITY], settle={"time": 1e-3, "fall": 0.01})
    begin = world.observe().grains.velocity[0, 2]
    world.step(100)
    assert world.observe().grains.velocity[0, 2] == pytest.approx(begin - GRAVITY * world.time, rel=1e-6)
