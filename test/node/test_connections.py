"""Messages that come in fast: they gather, so that bringing them takes little from stepping, and none is lost."""

import time

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from sand_sim.node import connections
from sand_sim.node.connections import COMMANDS_DEPTH, Connections

pytestmark = pytest.mark.xdist_group("processes")  # others count the files that the middleware shares


class Chatter:
    """A node that hears itself."""

    def __init__(self, monkeypatch, in_haste: bool):
        self.rests, self.heard = [], []
        sleep = time.sleep
        monkeypatch.setattr(connections.time, "sleep", lambda rest: (self.rests.append(rest), sleep(rest)))
        self.node = rclpy.create_node("chatter")
        made = Connections(self.node, lambda: in_haste)
        made.subscription(String, "~/chat", lambda message: self.heard.append(message.data))
        self.publisher = self.node.create_publisher(String, "~/chat", COMMANDS_DEPTH)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def say(self, number: int) -> None:
        for k in range(number):
            self.publisher.publish(String(data=str(k)))

    def listen(self, number: int) -> None:
        end = time.monotonic() + 20.0
        while len(self.heard) < number and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def chatter(monkeypatch, ros):
    made = []

    def make(in_haste: bool) -> Chatter:
        made.append(Chatter(monkeypatch, in_haste))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_rest_follows_a_few_messages(chatter):
    one = chatter(in_haste=False)
    for number in range(1, 21):
        one.say(1)
        one.listen(number)
    assert len(one.heard) == len(one.rests) == 20
    assert all(0.0 < rest <= 0.005 for rest in one.rests)


def test_no_rest_where_each_message_counts(chatter):
    one = chatter(in_haste=True)
    one.say(1)
    one.listen(1)
    assert (len(one.heard), one.rests) == (1, [])


def test_no_rest_where_other_nodes_would_have_to_wait(chatter):
    one = chatter(in_haste=False)
    other = rclpy.create_node("other")
    one.executor.add_node(other)
    one.say(1)
    one.listen(1)
    other.destroy_node()
    assert (len(one.heard), one.rests) == (1, [])


def test_no_rest_after_many_messages(chatter):
    one = chatter(in_haste=False)
    one.say(50)
    time.sleep(0.2)
    one.rests.clear()
    one.listen(50)
    assert len(one.heard) == 50
    assert one.rests == []


def test_all_that_was_said_at_once_is_heard(chatter):
    """Also where the executor is too busy to listen meanwhile."""
    one = chatter(in_haste=True)
    one.say(1000)
    one.listen(1000)
    assert one.heard == [str(number) for number in range(1000)]
