"""Services of an active node: step, reset, pause, resume, and what changes the world between two frames."""

import concurrent.futures
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from sand_sim.node.connections import Connections
from sand_sim.simulation import Simulation


class Services:
    """Answers when the stepping thread has done what is asked; other callbacks run meanwhile.

    Args:
        node: whose executor waits; its ``refusal`` says why nothing is done now, empty otherwise.
        connections: where services are made.
        simulation: that is asked.
        pause: called with whether to hold.
    """

    def __init__(self, node: Node, connections: Connections, simulation: Simulation, pause: Callable[[bool], None]):
        self._node, self._simulation, self._pause = node, simulation, pause
        self._unanswered: set[Future] = set()
        connections.service(Trigger, "~/step", self._waiting(simulation.step))
        connections.service(Trigger, "~/reset", self._waiting(simulation.reset))
        connections.service(Trigger, "~/pause", self._holding(True))
        connections.service(Trigger, "~/resume", self._holding(False))

    def _waiting(self, ask: Callable[[], concurrent.futures.Future]) -> Callable:
        async def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = await self.outcome(ask)
            return response

        return answer

    def _holding(self, paused: bool) -> Callable:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            refusal, fault = self._node.refusal, self._simulation.fault
            if fault is not None and not paused:
                refusal = refusal or f"stepping has stopped, reset to go on: {fault}"
            if not refusal:
                self._pause(paused)
            response.success, response.message = not refusal, refusal or ("paused" if paused else "running")
            return response

        return answer

    async def outcome(self, ask: Callable[[], concurrent.futures.Future]) -> tuple[bool, str]:
        """Whether what is asked has been done, and what to say of it."""
        if refusal := self._node.refusal:
            return False, refusal
        executor = self._node.executor
        finished, answered = Future(executor=executor), Future(executor=executor)

        def finish(done: concurrent.futures.Future) -> None:
            finished.set_result(_result(done))
            executor.wake()  # else it sees that only when it wakes for something else

        ask().add_done_callback(finish)
        self._unanswered.add(answered)
        error, told = await finished
        self._unanswered.discard(answered)
        answered.set_result(None)
        if error is not None:
            return False, str(error)
        return True, told or f"t = {self._simulation.world.time:.6f} s"

    async def quiet(self) -> None:
        """Wait until all that has been asked for by now is answered."""
        for answered in [*self._unanswered]:
            await answered


def _result(done: concurrent.futures.Future) -> tuple[Any, str]:
    """The error, or None and what was returned."""
    if done.cancelled():
        return "shutting down", ""
    if done.exception():
        return done.exception(), ""
    result = done.result()
    return None, f"t = {result:.6f} s" if isinstance(result, float) else str(result or "")
