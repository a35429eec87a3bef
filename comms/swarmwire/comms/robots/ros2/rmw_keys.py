"""Keys and liveliness tokens of rmw_zenoh (rmw_zenoh: docs/design.md, liveliness_utils.cpp).

A message travels under domain, full name of the topic, kind and its hash. Tokens make up the ROS graph: they let
`ros2 topic list` show what there is, and are not needed for messages to arrive.
"""

from dataclasses import dataclass

from swarmwire.comms.robots.ros2.kinds import dds_kind

QOS = "::,10:,:,:,,"  # what differs from the defaults: nothing
ANY = "*"
MOST_TOPICS = 10_000  # of a node: ids of nodes and of their topics are whole numbers that no two in a session share


def rmw_key(domain: int, topic: str, kind: str, type_hash: str = ANY) -> str:
    """The key of a topic of this full name; with ANY for its hash, one to subscribe by.

    >>> rmw_key(0, "/cmd_vel", "geometry_msgs/msg/Twist", "RIHS01_9c45")
    '0/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_9c45'
    """
    return f"{domain}{topic}/{dds_kind(kind)}/{type_hash}"


@dataclass(frozen=True)
class RmwNode:
    """A node of the ROS graph, as tokens name it."""

    domain: int
    zid: str  # of the zenoh session
    place: int  # among the nodes of the session
    namespace: str  # "/flock_0", "/" for none
    name: str

    @property
    def token(self) -> str:
        """The token of the node itself."""
        return self._token(0, "NN")

    def topic_token(self, place: int, direction: str, topic: str, kind: str, type_hash: str) -> str:
        """The token of a topic that the node writes (MP) or reads (MS); `place` counts them, from 1."""
        return f"{self._token(place, direction)}/{_mangled(topic)}/{dds_kind(kind)}/{type_hash}/{QOS}"

    def _token(self, place: int, direction: str) -> str:
        node = self.place * MOST_TOPICS
        space = _mangled(self.namespace)
        return f"@ros2_lv/{self.domain}/{self.zid}/{node}/{node + place}/{direction}/%/{space}/{self.name}"


def _mangled(name: str) -> str:
    return name.replace("/", "%")
