"""The node's health once a second on ``/diagnostics``."""

import os
import time
from collections.abc import Callable
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from msg_adapters.diagnostic_msgs import health_to_diagnostics
from sand_sim.border import Observation
from sand_sim.node.lag import LagWatch
from sand_sim.node.straying import StrayWatch
from sand_sim.simulation import Simulation


class Diagnosis:
    """Error indicators, speed, memory, and what was refused.

    Args:
        simulation: that runs.
        name: of the node, with its namespace.
        warn: takes what there is to say of it once.
    """

    def __init__(self, simulation: Simulation, name: str, warn: Callable[[str], None]):
        self._simulation, self._name = simulation, name
        self._lag, self._strays = LagWatch(simulation, warn), StrayWatch(simulation.world, warn)
        self._before = (time.monotonic(), 0.0)

    def tell(self, last: Observation, dropped: int, unwritten: list[str]) -> DiagnosticArray:
        """The state of things.

        Args:
            last: what was shown last.
            dropped: clouds that were not told for want of time.
            unwritten: files that cannot be written, and why.
        """
        simulation = self._simulation
        rejected = dict(simulation.rejected)
        self._strays.look_at_delays(simulation.courses)
        further = {
            "real-time factor": f"{self._real_time_factor(last.time):.4f}",
            "wall time of a step [us]": f"{1e6 * simulation.step_time:.4g}",
            "memory [MB]": f"{_resident_memory() / 1e6:.0f}",
            "commands slowed to max_speed": str(simulation.courses.limited),
            "commands in place of one with the same stamp": str(simulation.courses.alike),
            "tools outside of the domain": ", ".join(self._strays.look(last.tools)),
            "clouds dropped": str(dropped),
            "commands rejected": str(sum(rejected.values())),
            "last rejection": simulation.last_rejection,
        } | {f"commands rejected: {reason}": str(count) for reason, count in rejected.items()}
        device = simulation.world.assembly.solver.device.label
        message = health_to_diagnostics(last.health, last.time, f"{self._name}: world", device, further, self._state())
        status = message.status[0]
        for trouble in filter(None, (self._lag.look(last.time), *unwritten)):
            status.message = trouble if status.level == DiagnosticStatus.OK else f"{status.message}; {trouble}"
            status.level = DiagnosticStatus.WARN
        if simulation.fault is not None:
            status.level = DiagnosticStatus.ERROR
            status.message = f"stepping has stopped: {simulation.fault}"
        return message

    def _state(self) -> str:
        if self._simulation.fault is not None:
            return "stopped"
        if self._simulation.paused:
            return "paused"
        if self._simulation.pacing != "lockstep":
            return "running"
        if not self._simulation.courses.by_tool:
            return "in lockstep: waiting for ~/step"
        awaited = self._simulation.courses.awaited()
        return f"in lockstep: waiting for the next command of {', '.join(awaited)}" if awaited else "running"

    def _real_time_factor(self, simulated: float) -> float:
        """Since the last time it was asked; 0 after a reset."""
        (wall, before), now = self._before, time.monotonic()
        self._before = (now, simulated)
        return max(simulated - before, 0.0) / max(now - wall, 1e-9)


def _resident_memory() -> int:
    """Bytes of this process that are in memory; 0 where that cannot be read."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0
