"""A client that is no ROS node, of another DDS implementation and in another process: poses in, wrenches out, services."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("cyclonedds", reason="needs an independent DDS implementation")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE
from rclpy.qos import ReliabilityPolicy

FOREIGNER = Path(__file__).parent.parent / "support" / "dds_client.py"


@pytest.fixture
def foreigner():
    """``foreigner(task)`` carries out a task of ``dds_client.py`` and gives what it prints."""

    def run(task):
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        done = subprocess.run(
            [sys.executable, FOREIGNER, domain, task], capture_output=True, text=True, timeout=2 * PATIENCE, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    return run


def test_a_foreigner_drives_a_tool_and_feels_the_sand(foreigner, start_node):
    node = start_node(pacing="lockstep")
    force, lossy_force, step = (float(word) for word in foreigner("press"))
    assert force == lossy_force > 1.0, "the bed pushes up"
    assert step == pytest.approx(0.52)
    assert node.simulation.fault is None
    assert node.simulation.rejected == {}


def test_bodies_that_are_no_poses_do_no_harm(client, foreigner, start_node):
    node = start_node(pacing="fast", points_rate=0.0)
    foreigner("babble")
    before = node.simulation.world.time
    client.wait_for(lambda: node.simulation.world.time > before + 0.1)
    assert node.simulation.fault is None
    (heard,) = node.get_subscriptions_info_by_topic("/sand_sim/tools/plate/pose")
    assert heard.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    client.connect()
    client.send([0.015, 0.015, 0.05], at=node.simulation.world.time + 5.0)
    client.wait_for(lambda: node.simulation.world.arrival("plate") > before)
