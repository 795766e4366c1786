"""How far a tool swings as it turns: never less than its farthest point, and just as far about an axis of its frame."""

import numpy as np
import pytest
import trimesh
from scenes import SceneMaker

from sand_sim import CommandError, ToolPose, World, read_scene
from sand_sim.reach import reach_of

RADIUS, LENGTH = 0.01, 0.4


def test_no_point_swings_farther_than_told():
    """``|w x p|`` of all points, for turns about random axes, the axes themselves and diagonals."""
    random = np.random.default_rng(0)
    axes = np.concatenate([random.normal(size=(200, 3)), np.eye(3), -np.eye(3), [[1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]])
    for stretch in ([1.0, 1.0, 1.0], [0.1, 0.1, 1.0], [1.0, 0.01, 0.5]):
        points = random.normal(size=(50, 3)) * stretch + [0.0, 0.0, 0.3]
        reach = reach_of(points, 0.0)
        for axis in axes:
            swing, exact = reach.swing(axis), np.linalg.norm(np.cross(axis, points), axis=1).max()
            assert exact * (1.0 - 1e-12) <= swing <= reach.extent * np.linalg.norm(axis)
            if np.count_nonzero(axis) == 1:
                assert swing == pytest.approx(exact, rel=1e-12)


@pytest.fixture(params=["rough", "smooth"])
def drill(request, tmp_path):
    """A long rod along the x axis of its frame, that lies tilted, and one grain far away."""
    rod = trimesh.creation.cylinder(radius=RADIUS, height=LENGTH, sections=64)
    rod.apply_transform(trimesh.transformations.rotation_matrix(0.5 * np.pi, [0.0, 1.0, 0.0]))
    rod.export(tmp_path / "rod.stl")
    tool = {"mesh": "rod.stl", "material": "wall", "particle_radius": 0.002, "max_speed": 0.5, "contact": request.param}
    pose = {"position": [0.0, 0.0, 0.0], "rpy": [0.0, -0.7, 0.4]}
    domain = {"low": [-0.5] * 3, "high": [0.5] * 3}
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.45]], 0.005, domain=domain, tools={"drill": tool | {"pose": pose}})
    return World(read_scene(scene, tmp_path))


def turned(drill, angle, time):
    """The drill is to have turned by an angle [rad] about its own axis until a time [s]."""
    x, y, z, w = drill.tools[0].tool.pose.orientation
    sine, cosine = np.sin(0.5 * angle), np.cos(0.5 * angle)
    turn = np.array([w * sine + x * cosine, z * sine + y * cosine, z * cosine - y * sine, w * cosine - x * sine])
    return ToolPose("drill", np.zeros(3), turn, time)


def test_a_long_tool_may_turn_about_its_axis_as_fast_as_its_surface_may_move(drill):
    surface = RADIUS + drill.tools[0].margin
    angle, reached = 1.0, surface * 1.0 / 0.5
    with pytest.raises(CommandError, match=r"drill' would move at 0\.55 m/s, its max_speed is 0\.5 m/s"):
        drill.apply(turned(drill, angle, reached / 1.1))
    drill.apply(turned(drill, angle, reached))
    steps, tools = round(0.2 * reached / drill.time_step), drill.assembly.solver.arrays.tools
    drill.step(5)
    before = float(tools.travelled.numpy()[0])
    drill.step(20)
    way = float(tools.travelled.numpy()[0]) - before
    assert 1.0 <= way / (0.5 * 20 * drill.time_step) < 1.06  # by which its list is made anew; one step more may be counted
    drill.step(steps)
    assert np.linalg.norm(drill.observe().tool("drill").spin) == pytest.approx(0.5 / surface, rel=1e-6)
