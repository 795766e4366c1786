"""Where tools begin: as the scene says, where their first poses say, or where they are put; and where bodies are put."""

from functools import partial

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from geometry_msgs.msg import PoseStamped
from node_client import START, ask
from std_srvs.srv import Trigger

ELSEWHERE = [0.1, -0.1, 0.2]


@pytest.fixture
def places(client):
    """Where the plate was last told to be."""
    heard = []

    def hear(message):
        at = message.pose.position
        heard.append([at.x, at.y, at.z])

    client.node.create_subscription(PoseStamped, "/sand_sim/tools/plate/pose_actual", hear, 10)
    return heard


def test_a_tool_begins_where_its_arm_is(client, start_node, places):
    """Also while the run is held; the second pose is a way, and after a reset the next one is the first again."""
    node = start_node(pacing="fast", paused=True, **{"tools.plate.start": "first_pose"})
    client.connect()
    for begin in (ELSEWHERE, [-0.1, 0.1, 0.1]):
        client.send(begin)
        client.wait_for(lambda: places and places[-1] == pytest.approx(begin))  # noqa: B023
        assert client.time == 0.0
        client.send(START)
        client.call(Trigger, "step")
        client.wait_for(lambda: client.time > 0.0)
        assert 0.02 < np.linalg.norm(node.simulation.world.observe().tools[0].position - START) < 0.3, "on its way"
        client.call(Trigger, "reset")
        client.wait_for(lambda: places[-1] == pytest.approx(START))
    assert node.simulation.rejected == {}


def test_a_tool_is_put_somewhere_else(client, start_node, places):
    node = start_node(pacing="lockstep")
    client.connect()
    put = partial(ask, client, "place_tool")
    assert put(tool="plate", position=ELSEWHERE, orientation=[0.0, 0.0, 2.0, 0.0]) == (True, "tool 'plate' is there")
    client.wait_for(lambda: places and places[-1] == pytest.approx(ELSEWHERE))
    report = node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]
    assert report.orientation == pytest.approx([0.0, 0.0, 1.0, 0.0])
    for arguments, reason in (
        ({"position": ELSEWHERE}, "argument 'tool' is missing"),
        ({"tool": "spade", "position": ELSEWHERE}, "'spade' is unknown"),
        ({"tool": "plate", "position": [0.0, 0.0]}, "position must be of shape (3,)"),
        ({"tool": "plate", "position": [0.0, 0.0, float("nan")]}, "must be finite"),
        ({"tool": "plate", "position": ELSEWHERE, "orientation": [0.0] * 4}, "orientation is"),
        ({"tool": "plate", "position": [0.015, 0.015, 0.01]}, "cuts into"),
    ):
        good, told = put(**arguments)
        assert not good
        assert reason in told
    report = node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]
    assert report.position == pytest.approx(ELSEWHERE)
    client.send(START, at=1.0)
    client.wait_for(lambda: client.time > 0.99)
    client.wait_for(lambda: places[-1] == pytest.approx(START))


def test_a_body_is_put_somewhere_else(client, start_node):
    bell = {"spheres": [[-0.01, 0, 0, 0.01], [0.012, 0, 0, 0.008]], "material": "sand", "pose": {"position": [0.1, 0.1, 0.1]}}
    node = start_node({"bodies": {"bell": bell}}, pacing="lockstep")
    client.connect()
    put = partial(ask, client, "place_body")
    assert put(body="bell", position=ELSEWHERE, velocity=[0.0, 0.0, 1.0], spin=[0.0, 2.0, 0.0]) == (True, "body 'bell' is there")
    report = node.simulation.request(node.simulation.world.observe).result(30.0).bodies[0]
    assert report.position == pytest.approx(ELSEWHERE, abs=1e-7)
    assert report.velocity == pytest.approx([0.0, 0.0, 1.0])
    assert report.spin == pytest.approx([0.0, 2.0, 0.0], abs=1e-6)
    for arguments, reason in (
        ({"body": "bell"}, "argument 'position' is missing"),
        ({"body": "rock", "position": ELSEWHERE}, "'rock' is unknown"),
        ({"body": "bell", "position": [0.015, 0.015, 0.01]}, "overlaps grains"),
    ):
        good, told = put(**arguments)
        assert not good
        assert reason in told


def test_velocities_tell_no_place_to_begin(ros, start_node):
    with pytest.raises(ValueError, match=r"tools\.plate\.start: 'first_pose' needs poses, and its source is 'twist'"):
        start_node(**{"tools.plate.start": "first_pose", "tools.plate.source": "twist"})
