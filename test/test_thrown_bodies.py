"""Bodies that are given a velocity: they come in when the beds have settled."""

import numpy as np
import pytest
from scenes import SceneMaker, floor

from sand_sim import World, read_scene
from sand_sim.scene.types import SceneError

GRAVITY = 9.81
DOWN = [0.0, 0.0, -GRAVITY]
BALL = [[0.0, 0.0, 0.0, 0.006]]
BELL = [[-0.006, 0.0, 0.0, 0.005], [0.006, 0.0, 0.0, 0.005]]


def bed_and(make_world, time=0.5, **further):
    """Two layers of grains that fall on to a floor, and what else there is."""
    lattice = 0.0105 * (np.stack(np.meshgrid(range(4), range(4), range(2), indexing="ij"), -1).reshape(-1, 3) - [1.5, 1.5, 0.0])
    further |= {"settle": {"time": time, "speed": 1e-4}} if time else {}
    domain = {"low": [-0.3, -0.3, -0.05], "high": [0.3, 0.3, 0.3]}
    return make_world(
        lattice + [0.0, 0.0, 0.02],
        0.005,
        boundaries=floor(),
        gravity=DOWN,
        restitution=0.3,
        friction=0.5,
        domain=domain,
        **further,
    )


@pytest.mark.parametrize("time", [0.5, 0.0])
@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
@pytest.mark.parametrize("spheres", [BALL, BELL], ids=["ball", "bell"])
def test_a_body_that_is_thrown_flies_from_time_zero_on(make_world, spheres, integrator, time):
    """As Galilei says, while one that is let go of lies on the bed where that has settled, or falls with it where it has not."""
    common = {"spheres": spheres, "material": "grain"}
    thrown = common | {"pose": {"position": [0.0, 0.0, 0.2]}, "velocity": [0.1, 0.0, -1.0], "spin": [0.0, 4.0, 0.0]}
    rock = common | {"pose": {"position": [0.005, 0.0, 0.06]}}
    world = bed_and(make_world, time, bodies={"thrown": thrown, "rock": rock}, integrator=integrator)
    start = world.observe()
    assert not [warning for warning in world.warnings if "velocity" in warning]
    assert start.body("thrown").position == pytest.approx([0.0, 0.0, 0.2], abs=1e-9)
    assert start.body("thrown").velocity == pytest.approx([0.1, 0.0, -1.0])
    assert start.body("rock").position[2] < 0.03 if time else start.body("rock").position[2] == pytest.approx(0.06)
    world.step(round(0.05 / world.time_step))
    seen, late = world.observe(), 0.5 * world.time_step * (integrator == "symplectic_euler")
    fallen = world.time + 0.5 * GRAVITY * world.time * (world.time + 2.0 * late)
    assert seen.body("thrown").position == pytest.approx([0.1 * world.time, 0.0, 0.2 - fallen], abs=1e-7)
    assert seen.body("thrown").spin == pytest.approx([0.0, 4.0, 0.0])
    half_angle = 0.5 * 4.0 * world.time
    assert seen.body("thrown").orientation == pytest.approx([0.0, np.sin(half_angle), 0.0, np.cos(half_angle)], abs=1e-5)
    assert seen.health.retired == 0


@pytest.mark.parametrize("spheres", [BALL, BELL], ids=["ball", "bell"])
def test_a_body_that_is_thrown_hits_the_bed_that_was_there_before(make_world, spheres):
    ball = {"spheres": spheres, "material": "grain", "pose": {"position": [0.0, 0.0, 0.1]}, "velocity": [0.0, 0.0, -1.0]}
    world = bed_and(make_world, bodies={"ball": ball})
    bed = world.observe().grains.position[:-1]
    assert bed[:, 2].max() < 0.016
    world.step(round(0.05 / world.time_step))
    np.testing.assert_allclose(world.observe().grains.position[:-1], bed, atol=2e-5)
    world.step(round(0.3 / world.time_step))
    moved = np.linalg.norm(world.observe().grains.position[:-1] - bed, axis=1)
    assert moved.max() > 1e-3
    assert world.observe().body("ball").position[2] > 0.0045
    world.reset()
    again = world.observe()
    np.testing.assert_array_equal(again.grains.position[:-1], bed)
    assert again.body("ball").position == pytest.approx([0.0, 0.0, 0.1], abs=1e-9)


@pytest.mark.parametrize("spheres", [BALL, BELL], ids=["ball", "bell"])
def test_a_body_that_is_thrown_is_as_it_would_be_without_a_bed(make_world, spheres):
    """It meets the floor at once; others have left the domain before."""
    ball = {"spheres": spheres, "material": "grain", "pose": {"position": [0.0, 0.0, 0.0061]}, "velocity": [0.2, 0.0, -1.0]}
    disc = {"type": "hole_plate", "name": "disc", "material": "wall", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
    disc |= {"hole_radius": 0.0, "radius": 0.05}
    place = {"domain": {"low": [-0.1] * 3, "high": [0.1] * 3}, "gravity": DOWN, "boundaries": [disc], "bodies": {"ball": ball}}
    beside = [[0.04, 0.0, 0.005], [0.07, 0.0, 0.005], [-0.07, 0.0, 0.005]]
    late, alone = (
        make_world(grains, 0.005, time_step=2e-6, settle=settle, **place)
        for grains, settle in ((beside, {"time": 0.3, "fall": "free"}), (beside[:1], {"time": 0.0}))
    )
    assert len(late.observe().grains) == 2
    for _ in range(40):
        worlds = [world.observe().body("ball") for world in (late, alone)]
        for name in ("position", "velocity", "spin", "orientation"):
            assert getattr(worlds[0], name) == pytest.approx(getattr(worlds[1], name), rel=1e-6, abs=1e-9), name
        late.step(100)
        alone.step(100)
    assert late.observe().body("ball").velocity[2] > 0.2


def test_a_body_may_be_thrown_where_there_is_nothing_else(tmp_path):
    ball = {"spheres": BALL, "material": "grain", "pose": {"position": [0.0, 0.0, 0.1]}, "velocity": [0.0, 0.0, -1.0]}
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.005, boundaries=floor(), gravity=DOWN, bodies={"ball": ball})
    del scene["fills"]
    world = World(read_scene(scene | {"settle": {"time": 0.5}}, tmp_path))
    assert world.observe().body("ball").velocity == pytest.approx([0.0, 0.0, -1.0])
    assert world.warnings == []


def test_a_body_that_is_thrown_needs_room_in_the_settled_bed(make_world):
    """Between the floor and grains that are still up as it is placed."""
    ball = {"spheres": BALL, "material": "grain", "pose": {"position": [0.0, 0.0, 0.0065]}, "velocity": [1.0, 0.0, 0.0]}
    with pytest.raises(
        SceneError, match=r"bodies.ball: .* comes in when beds have settled, and overlaps grains then; place it higher"
    ):
        bed_and(make_world, bodies={"ball": ball})
