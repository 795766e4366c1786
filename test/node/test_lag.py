"""A machine that does not keep real time, and tools that are driven by the wall clock all the same."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from diagnostic_msgs.msg import DiagnosticStatus
from node_client import START

from sand_sim.node import lag
from sand_sim.node.lag import LagWatch


class Watched:
    """A simulation that keeps a part of real time, on a clock of its own."""

    def __init__(self, monkeypatch, **further):
        usual = {"pacing": "realtime", "paused": False, "real_time_factor": 1.0}
        self.simulation = SimpleNamespace(courses=SimpleNamespace(unstamped=0), **(usual | further))
        self.wall = self.simulated = 0.0
        self.warned = []
        monkeypatch.setattr(lag.time, "monotonic", lambda: self.wall)
        self.watch = LagWatch(self.simulation, self.warned.append)

    def pass_seconds(self, number, kept, unstamped=0):
        """What is told second by second."""
        told = []
        for _ in range(number):
            self.wall += 1.0
            self.simulated += kept
            self.simulation.courses.unstamped += unstamped
            told.append(self.watch.look(self.simulated))
        return told


def test_poses_by_the_wall_clock_while_real_time_is_not_kept(monkeypatch):
    watched = Watched(monkeypatch)
    told = watched.pass_seconds(30, kept=0.14, unstamped=50)
    assert told[0] == "", "a hitch is no lag"
    assert "keeps only 0.14 of real time" in told[-1]
    assert "about 7.1 times as fast in the sand; stamp them with simulated time" in told[-1]
    assert len(watched.warned) == 1
    assert watched.pass_seconds(15, kept=0.14)[-1] == "", "nobody sends any more"
    assert watched.pass_seconds(15, kept=0.95, unstamped=50)[-1] == ""


@pytest.mark.parametrize(("kept", "told"), [(0.82, False), (0.78, True)])
def test_eight_tenths_count_as_kept_as_documented(monkeypatch, kept, told):
    assert any(Watched(monkeypatch).pass_seconds(30, kept, unstamped=50)) == told


def test_what_is_asked_counts(monkeypatch):
    watched = Watched(monkeypatch, real_time_factor=0.1)
    assert not any(watched.pass_seconds(30, kept=0.09, unstamped=50))
    told = watched.pass_seconds(30, kept=0.02, unstamped=50)[-1]
    assert "where real_time_factor is 0.1, so poses without stamps move tools about 5.0 times as fast" in told


@pytest.mark.parametrize("further", [{"paused": True}, {"pacing": "fast"}, {"pacing": "lockstep"}])
def test_no_real_time_is_asked_for(monkeypatch, further):
    watched = Watched(monkeypatch, **further)
    assert not any(watched.pass_seconds(30, kept=0.1, unstamped=50))


def test_a_reset_and_frames_that_take_long(monkeypatch):
    watched = Watched(monkeypatch)
    watched.pass_seconds(4, kept=1.0, unstamped=50)
    watched.simulated = 0.0
    assert not any(watched.pass_seconds(12, kept=0.0, unstamped=50)), "nothing to judge by before a frame has ended"
    assert "keeps only" in watched.pass_seconds(1, kept=0.5, unstamped=50)[-1]


def test_it_is_told_on_diagnostics(client, start_node, monkeypatch):
    """A thousand times real time is more than any machine keeps."""
    monkeypatch.setattr(lag, "_PERIOD", 0.5)
    start_node(pacing="realtime", real_time_factor=1000.0, points_rate=0.0)
    client.connect()
    client.wait_for(lambda: client.diagnostics)
    assert "keeps only" not in client.diagnostics[-1].status[0].message

    def warned():
        client.send(START)
        return "keeps only" in client.diagnostics[-1].status[0].message

    client.wait_for(warned)
    assert client.diagnostics[-1].status[0].level == DiagnosticStatus.WARN
