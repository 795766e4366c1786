"""Mean wrenches on tools, from the impulses that the solver sums up."""

import numpy as np

from sand_sim import rotation
from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.tool_body import Tools
from sand_sim.integrator import VERLET


class MeanWrenches:
    """Means since somebody looked before; those who observe and those who feel a tool look each at times of their own.

    Attributes:
        steps: done at the last observation.
        wrench: on each tool then, force and torque about the tool frame's origin in the axes of the world, then the same in those
            of the tool, shape (tools, 4, 3) [N], [N m]; None without tools.

    Args:
        arrays: of the world.
        turns: tool frames to world frame now, shape (tools, 4).
        now: steps done.
        steps, wrench: as above; of now if left out.
    """

    def __init__(self, arrays: DemArrays, turns, now: int, steps: int | None = None, wrench: np.ndarray | None = None):
        self.steps, self.wrench, tools = now if steps is None else steps, wrench, arrays.tools
        if tools:
            self.wrench = _in_both_axes(tools, turns) if wrench is None else wrench
            self._felt_steps, self._felt_impulse = np.full(tools.number, now), tools.impulse.numpy().copy()

    def observe(self, arrays: DemArrays, turns, now: int) -> np.ndarray | None:
        """Means since the last observation, those of now if no time has passed, shape (tools, 4, 3), as ``wrench``.

        Args:
            arrays: with wrenches brought up to now.
            turns: tool frames to world frame now, shape (tools, 4).
            now: steps done.
        """
        tools, dt = arrays.tools, arrays.setting.dt
        passed, self.steps = (now - self.steps) * dt, now
        if tools is None:
            return None
        before, self.wrench = self.wrench, _in_both_axes(tools, turns)
        if passed <= 0.0:
            return self.wrench
        impulse = tools.impulse.numpy().copy()
        tools.impulse.zero_()
        self._felt_impulse -= impulse
        if arrays.recipe.integrator == VERLET:
            # The half steps at both ends, so that means times time are exactly the momentum that the grains show.
            impulse += 0.5 * dt * (self.wrench - before)
        return impulse / passed

    def feel(self, arrays: DemArrays, tool: int, now: int) -> np.ndarray:
        """Mean on one tool over the steps since it was last felt, that of the last step if there is none, shape (2, 3).

        Force and torque are in the axes of the world.
        """
        tools, passed = arrays.tools, (now - self._felt_steps[tool]) * arrays.setting.dt
        self._felt_steps[tool] = now
        if passed <= 0.0:
            return tools.wrench.numpy()[tool].copy()
        impulse = tools.impulse.numpy()[tool].copy()
        gained, self._felt_impulse[tool] = impulse - self._felt_impulse[tool], impulse
        return gained[:2] / passed


def _in_both_axes(tools: Tools, turns) -> np.ndarray:
    """Wrenches of now in the axes of the world and of the tools, shape (tools, 4, 3)."""
    wrenches = tools.wrench.numpy()
    own = [rotation.rotate(rotation.inverse(turn), wrench) for turn, wrench in zip(turns, wrenches, strict=True)]
    return np.concatenate([wrenches, np.array(own)], axis=1)
