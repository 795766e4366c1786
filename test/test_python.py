"""A world as programs use it: what makes no sense is refused in words, and a scene can be handed on."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import CommandError, SceneError, ToolPose, ToolVelocity, World, load_scene


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return World(load_scene(write_small_scene(tmp_path_factory.mktemp("scene"))))


@pytest.mark.parametrize(("kind", "known"), [("tool", "plate"), ("wall", "floor"), ("body", "none")])
def test_reports_that_are_not_there_are_told(world, kind, known):
    """``StopIteration`` would end the generator of whoever asks, in silence."""
    with pytest.raises(KeyError, match=f"there is no {kind} 'spade'; there are {known}"):
        getattr(world.observe(), kind)("spade")


def test_a_wall_is_not_told_in_place_of_another_of_its_name(make_world):
    """Boundaries without names are called by their type, and the force on the last of them is not that on all."""
    planes = [{"type": "plane", "material": "wall", "point": [0, 0, -z], "normal": [0, 0, 1]} for z in (0.0, 0.1)]
    seen = make_world([[0.0, 0.0, 0.01]], 0.005, boundaries=planes).observe()
    with pytest.raises(KeyError, match="there is more than one wall 'plane'; there are plane, plane"):
        seen.wall("plane")


@pytest.mark.parametrize(
    ("position", "orientation", "told"),
    [
        ([0.0, 0.0], [0.0, 0.0, 0.0, 1.0], r"tool 'plate': position must be of shape \(3,\), not \(2,\)"),
        ([0.0, 0.0, 0.1], [0.0, 0.0, 0.1], r"tool 'plate': orientation must be of shape \(4,\), not \(3,\)"),
        ([[0.0, 0.0, 0.1]], [0.0, 0.0, 0.0, 1.0], r"tool 'plate': position must be of shape \(3,\), not \(1, 3\)"),
        (["a", "b", "c"], [0.0, 0.0, 0.0, 1.0], "tool 'plate': position, orientation and time must be numbers"),
    ],
)
def test_poses_of_another_shape_are_refused(world, position, orientation, told):
    with pytest.raises(CommandError, match=told):
        world.apply(ToolPose("plate", np.array(position), np.array(orientation)))


def test_a_time_that_is_no_number_is_refused(world):
    with pytest.raises(CommandError, match="position, orientation and time must be numbers"):
        world.apply(ToolPose("plate", np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.0, 1.0]), "soon"))


def test_half_a_turn_at_once_is_refused_with_how_far_to_go(world):
    """No pose tells which way round it is reached."""
    spin = ToolVelocity("plate", np.zeros(3), np.array([0.0, 0.0, 20.0]))
    with pytest.raises(CommandError, match=r"half a turn or more in 0.2 s, .*; go by less than 0.157 s at once"):
        world.pose_after(spin, 0.2)
    assert world.pose_after(spin, 0.15).orientation == pytest.approx([0.0, 0.0, np.sin(1.5), np.cos(1.5)])


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        (2.5, r"must be a whole number, got 2.5; for t seconds give 'round\(t / world.time_step\)'"),
        (-1, "a world is stepped forward, got -1 steps; go back by 'restore'"),
    ],
)
def test_a_part_of_a_step_and_steps_back_are_refused(world, steps, told):
    with pytest.raises(CommandError, match=told):
        world.step(steps)
    assert world.steps == 0


def test_numbers_of_steps_may_come_from_numpy(world):
    begin = world.save()
    world.step(np.int64(2))
    assert world.steps == 2
    world.restore(begin)


def test_the_name_of_a_file_is_no_scene():
    with pytest.raises(SceneError, match=r"scene: must be a Scene, got 'dig.yaml'; 'load_scene\(path\)' reads one"):
        World("dig.yaml")


def test_the_scene_of_a_world_goes_to_other_processes(world):
    again = World(pickle.loads(pickle.dumps(world.scene)))
    assert again.scene == world.scene
    for here in (world, again):
        here.reset()
        here.step(50)
    assert np.array_equal(world.observe().grains.position, again.observe().grains.position)


def test_a_scene_may_have_gravity_as_numpy_gives_it(tmp_path):
    """Whether velocities carry over is a choice of the kernels, which take Python's own ``bool`` alone."""
    scene = load_scene(write_small_scene(tmp_path))
    world = World(replace(scene, gravity=tuple(np.array([0.5, 0.0, -9.8]))))
    world.step(1)
    assert world.steps == 1
