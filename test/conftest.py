"""Scenes for tests, and a ROS domain of their own."""

import os
import signal
import socket
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "support"))


def claim_domain():
    """A ROS domain that nobody is in, and a socket that keeps other runs of these tests out of it."""
    for k in range(100):  # above 101 the ports are those that Linux gives to anyone
        domain = 1 + (os.getpid() + k) % 100
        claim = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            claim.bind(("", 7410 + 250 * domain))  # where the first participant of a domain listens; others take the next one
        except OSError:
            claim.close()
        else:
            return domain, claim
    raise RuntimeError("somebody is in each of the ROS domains 1 to 100")


# Heard on this machine only, whatever else runs on the network. Set before any rclpy import.
DOMAIN, CLAIM = claim_domain()
os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from scenes import SceneMaker

from sampler.cores import available_cores

WORKER = 1.5e9  # bytes that a worker may come to take, with the processes it starts: the kernels of many scenes stay loaded


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """A worker for each core, but no more than memory has room for."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return max(1, min(available_cores(), int(memory / WORKER)))


@pytest.fixture
def hears_hang_up():
    """Processes that a test starts hear SIGHUP, also where the tests themselves are started by nohup, which they inherit."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def make_world(tmp_path):
    """``make_world(position, radius, ...)`` builds a world of explicitly placed grains; see ``scenes.SceneMaker``."""
    return SceneMaker(tmp_path).world
