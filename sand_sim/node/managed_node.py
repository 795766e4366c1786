"""A lifecycle node whose transitions, asked for at any moment, end neither the node nor what its clients wait for."""

from rclpy.lifecycle import LifecycleNode

from sand_sim.node.services import Services


class ManagedNode(LifecycleNode):
    """Refuses impossible transitions, where rclpy raises in its service, and makes the others when all else is answered.

    Attributes:
        answering: services whose answers are under way, None while there are none.
    """

    answering: Services | None = None

    async def _LifecycleNodeMixin__on_change_state(self, request, response):  # noqa: N802
        asked, machine = request.transition, self._state_machine
        possible = {number: label for number, label, *_ in machine.available_transitions}
        if (asked.label or possible.get(asked.id)) not in possible.values():
            name = asked.label or dict(edge[:2] for edge in machine.transition_graph).get(asked.id, asked.id)
            self.get_logger().warning(f"transition '{name}' is not possible now; possible are {', '.join(possible.values())}")
            response.success = False
            return response
        if self.answering:
            await self.answering.quiet()  # an answer whose service has gone reaches nobody, and raises in the executor
        return super()._LifecycleNodeMixin__on_change_state(request, response)
