"""The report on a relayed topic of ROS 2 over a run."""

from collections import Counter
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from swarmwire.comms.protocols.ros2.relay import RobotRelay
from swarmwire.world.scenario.ros2 import RelayedTopicTable

SentCounts = Counter[tuple[str, int, int]]  # numbers of "packets" and of their "bytes" by robot row and topic


@dataclass(frozen=True)
class RelayedRobot:
    """The messages of a relayed topic at one robot."""

    messages: int  #: messages of its nodes
    received: int  #: messages of other robots that arrived complete
    packets: int  #: packets of it that were handed to the radio: parts, repeated ones included, and requests
    sent_bytes: int  #: payloads of these packets, with the relay's headers


@dataclass(frozen=True)
class RelayReport:
    """A relayed topic over a run. Messages that were neither received nor lost for good at its end count as lost."""

    topic: str  #: name in the robots' namespaces
    reliable: bool
    messages: int
    intended: int  #: number of intended receivers, of all messages
    received: int
    lost: int  #: intended - received
    packets: int
    sent_bytes: int
    repeated: int  #: parts that were sent again on request
    requests: int
    robots: dict[str, RelayedRobot]


def relay_report(
    topic: RelayedTopicTable,
    index: int,
    names: Sequence[str],
    relays: Mapping[int, RobotRelay],
    receivers: AbstractSet[int],
    sent: SentCounts,
) -> RelayReport:
    """Return the report on a topic, the one of this index in the relays.

    Args:
        topic: its table.
        index: its index.
        names: names of all robots, by row.
        relays: relays of the robots with topics, by row.
        receivers: rows of the robots that get it.
        sent: counts of packets that were handed to the radio.
    """
    robots = {
        names[row]: RelayedRobot(
            relay.counts["messages", index],
            relay.counts["received", index],
            sent["packets", row, index],
            sent["bytes", row, index],
        )
        for row, relay in relays.items()
    }
    intended = sum(relay.counts["messages", index] * len(receivers - {row}) for row, relay in relays.items())
    received = sum(robot.received for robot in robots.values())
    return RelayReport(
        topic.name,
        topic.reliable,
        messages=sum(robot.messages for robot in robots.values()),
        intended=intended,
        received=received,
        lost=intended - received,
        packets=sum(robot.packets for robot in robots.values()),
        sent_bytes=sum(robot.sent_bytes for robot in robots.values()),
        repeated=sum(relay.counts["repeated", index] for relay in relays.values()),
        requests=sum(relay.counts["requests", index] for relay in relays.values()),
        robots=robots,
    )
