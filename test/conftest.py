"""Scenes for tests, and a ROS domain of their own."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "support"))

# A domain of our own, heard on this machine only, whatever else runs on the network; above 101 its ports are those that
# Linux gives to anyone. Set before any rclpy import.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from scenes import SceneMaker


@pytest.fixture
def make_world(tmp_path):
    """``make_world(position, radius, ...)`` builds a world of explicitly placed grains; see ``scenes.SceneMaker``."""
    return SceneMaker(tmp_path).world
