"""Quality of service of topics: what is usual, what parameters override, and what is said of partners that do not fit."""

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from rclpy.qos_overriding_options import QoSOverridingOptions

_POLICIES = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)
_STRONG = {"reliability": "reliable", "durability": "transient_local"}
_WEAK = {"reliability": "best_effort", "durability": "volatile"}


def usual_quality(depth: int, latched: bool) -> QoSProfile:
    """A profile of its own for each, because overriding changes it in place."""
    durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    return QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=depth, durability=durability)


def overridable() -> QoSOverridingOptions:
    """What the standard parameters ``qos_overrides`` may change."""
    return QoSOverridingOptions(_POLICIES)


def warn_of_subscriber(node: Node, topic: str) -> Callable:
    """What to do when a subscriber asks for more than our publisher offers."""
    return _warning(node, topic, "publisher", "a subscriber asks for", "hears nothing; let it ask for", _STRONG, _WEAK)


def warn_of_publisher(node: Node, topic: str) -> Callable:
    """What to do when a publisher offers less than our subscription asks for."""
    return _warning(node, topic, "subscription", "a publisher offers", "is not heard; let it offer", _WEAK, _STRONG)


def _warning(node: Node, topic: str, ours: str, meets: str, mend: str, found: dict, needed: dict) -> Callable:
    name = node.resolve_topic_name(topic)

    def warn(event) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind).lower()
        if policy in found:
            fix = f"{needed[policy]}, or start with -p qos_overrides.{name}.{ours}.{policy}:={found[policy]}"
            told = f"{meets} {found[policy]} and {mend} {fix}"
        else:
            told = f"{meets} a {policy} that does not fit and {mend} the usual one"
        node.get_logger().warning(f"{name}: {told}")

    return warn
