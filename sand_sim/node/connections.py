"""Publishers, subscriptions, services, actions and timers of a configured node, which come and go together."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher

from sand_sim.node.quality import overridable, usual_quality, warn_of_publisher, warn_of_subscriber
from sand_sim.simulation import MOST_UNREAD

COMMANDS_DEPTH = MOST_UNREAD  # the middleware overwrites what is more without a word; the simulation refuses it and counts
_MOST_IN_TURN = 100  # messages of one topic that are heard before others get their turn
_RESTS, _LONGEST_REST = 8.0, 0.005  # after messages came in: times the processor time that took, and at most [s]
_MANY = 8  # messages that came in at once, after which there is no time to rest


class Connections:
    """Makes them with quality of service that parameters can override, and takes all of them back.

    Args:
        node: they belong to.
        in_haste: tells whether each message must be heard at once.
    """

    def __init__(self, node: Node, in_haste: Callable[[], bool]):
        self._node, self._in_haste, self._spent = node, in_haste, time.thread_time()
        self._undo: list[Callable[[], Any]] = []
        self._waiting = ReentrantCallbackGroup()  # in the usual group one that waits would keep all others from being heard

    def publisher(self, kind: type, topic: str, latched: bool = False) -> Publisher:
        """Reliable, keep last 5, volatile unless latched."""
        made = self._made(
            self._node.create_publisher,
            kind,
            topic,
            qos_profile=usual_quality(1 if latched else 5, latched),
            event_callbacks=PublisherEventCallbacks(incompatible_qos=warn_of_subscriber(self._node, topic)),
        )
        self._undo.append(lambda: self._node.destroy_publisher(made))
        return made

    def subscription(self, kind: type, topic: str, hear: Callable, latched: bool = False) -> None:
        """Reliable, keep last of as many as may wait for the simulation, so that all of a path sent at once are heard."""

        def hear_all(message: Any) -> None:
            hear(message)
            # What else has come in is taken at once: the executor needs ten times as long to bring one message.
            heard = 1
            while heard <= _MOST_IN_TURN:
                with handle:
                    taken = handle.take_message(kind, False)
                if taken is None:
                    break
                hear(taken[0])
                heard += 1
            if heard < _MANY:
                self._rest()

        made = self._made(
            self._node.create_subscription,
            kind,
            topic,
            hear_all,
            qos_profile=usual_quality(COMMANDS_DEPTH, latched),
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=warn_of_publisher(self._node, topic)),
        )
        handle = made.handle  # with the subscription itself its callback would be a cycle, which keeps all that it tells
        self._undo.append(lambda: self._node.destroy_subscription(made))

    def service(self, kind: type, name: str, answer: Callable) -> None:
        """A service; while its answer is awaited, others are answered and messages are heard."""
        made = self._node.create_service(kind, name, answer, callback_group=self._waiting)
        self._undo.append(lambda: self._node.destroy_service(made))

    def action(self, kind: type, name: str, execute: Callable, cancel: Callable) -> None:
        """An action, with what runs a goal and what answers a wish to cancel it."""
        made = ActionServer(self._node, kind, name, execute, cancel_callback=cancel, callback_group=self._waiting)
        self._undo.append(made.destroy)

    def timer(self, period: float, act: Callable[[], None]) -> None:
        """A timer by the wall clock [s]."""
        made = self._node.create_timer(period, act, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._undo.append(lambda: self._node.destroy_timer(made))

    def close(self) -> None:
        """Destroy all of them."""
        while self._undo:
            self._undo.pop()()

    def _rest(self) -> None:
        """Let messages gather, so that bringing a few takes no more than a ninth of a core from the threads that step.

        Not where the executor has other nodes, too: they would have to wait.
        """
        if not self._in_haste() and len(self._node.executor.get_nodes()) == 1:
            spent = max(0.0, time.thread_time() - self._spent)  # the thread need not be the one that made the connections
            time.sleep(min(_RESTS * spent, _LONGEST_REST))
        self._spent = time.thread_time()

    def _made(self, create: Callable, kind: type, topic: str, *further, **options) -> Any:
        try:
            return create(kind, topic, *further, qos_overriding_options=overridable(), **options)
        except RuntimeError as error:
            raise ValueError(f"parameters qos_overrides.{self._node.resolve_topic_name(topic)}: {error}") from None
