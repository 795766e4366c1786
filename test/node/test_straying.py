"""A tool that leaves the domain, as with poses in millimetres, feels nothing: that must not be silent."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import START
from scenes import write_small_scene
from std_srvs.srv import Trigger

from sand_sim import ToolPose, World, load_scene
from sand_sim.courses import USUAL, Courses
from sand_sim.node.straying import StrayWatch


def test_a_tool_that_has_left_the_domain_wholly_is_told_of_once(tmp_path):
    """The plate of 60 x 60 x 4 mm and 3 mm of particles around reaches 45.5 mm; the domain ends at x = 0.25 m."""
    world, warned = World(load_scene(write_small_scene(tmp_path))), []
    watch, (plate,) = StrayWatch(world, warned.append), world.observe().tools

    def strayed(x):
        return watch.look((replace(plate, position=np.array([x, 0.0, 0.1])),))

    assert strayed(0.0) == strayed(0.294) == []
    assert not warned
    assert strayed(0.297) == strayed(15.0) == strayed(-15.0) == ["plate"]
    (told,) = warned
    assert "'plate' has left the domain, [-0.2, -0.2, -0.05] to [0.25, 0.25, 0.3] m, and is at [0.297, 0.0, 0.1] m" in told


def test_a_tool_that_gets_where_it_is_told_much_too_late_is_told_of_once(tmp_path):
    """The first pose without a stamp is to be reached within a gap of 0.2 s, one that comes at the same time at once."""
    world, warned = World(load_scene(write_small_scene(tmp_path))), []
    courses, watch, (plate,) = Courses(world, False, USUAL), StrayWatch(world, warned.append), world.observe().tools
    speed = world.scene.tool("plate").max_speed
    for distance in (1.1 * speed, 5.2 * speed, 9.0 * speed):
        target = ToolPose("plate", plate.position + [distance, 0.0, 0.0], plate.orientation)
        courses.take([target], pytest.fail)
        watch.look_at_delays(courses)
        assert bool(warned) == (distance > 1.2 * speed)
    (told,) = warned
    assert f"tool 'plate' is told to go where it gets 5.2 s later than asked at its max_speed of {speed:g} m/s" in told


def test_it_is_told_on_diagnostics(client, start_node):
    start_node(pacing="fast", points_rate=0.0)
    client.connect()
    client.wait_for(lambda: client.diagnosed("tools outside of the domain") == "")
    client.send(1000.0 * START)
    client.wait_for(lambda: client.diagnosed("tools outside of the domain") == "plate")
    client.call(Trigger, "reset")
    client.wait_for(lambda: client.diagnosed("tools outside of the domain") == "")
