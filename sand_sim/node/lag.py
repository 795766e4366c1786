"""A warning where simulated time lags behind the wall clock that tools are driven by: in the sand they move too fast then."""

import time
from collections.abc import Callable

from sand_sim.simulation import Simulation

_PERIOD = 5.0  # [s] wall over which speed is judged: longer than the hitches of a busy machine
_KEPT = 0.8  # least share of the asked speed that counts as kept


class LagWatch:
    """Sees whether simulated time falls behind while poses without stamps come in.

    Args:
        simulation: that runs.
        warn: takes what there is to say, the first time.
    """

    def __init__(self, simulation: Simulation, warn: Callable[[str], None]):
        self._simulation, self._warn = simulation, warn
        self._begin_anew(0.0)

    def look(self, simulated: float) -> str:
        """What is wrong, empty if nothing is; to be asked about once a second with the simulated time [s]."""
        simulation, wall = self._simulation, time.monotonic() - self._wall
        advance = simulated - self._simulated
        if simulation.paused or simulation.pacing != "realtime" or advance < 0.0:
            self._begin_anew(simulated)
        elif wall > _PERIOD and advance > 0.0:
            slowness, unstamped = wall * simulation.real_time_factor / advance, simulation.courses.unstamped - self._unstamped
            self._begin_anew(simulated)
            if unstamped and slowness * _KEPT > 1.0:
                self._told = (
                    f"simulated time keeps only {advance / wall:.2g} of real time where real_time_factor is "
                    f"{simulation.real_time_factor:g}, so poses without stamps move tools about {slowness:.1f} times as fast in "
                    "the sand; stamp them with simulated time (use_sim_time), or send them slower and lower real_time_factor"
                )
                if self._warn:
                    self._warn(self._told)
                    self._warn = None
        return self._told

    def _begin_anew(self, simulated: float) -> None:
        self._wall, self._simulated, self._unstamped = time.monotonic(), simulated, self._simulation.courses.unstamped
        self._told = ""
