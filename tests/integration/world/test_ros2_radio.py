"""Topics of ROS 2 nodes that cross the radio: of emulated bases and of followed robots, for bridges and rmw_zenoh."""

from collections import deque
from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import zenoh
from pycdr2 import IdlStruct
from pycdr2.types import float64
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.protocols.ros2.links import close, open_client
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets
from swarmwire.deploy import Simulation, repeat
from swarmwire.world.gateways.ros2 import Ros2Gateway, Ros2GatewayOptions
from swarmwire.world.gateways.ros2.radio import RosRadio
from swarmwire.world.motion.ros2 import Ros2Source
from swarmwire.world.scenario.motion import Ros2Motion
from swarmwire.world.scenario_file import scenario_from
from tests.support.clocks import until
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.type_hashes import rihs01
from tests.support.refusals import refused_input

# pycdr2 has arrays for types that are lists in fact:
# pyright: reportGeneralTypeIssues=false
from tests.support.world.gateways import PROPER, turtlebot

NAMES = ("flock-0", "flock-1", "flock-2")
NAMESPACES = {row: f"/flock_{row}" for row in range(3)}
TOPICS = [
    {"name": "map", "type": "geometry_msgs/msg/PoseStamped", "reliable": True},
    {"name": "report", "type": "geometry_msgs/msg/Twist", "to": ["flock-1"]},
    {"name": "plan", "type": "geometry_msgs/msg/Twist", "latched": True},
]
MESSAGE = independent.PoseStamped(
    independent.header(5, "a frame with a long name" * 20),
    independent.Pose(independent.Point(1.0, 2.0, 3.0), independent.Quaternion(0.0, 0.0, 0.0, 1.0)),
).serialize()


GO = independent.twist(1.0, 2.0).serialize()


def scenario_with(**tables: Any):
    mapping = {
        "format": 1,
        "name": "maps",
        "duration_s": 4.0,
        "arena": {"size_m": [10.0, 10.0]},
        "robots": {"flock": {"body": "turtlebot3-burger", "count": 3, "agent": "swarmwire.agent.behaviours:Consensus"}},
        "radio": {"range_m": 20.0, "max_payload_bytes": 200},
        "ros2": {"relay": {"topics": TOPICS, "retry_after_s": 0.2}},
        **tables,
    }
    return scenario_from(mapping, "maps.toml")


@dataclass
class OnlyX(IdlStruct, typename="my_msgs/msg/Point"):
    x: float64


@dataclass
class Vector(IdlStruct, typename="my_msgs/msg/Vector"):
    at: OnlyX
    name: str


@dataclass
class Air:
    """The topics of three robots on a radio, a node's session, and a medium that delivers at once."""

    radio: RosRadio
    node: zenoh.Session
    is_rmw: bool

    def subscribe(self, topic: str, kind: type[Any]) -> deque[bytes]:
        samples: deque[bytes] = deque()
        self.node.declare_subscriber(self._key(topic, kind), lambda sample: samples.append(sample.payload.to_bytes()))
        return samples

    def publish(self, topic: str, kind: type[Any], payload: bytes) -> None:
        self.node.put(self._key(topic, kind), payload, attachment=PROPER if self.is_rmw else None)

    def cross(self) -> tuple[list[tuple[int, int, int]], ReceivedPackets]:
        """Let packets cross: return sender, receiver and size of each, and what is left for agents."""
        sent = SentPackets.joined(self.radio.pop_packets())
        self.radio.count_sent(sent)
        links = [
            (packet, receiver)
            for packet, (sender, to) in enumerate(zip(sent.sender.tolist(), sent.to.tolist(), strict=True))
            for receiver in range(3)
            if receiver != sender and to in (BROADCAST, receiver)
        ]
        packet, receiver = (np.array([link[k] for link in links], np.int64) for k in range(2))
        measured = {"range_m": np.full(len(links), 2.5), "bearing_rad": np.full(len(links), -0.25)}
        received = ReceivedPackets(
            receiver, sent.sender[packet], packet, np.zeros_like(packet), measured, packet, sent.payloads
        )
        sizes = sent.payloads.sizes.tolist()
        return [(int(sent.sender[at]), to, sizes[at]) for at, to in links], self.radio.deliver(received)

    def until_received(self, samples: deque[bytes]) -> list[tuple[int, int, int]]:
        """Let packets cross until a message arrives; return the packets."""
        crossed: list[tuple[int, int, int]] = []
        until(lambda: (crossed.extend(self.cross()[0]), samples)[1])
        return crossed

    def _key(self, topic: str, kind: type[Any]) -> str:
        package, folder, name = kind.__idl_typename__.split("/")
        return f"0/{topic}/{package}::{folder}::dds_::{name}_/{rihs01(kind)}" if self.is_rmw else topic


@contextmanager
def gateway_air(transport: str) -> Generator[Air]:
    gateway = Ros2Gateway(NAMES, turtlebot(), "", Ros2GatewayOptions(), WallClock())
    with closing(gateway):
        endpoint = gateway.open()[0]
        radio = RosRadio(scenario_with(), NAMES, NAMESPACES, WallClock())
        gateway.join(radio, 0)
        node = open_client(endpoint, 20.0)
        with closing(node):
            yield Air(radio, node, transport == "rmw")
            close(node)


@contextmanager
def followed_air(transport: str) -> Generator[Air]:
    motion = Ros2Motion(source="ros2", listen=["tcp/127.0.0.1:0"], transport=transport, namespace="/flock_{index}")
    source = Ros2Source(motion, ["a-1", "a-2", "a-3"], [0, 1, 2], (9.0, 9.0), WallClock())
    source.open()
    with closing(source):
        radio = RosRadio(scenario_with(), NAMES, dict(enumerate(source.namespaces)), WallClock())
        source.join(radio)
        node = open_client(source.address.rpartition(" at ")[2], 20.0)
        with closing(node):
            yield Air(radio, node, transport == "rmw")
            close(node)


@pytest.mark.parametrize("transport", ["rmw", "bridge"])
@pytest.mark.parametrize("air", [gateway_air, followed_air])
def test_relayed_topic_reaches_the_namespace_of_each_receiver_under_its_sender(air, transport):
    with air(transport) as flock:
        robots = [flock.subscribe(f"flock_{row}/radio/flock_0/map", independent.PoseStamped) for row in (1, 2)]
        flock.publish("flock_0/map", independent.PoseStamped, MESSAGE)
        crossed = flock.until_received(robots[0])
        until(lambda: robots[1])
        assert [list(samples) for samples in robots] == [[MESSAGE], [MESSAGE]]
        assert crossed == [(0, to, size) for size in (200, 200, len(MESSAGE) + 33 - 400) for to in (1, 2)]
        assert flock.cross()[0] == []  # what is received is not relayed again
        report = flock.radio.report()[0]
        assert (report.messages, report.intended, report.received, report.lost) == (1, 2, 2, 0)
        assert (report.packets, report.sent_bytes, report.requests) == (3, len(MESSAGE) + 33, 0)
        assert [robot.received for robot in report.robots.values()] == [0, 1, 1]


def test_relayed_topic_to_named_robots_reaches_these_alone():
    with gateway_air("rmw") as flock:
        samples = flock.subscribe("flock_1/radio/flock_2/report", independent.Twist)
        flock.publish("flock_2/report", independent.Twist, GO)
        flock.publish("flock_1/report", independent.Twist, GO)
        assert flock.until_received(samples) == [(2, 1, 52 + 11)]
        assert flock.radio.report()[1].intended == 1


@pytest.mark.parametrize("air", [gateway_air, followed_air])
def test_radio_topics_carry_bytes_with_their_sender_and_measurements(air):
    kind = independent.UInt8MultiArray
    with air("rmw") as flock:
        rows = [flock.subscribe(f"flock_{row}/radio/rx", kind) for row in range(3)]
        flock.publish("flock_0/radio/tx", kind, kind(data=[7, 8, 9]).serialize())
        assert flock.until_received(rows[1]) == [(0, 1, 3), (0, 2, 3)]
        until(lambda: rows[2])
        message = kind.deserialize(rows[2].pop())
        assert bytes(message.data) == b"\x07\x08\x09"
        assert [(part.label, part.size, part.stride) for part in message.layout.dim] == [
            ("flock_0", 3, 3),
            ("range_m=2.5", 1, 1),
            ("bearing_rad=-0.25", 1, 1),
        ]
        layout = independent.MultiArrayLayout([independent.MultiArrayDimension("flock_0", 1, 1)])
        flock.publish("flock_2/radio/tx", kind, kind(layout, [5]).serialize())
        assert flock.until_received(rows[0]) == [(2, 0, 1)]


def test_radio_topics_leave_packets_of_nodes_to_agents_but_not_relayed_ones():
    kind = independent.UInt8MultiArray
    with gateway_air("bridge") as flock:
        flock.publish("flock_0/radio/tx", kind, kind(data=[1, 2]).serialize())
        flock.publish("flock_0/map", independent.PoseStamped, MESSAGE)
        agents: list[bytes] = []

        def cross() -> bool:
            crossed, received = flock.cross()
            agents.extend(received.payloads.row(row) for row in received.payload.tolist())
            return len(crossed) > 2

        until(cross)
        assert agents == [b"\1\2", b"\1\2"]


def test_radio_topics_count_what_they_cannot_send():
    kind = independent.UInt8MultiArray
    elsewhere = independent.MultiArrayLayout([independent.MultiArrayDimension("nobody", 1, 1)])
    with gateway_air("rmw") as flock:
        unsent = [kind(elsewhere, [1]), kind(data=[]), kind(data=[0x02, 0x53, 1]), kind(data=[0x03, 0x53])]
        for message in unsent:
            flock.publish("flock_0/radio/tx", kind, message.serialize())
        flock.publish("flock_0/radio/tx", kind, b"\0\1\0\0\xff\xff\xff\xff")
        flock.publish("flock_0/map", independent.PoseStamped, bytes(2**20 + 1))
        flock.node.put("0/flock_0/map/geometry_msgs::msg::dds_::PoseStamped_/any", MESSAGE)
        counts = {"malformed": 4, "no_attachment": 1, "to_unknown": 1, "too_large": 1}
        until(lambda: (flock.cross(), len(flock.radio.counts()) == len(counts))[1])
        assert flock.radio.counts() == {f"ros2_radio_{name}": count for name, count in counts.items()}


@pytest.mark.parametrize("transport", ["rmw", "bridge"])
def test_latched_topic_is_received_by_late_subscribers(transport):
    with gateway_air(transport) as flock:
        key = "flock_0/radio/flock_2/plan" if transport == "bridge" else "0/flock_0/radio/flock_2/plan/**"
        flock.publish("flock_2/plan", independent.Twist, GO)
        until(lambda: flock.cross()[0])
        samples: deque[zenoh.Sample] = deque()
        history = HistoryConfig(detect_late_publishers=True, max_samples=100)
        subscriber = declare_advanced_subscriber(flock.node, key, samples.append, history=history)
        assert until(lambda: samples)[0].payload.to_bytes() == GO
        subscriber.undeclare()


def test_relayed_topics_appear_in_the_graph_of_ros():
    with gateway_air("rmw") as flock:
        replies = flock.node.liveliness().get("@ros2_lv/0/**/radio/**")
        tokens = sorted(str(reply.ok.key_expr).split("/", 5)[5] for reply in replies if reply.ok)
        kind = f"geometry_msgs::msg::dds_::PoseStamped_/{rihs01(independent.PoseStamped)}/::,10:,:,:,,"
        assert [token for token in tokens if "PoseStamped" in token and "%flock_1/" in token] == [
            f"MP/%/%flock_1/radio/%flock_1%radio%flock_0%map/{kind}",
            f"MP/%/%flock_1/radio/%flock_1%radio%flock_2%map/{kind}",
            f"MS/%/%flock_1/radio/%flock_1%map/{kind}",
        ]
        reports = [token for token in tokens if "report/" in token and token.startswith("MP")]
        assert {token.split("/")[2] for token in reports} == {"%flock_1"}


@pytest.mark.parametrize(
    ("key", "changes"),
    [
        ("ros2.relay.topics.0.name", {"topics": [{"name": "radio/rx", "type": "a/msg/B"}]}),
        ("ros2.relay.topics.0.name", {"topics": [{"name": "/map", "type": "a/msg/B"}]}),
        ("ros2.relay.topics.1.name", {"topics": [TOPICS[0], TOPICS[0]]}),
        ("ros2.relay.topics.0.type", {"topics": [{"name": "map", "type": "Map"}]}),
        ("ros2.relay.topics.0.to", {"topics": [{**TOPICS[0], "to": ["flok"]}]}),
    ],
)
def test_relay_that_cannot_be_is_refused(key, changes):
    with refused_input("maps.toml", key):
        scenario_with(ros2={"relay": changes})


def test_relay_needs_a_radio_with_room_for_a_part():
    small = {"range_m": 20.0, "max_payload_bytes": 11}
    for radio in (small, None):
        with refused_input("maps.toml", "ros2.relay"):
            scenario_with(radio=radio)


def test_relay_to_a_robot_without_topics_is_refused():
    behind_gateway = {row: NAMESPACES[row] for row in (0, 2)}
    with refused_input("maps.toml", "ros2.relay.topics.1.to"):
        RosRadio(scenario_with(), NAMES, behind_gateway, WallClock())


def test_relay_of_too_many_received_topics_is_refused():
    names = [f"flock-{row}" for row in range(40)]
    namespaces = {row: f"/robot{row}" for row in range(40)}
    with refused_input("maps.toml", "ros2.relay.topics"):
        RosRadio(scenario_with(), names, namespaces, WallClock())  # 2 x 40 x 39, and 39


def test_relay_of_a_type_of_the_user_takes_its_definition_from_a_file(tmp_path):
    """The hash is that of the definition by REP 2016, which the independent messages compute."""
    file = tmp_path / "Vector.msg"
    file.write_text("my_msgs/Point at\nstring name\n" + "=" * 80 + "\nMSG: my_msgs/Point\nfloat64 x\n")
    topic = {"name": "at", "type": "my_msgs/msg/Vector", "definition": str(file)}
    gateway = Ros2Gateway(NAMES, turtlebot(), "", Ros2GatewayOptions(), WallClock())
    with closing(gateway):
        session = open_client(gateway.open()[0], 20.0)
        radio = RosRadio(scenario_with(ros2={"relay": {"topics": [topic]}}), NAMES, NAMESPACES, WallClock())
        gateway.join(radio, 0)
        replies = list(session.liveliness().get("@ros2_lv/0/**/my_msgs::msg::dds_::Vector_/**"))
        close(session)
    hashes = {str(reply.ok.key_expr).split("/")[11] for reply in replies if reply.ok}
    assert hashes == {rihs01(Vector)}


@pytest.mark.parametrize(
    ("key", "text"), [("type", None), ("definition", ""), ("definition", "my_msgs/Other x"), ("definition", "int32")]
)
def test_relay_of_a_type_that_is_unknown_is_refused(key, text, tmp_path):
    topic = {"name": "map", "type": "my_msgs/msg/Map"}
    if text is not None:
        topic["definition"] = str(tmp_path / "Map.msg")
        (tmp_path / "Map.msg").write_text(text) if text else None
    unknown = {"relay": {"topics": [topic]}}
    gateway = Ros2Gateway(NAMES, turtlebot(), "", Ros2GatewayOptions(), WallClock())
    radio = RosRadio(scenario_with(ros2=unknown), NAMES, NAMESPACES, WallClock())
    with closing(gateway), refused_input("maps.toml", f"ros2.relay.topics.0.{key}"):
        gateway.join(radio, 0)


def test_relay_without_robots_that_have_topics_is_refused():
    with refused_input("maps.toml", "ros2.relay.topics"):
        Simulation(scenario_with(), realtime=1.0).__enter__()


@pytest.mark.parametrize("subtick", [None, 0.01])
def test_relayed_run_is_repeated_bit_for_bit_with_equal_fates(subtick, tmp_path):
    scenario = scenario_with(radio={"range_m": 20.0, "max_payload_bytes": 200, "loss": 0.2})
    out = tmp_path / "run"
    with Simulation(scenario, gateways="ros2", realtime=4.0, subtick=subtick, out=out) as simulation:
        assert simulation.served
        node = open_client(simulation.served.robots[0].address, 20.0)
        with closing(node):
            air = Air(None, node, True)  # pyright: ignore[reportArgumentType] - the test steps the run itself
            samples = air.subscribe("flock_1/radio/flock_0/map", independent.PoseStamped)
            while simulation.tick < simulation.plan.ticks:
                if simulation.tick % 5 == 0:
                    air.publish("flock_0/map", independent.PoseStamped, MESSAGE)
                simulation.step()
            until(lambda: len(samples) > 2)
            close(node)
    result = simulation.result
    report = result.relay[0]
    assert report.messages == 8
    assert report.received >= 8
    assert set(samples) == {MESSAGE}
    assert result.radio
    assert result.radio.sent == report.packets
    repetition = repeat(out)
    assert repetition.same
    assert repetition.result.radio == result.radio
