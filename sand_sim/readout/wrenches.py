"""Mean wrenches on tools, from the impulses that the solver sums up."""

import numpy as np

from sand_sim.engine.tool_body import Tools


class MeanWrenches:
    """Means since somebody looked before; those who observe and those who feel a tool look each at times of their own.

    Attributes:
        steps: done at the last observation.
        wrench: on each tool then, force and torque about the tool frame's origin, world frame, shape (tools, 2, 3) [N], [N m];
            None without tools.

    Args:
        tools: of the world, None if there are none.
        now: steps done.
        steps, wrench: as above; of now if left out.
    """

    def __init__(self, tools: Tools | None, now: int, steps: int | None = None, wrench: np.ndarray | None = None):
        self.steps, self.wrench = now if steps is None else steps, wrench
        if tools:
            self.wrench = tools.wrench.numpy().copy() if wrench is None else wrench
            self._felt_steps, self._felt_impulse = np.full(tools.number, now), tools.impulse.numpy().copy()

    def observe(self, tools: Tools | None, now: int, time_step: float, half_steps: bool) -> np.ndarray | None:
        """Means since the last observation, those of now if no time has passed, shape (tools, 2, 3).

        Args:
            tools: with wrenches brought up to now.
            now: steps done.
            time_step: [s].
            half_steps: whether the forces of now complete velocities by half a step.
        """
        passed, self.steps = (now - self.steps) * time_step, now
        if tools is None:
            return None
        before, self.wrench = self.wrench, tools.wrench.numpy().copy()
        if passed <= 0.0:
            return self.wrench
        impulse = tools.impulse.numpy().copy()
        tools.impulse.zero_()
        self._felt_impulse -= impulse
        if half_steps:  # at both ends, so that means times time are exactly the momentum that the grains show
            impulse += 0.5 * time_step * (self.wrench - before)
        return impulse / passed

    def feel(self, tools: Tools, tool: int, now: int, time_step: float) -> np.ndarray:
        """Mean on one tool over the steps since it was last felt, that of the last step if there is none, shape (2, 3)."""
        passed, self._felt_steps[tool] = (now - self._felt_steps[tool]) * time_step, now
        if passed <= 0.0:
            return tools.wrench.numpy()[tool].copy()
        impulse = tools.impulse.numpy()[tool].copy()
        gained, self._felt_impulse[tool] = impulse - self._felt_impulse[tool], impulse
        return gained / passed
