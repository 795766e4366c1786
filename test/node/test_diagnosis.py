"""What is told of a node's health, of a simulation and on a clock of the test's own."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus

from sand_sim.border import Health
from sand_sim.node import diagnosis
from sand_sim.node.diagnosis import Diagnosis

SOUND = Health(1e-5, 1.0, 0.02, 1.0, 2.0, 3.0, 4.0, 5.0, 1e-9, 0.5, 123, 4, ())
REFUSED = {"too_fast": 2, "late": 3}


class Told:
    """A diagnosis of a simulation without tools."""

    def __init__(self, monkeypatch):
        self.wall, box = 50.0, SimpleNamespace(low=np.full(3, -1.0), high=np.full(3, 1.0))
        monkeypatch.setattr(diagnosis, "time", SimpleNamespace(monotonic=lambda: self.wall))
        solver = SimpleNamespace(device=SimpleNamespace(label="a processor"))
        self.simulation = SimpleNamespace(
            world=SimpleNamespace(tools=[], assembly=SimpleNamespace(lattice=box, solver=solver)),
            courses=SimpleNamespace(unstamped=0, limited=7, alike=8, delays={}),
            rejected=Counter(REFUSED),
            last_rejection="tool 'plate': too late",
            step_time=2.5e-4,
            paused=False,
            pacing="fast",
            real_time_factor=1.0,
            fault=None,
        )
        self.diagnosis = Diagnosis(self.simulation, "/sand", lambda text: None)

    def after(self, wall, time, unwritten=(), **health):
        """Status a wall time later [s], at a simulated time [s]."""
        self.wall += wall
        last = SimpleNamespace(health=Health(**(vars(SOUND) | health)), time=time, tools=())
        message = self.diagnosis.tell(last, 6, list(unwritten))
        status = message.status[0]
        return status, {entry.key: entry.value for entry in status.values}


@pytest.fixture
def told(monkeypatch):
    return Told(monkeypatch)


def test_speed_is_simulated_over_wall_time_since_it_was_told_last(told):
    factors = [told.after(wall, time)[1]["real-time factor"] for wall, time in ((2.0, 0.5), (0.5, 1.0), (1.0, 0.0), (4.0, 1.0))]
    assert factors == ["0.2500", "1.0000", "0.0000", "0.2500"], "0 after a reset"


def test_numbers_are_told_in_their_units(told):
    _, values = told.after(1.0, 0.5)
    assert values["wall time of a step [us]"] == "250"
    with open("/proc/self/status") as file:
        resident = next(1024 * int(line.split()[1]) for line in file if line.startswith("VmRSS"))
    assert float(values["memory [MB]"]) == pytest.approx(resident / 1e6, rel=0.1)
    assert values["commands slowed to max_speed"] == "7"
    assert values["commands in place of one with the same stamp"] == "8"
    assert values["clouds dropped"] == "6"
    assert values["commands rejected"] == "5"
    assert {key: values[f"commands rejected: {key}"] for key in REFUSED} == {"too_fast": "2", "late": "3"}
    assert values["last rejection"] == "tool 'plate': too late"


def test_the_worst_decides_how_bad_it_is(told):
    status, _ = told.after(1.0, 0.5)
    assert (status.level, status.message, status.hardware_id) == (DiagnosticStatus.OK, "running", "a processor")
    told.simulation.paused = True
    assert told.after(1.0, 0.5)[0].message == "paused"
    status, _ = told.after(1.0, 0.5, ["no room", "no right"])
    assert (status.level, status.message) == (DiagnosticStatus.WARN, "no room; no right")
    status, _ = told.after(1.0, 0.5, ["no room"], doubts=("too deep",))
    assert (status.level, status.message) == (DiagnosticStatus.WARN, "too deep; no room")
    told.simulation.fault = RuntimeError("grain 3 is gone")
    status, _ = told.after(1.0, 0.5, ["no room"])
    assert (status.level, status.message) == (DiagnosticStatus.ERROR, "stepping has stopped: grain 3 is gone")


def test_what_it_waits_for_is_told_beside_doubts(told):
    """A doubt stays until a reset; whoever looks why time stands still then must not read of overlaps only."""
    told.simulation.pacing, told.simulation.courses.by_tool = "lockstep", {"plate": None}
    told.simulation.courses.awaited = lambda: ["plate"]
    status, values = told.after(1.0, 0.5, doubts=("too deep",))
    assert (status.message, values["state"]) == ("too deep", "in lockstep: waiting for the next command of plate")
    told.simulation.paused = True
    assert told.after(1.0, 0.5, doubts=("too deep",))[1]["state"] == "paused"
    told.simulation.fault = RuntimeError("grain 3 is gone")
    assert told.after(1.0, 0.5)[1]["state"] == "stopped"
