"""Volume swept by tools, against closed forms."""

import numpy as np
import pytest
import trimesh
from clouds import cloud_of
from scenes import write_small_scene
from timing import quickest, sorting

from sampler import sample_body
from sand_sim import ToolPose, World, load_scene, rotation
from sand_sim.assembly.tool_model import ToolModel
from sand_sim.readout.sweeping import SweptGround
from sand_sim.scene.types import Tool

DIAMETER, PARTICLE = 0.01, 0.001
WIDTH, HEIGHT = 0.1, 0.2  # of the blade's hull
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def bed():
    """Spheres on a grid of 0.6 x 0.3 x 0.1 m^3, top at z = 0."""
    z, y, x = np.mgrid[:10, :30, :60]
    corner = np.column_stack([x.ravel(), y.ravel(), z.ravel()]) + 0.5
    return cloud_of(corner * DIAMETER - [0.0, 0.15, 0.1], 0.5 * DIAMETER)


@pytest.fixture(scope="module", params=["rough", "smooth"])
def blade(request):
    """A thin blade across y whose hull is WIDTH wide and reaches from z = 0 up to HEIGHT."""
    around = 0.0 if request.param == "smooth" else PARTICLE
    mesh = trimesh.creation.box((0.001 + 2 * (PARTICLE - around), WIDTH - 2 * around, HEIGHT - 2 * around))
    mesh.apply_translation([0.0, 0.0, 0.5 * HEIGHT])
    surface = np.asarray(mesh.triangles) if request.param == "smooth" else None
    return ToolModel(Tool("blade", "", "steel", PARTICLE, contact=request.param), mesh, sample_body(mesh, PARTICLE), surface)


def draw(bed, blade, stops):
    """Swept volume along a way through positions."""
    ground = SweptGround(bed, [blade], [(np.array(stops[0]), NO_TURN)])
    for stop in stops[1:]:
        ground.advance([(np.array(stop), NO_TURN)])
    return ground.volumes[0]


def test_blade_drawn_through_the_bed_sweeps_width_depth_length(bed, blade):
    """b d L, each edge wrong by less than a cell, and right on the mean over where the cells lie."""
    random, found, expected = np.random.default_rng(1), [], []
    for _ in range(40):
        depth, length = random.uniform(0.03, 0.07), random.uniform(0.2, 0.35)
        x, y = random.uniform(0.1, 0.13), random.uniform(-0.05, 0.05)
        swept = draw(bed, blade, [[x, y, 0.5], [x, y, -depth], [x + length, y, -depth], [x + length, y, 0.5]])
        thick = 0.001 + 2 * PARTICLE
        expected.append(WIDTH * depth * (length + thick))
        error = DIAMETER * (1.0 / WIDTH + 1.0 / depth + 1.0 / length)
        assert swept == pytest.approx(expected[-1], rel=error)
        found.append(swept)
    assert np.mean(found) == pytest.approx(np.mean(expected), rel=0.03)


def test_nothing_is_jumped_over(bed, blade):
    """One long frame, a hundred short ones, and there and back again give the same."""
    begin, end = np.array([0.1, 0.0031, -0.052]), np.array([0.5, 0.0031, -0.052])
    once = draw(bed, blade, [begin, end])
    often = draw(bed, blade, np.linspace(begin, end, 101))
    assert once == pytest.approx(WIDTH * 0.052 * 0.4, rel=0.1)
    assert often == once
    assert draw(bed, blade, [begin, end, begin]) == once


def test_bend_between_two_frames_is_followed(bed, blade):
    ground = SweptGround(bed, [blade], [(np.array([0.1, 0.0, 0.1]), NO_TURN)])
    ground.pass_by(0, np.array([0.1, 0.0, -0.05]), NO_TURN)
    ground.pass_by(0, np.array([0.5, 0.0, -0.05]), NO_TURN)
    assert ground.advance([(np.array([0.5, 0.0, 0.1]), NO_TURN)])[0] == pytest.approx(WIDTH * 0.05 * 0.4, rel=0.1)


def test_turning_blade_sweeps_a_sector(bed, blade):
    """Turned by 0.9 rad about a level axis in its middle's height: (R^2 - r^2)/2 w angle inside the bed is found cell by cell."""
    begin = np.array([0.3, 0.0, 0.05])
    tilted, further = (rotation.from_vector(np.array([0.0, angle, 0.0])) for angle in (np.pi - 0.45, np.pi + 0.45))
    ground = SweptGround(bed, [blade], [(begin, tilted)])
    started = ground.ground.copy()
    swept = ground.advance([(begin, further)])[0]
    middles = ground.low + (np.argwhere(started) + 0.5) * ground.cell - begin
    angle, distance = np.arctan2(middles[:, 0], -middles[:, 2]), np.hypot(middles[:, 0], middles[:, 2])
    sector = (np.abs(angle) < 0.45) & (distance < HEIGHT - 2 * PARTICLE) & (np.abs(middles[:, 1]) < 0.5 * WIDTH)
    assert swept == pytest.approx(sector.sum() * ground.cell**3, rel=0.05)
    in_parts = SweptGround(bed, [blade], [(begin, tilted)])
    for share in np.linspace(0.0, 1.0, 30):
        in_parts.advance([(begin, rotation.between(tilted, further, share))])
    assert in_parts.volumes[0] == pytest.approx(swept, rel=0.01)


def test_ground_is_what_lies_under_the_surface(bed, blade):
    buried = SweptGround(bed, [blade], [(np.array([0.305, 0.0, -0.05]), NO_TURN)])
    clear = SweptGround(bed, [blade], [(np.array([0.3, 0.0, 0.5]), NO_TURN)])
    assert clear.ground.sum() * clear.cell**3 == pytest.approx(0.6 * 0.3 * 0.1, rel=1e-6)
    assert buried.ground.sum() < clear.ground.sum()
    assert buried.volumes[0] == 0.0
    assert SweptGround(cloud_of(np.zeros((0, 3)), 0.1), [blade], [(np.zeros(3), NO_TURN)]).volumes[0] == 0.0


def test_ground_of_a_bed_that_is_not_level_lies_under_each_of_its_places(blade):
    """Columns of spheres on a grid, as high as chance wills, on a floor that is a step higher on one side."""
    random = np.random.default_rng(3)
    bottom = np.array([0, 0, 0, 2, 2])[:, None] + np.zeros((5, 7), int)
    top = bottom + random.integers(2, 6, (5, 7))
    z = np.arange(8)
    x, y, z = np.nonzero((z >= bottom[:, :, None]) & (z < top[:, :, None]))
    bed = cloud_of((np.column_stack([x, y, z]) + 0.5) * DIAMETER, 0.5 * DIAMETER)
    found = SweptGround(bed, [blade], [(np.array([0.0, 0.0, 0.5]), NO_TURN)])
    assert found.cell == pytest.approx(DIAMETER)
    assert found.low == pytest.approx(np.zeros(3), abs=1e-9)
    expected = np.zeros((5, 7, int(top.max())), bool)
    expected[x, y, z] = True
    assert np.array_equal(found.ground, expected)


def test_cells_of_which_grains_cover_less_than_half_are_no_ground(blade):
    """One sphere in the middle of each of two cells, and one where four cells meet, a quarter of which lies over each."""
    bed = cloud_of(DIAMETER * np.array([[0.5, 0.5, 0.5], [3.5, 1.5, 0.5], [2.0, 1.0, 0.5]]), 0.5 * DIAMETER)
    found = SweptGround(bed, [blade], [(np.array([0.0, 0.0, 0.5]), NO_TURN)])
    assert np.argwhere(found.ground).tolist() == [[0, 0, 0], [3, 1, 0]]


def test_another_body_has_swept_what_it_lies_in(bed, blade):
    size, place = np.array([0.063, 0.044, 0.31]), np.array([0.302, 0.001, 0.1])
    mesh = trimesh.creation.box(size)
    block = ToolModel(Tool("block", "", "steel", PARTICLE, contact="smooth"), mesh, blade.body, np.asarray(mesh.triangles))
    ground = SweptGround(bed, [blade], [(place, NO_TURN)])
    assert ground.volumes[0] == 0.0
    ground.set_tools([block])
    middles = ground.low + (np.argwhere(ground.ground) + 0.5) * ground.cell - place
    lies_in = np.all(np.abs(middles) < 0.5 * size, axis=1).sum()
    assert lies_in > 100
    assert ground.volumes[0] == pytest.approx(lies_in * DIAMETER**3)


def test_world_reports_and_keeps_it(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    assert world.observe().tool("plate").swept == 0.0
    for at, height in ((0.1, 0.022), (0.12, 0.015)):
        world.apply(ToolPose("plate", np.array([0.015, 0.015, height]), NO_TURN, at))
        world.step(round((at - world.time) / world.time_step))
    state, swept = world.save(), world.observe().tool("plate").swept
    assert swept > 0.0
    world.reset()
    assert world.observe().tool("plate").swept == 0.0
    world.restore(state)
    assert world.observe().tool("plate").swept == swept


def test_cost_beside_a_frame_is_small(bed, blade):
    ground = SweptGround(bed, [blade], [(np.array([0.1, 0.0, -0.05]), NO_TURN)])
    poses = ([(np.array([x, 0.0, -0.05]), NO_TURN)] for x in np.linspace(0.1, 0.5, 40))
    assert quickest(lambda: ground.advance(next(poses)), times=40) < 10.0 * sorting(100_000)
