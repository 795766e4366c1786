"""Tools that are not where somebody means them to be, mostly because of poses in millimetres or of another frame.

Those that have left the domain, where alone grains are, and those that go on at ``max_speed`` long after they should be there.
"""

from collections.abc import Callable

import numpy as np

from sand_sim.border import ToolReport
from sand_sim.courses import Courses
from sand_sim.world import World

_LATE = 1.0  # [s]; the first pose of a stream may well be some distance away


class StrayWatch:
    """Warns once of each tool that is told to go where nothing is to be felt, or where it cannot be in time.

    Args:
        world: that the tools are in.
        warn: takes what there is to say.
    """

    def __init__(self, world: World, warn: Callable[[str], None]):
        self._world, self._warn = world, warn
        self._told: set[str] = set()
        self._told_late: set[str] = set()

    def look(self, tools: tuple[ToolReport, ...]) -> list[str]:
        """Names of the tools that are wholly outside of the domain."""
        low, high = self._world.assembly.lattice.low, self._world.assembly.lattice.high
        strayed = []
        for model, tool in zip(self._world.tools, tools, strict=True):
            if np.linalg.norm(np.clip(tool.position, low, high) - tool.position) > model.extent:
                strayed.append(tool.name)
                if tool.name not in self._told:
                    self._told.add(tool.name)
                    self._warn(
                        f"tool '{tool.name}' has left the domain, {np.round(low, 3).tolist()} to {np.round(high, 3).tolist()} m, "
                        f"and is at {np.round(tool.position, 3).tolist()} m: no grain is there; see that its poses are in metres "
                        "and of the frame that they name, or give the scene a larger 'domain'"
                    )
        return strayed

    def look_at_delays(self, courses: Courses) -> None:
        """Warn of tools that ``max_speed`` makes late, which nothing else shows."""
        for tool, delay in dict(courses.delays).items():
            if delay > _LATE and tool not in self._told_late:
                self._told_late.add(tool)
                self._warn(
                    f"tool '{tool}' is told to go where it gets {delay:.1f} s later than asked at its max_speed of "
                    f"{self._world.scene.tool(tool).max_speed:g} m/s; see that its poses are in metres, of the frame that they "
                    f"name, and begin where the tool is (pose_actual), or let it begin where they do (tools.{tool}.start:="
                    "first_pose), or raise max_speed in the scene"
                )
