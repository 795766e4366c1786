"""Other nodes that publish what they should not: the middleware keeps quiet about them."""

from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node

from sand_sim.node.parameters import Parameters
from sand_sim.showing import shown

_TYPES = {"pose": PoseStamped, "twist": TwistStamped}
_NOT_YET_KNOWN, _NO_NODE = "_NODE_NAME_UNKNOWN_", "_CREATED_BY_BARE_DDS_APP_"
_MOST_TOLD = 100
_TWO_OF_A_NAME = (
    "end one of them, or start it with -r __node:=second -p publish_clock:=false "
    "(one that was killed stays known for some seconds)"
)


class GraphWatch:
    """Warns once of each publisher that tries to drive a tool but is not heard, or beside another, or that tells another time.

    Args:
        node: that listens.
        parameters: of the node, those of the tools declared.
        tools: their names.
    """

    def __init__(self, node: Node, parameters: Parameters, tools: list[str]):
        self._node, self._parameters, self._tools = node, parameters, tools
        self._told: set[tuple[str, str, str]] = set()

    def look(self) -> None:
        """See who publishes now."""
        for tool in self._tools:
            for kind, message in _TYPES.items():
                self._look_at_commands(tool, kind, f"{message.__module__.split('.')[0]}/msg/{message.__name__}")
        if self._parameters["publish_clock"]:
            self._look_at_clocks()

    def _look_at_clocks(self) -> None:
        own = 0
        for publisher in self._publishers("/clock"):
            if (publisher.node_name, publisher.node_namespace) != (self._node.get_name(), self._node.get_namespace()):
                self._tell("/clock", publisher, "too; leave it out there (ros2 bag play --topics) or set publish_clock:=false")
                continue
            own += 1
            if own == 2:
                self._tell("/clock", publisher, f"twice: there is another node of this name; {_TWO_OF_A_NAME}")

    def _look_at_commands(self, tool: str, kind: str, type_name: str) -> None:
        topic, source = self._node.resolve_topic_name(f"~/tools/{tool}/{kind}"), self._parameters[f"tools.{tool}.source"]
        heard = set()
        for publisher in self._publishers(topic):
            if kind != source:
                self._tell(topic, publisher, f"and is not heard; the tool follows tools.{tool}.source:={source}")
            elif publisher.topic_type != type_name:
                self._tell(topic, publisher, f"and is not heard; {type_name} is needed")
            else:
                who = publisher.node_namespace, publisher.node_name
                if heard - {who}:
                    self._tell(topic, publisher, "as another node does; the tool goes where either has said last")
                heard.add(who)

    def _publishers(self, topic: str) -> list:
        return [one for one in self._node.get_publishers_info_by_topic(topic) if one.node_name != _NOT_YET_KNOWN]

    def _tell(self, topic: str, publisher, what: str) -> None:
        name = publisher.node_name
        told = (topic, name, publisher.topic_type)
        if told not in self._told and len(self._told) < _MOST_TOLD:
            self._told.add(told)
            who = "a program that is no ROS node" if name == _NO_NODE else f"'{shown(name)}'"
            self._node.get_logger().warning(f"{topic}: {who} publishes {shown(publisher.topic_type)} {what}")
