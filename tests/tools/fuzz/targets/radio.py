"""Packets and poses of robots, questions of operators, and what crosses between a world's radio and robots."""

import json
from typing import Any, NamedTuple

import numpy as np
import zenoh
from hypothesis.strategies import DrawFn

from swarmwire.agent.radios.control import ControlPoint
from swarmwire.agent.radios.tracker import Tracker
from swarmwire.agent.radios.world_radio import WorldRadio, _Arrival
from swarmwire.agent.radios.zenoh_radio import PacketHeader, ZenohRadio
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import Payloads, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.radio_bridge import BridgeInfo, Pose, encode_bridged, encode_pose
from swarmwire.comms.wire.tick_frames import encode_actions
from swarmwire.world.gateways.radio_bridge import BridgedRadio, RadioBridge
from tests.support.agent.players import Other, Word
from tests.tools.fuzz.mutations import TEXTS, mutated_bytes, one_in, pick
from tests.tools.fuzz.small_run import small_run
from tests.tools.fuzz.target import ByteTarget, DocumentTarget, FrameTarget

KEYS, ROBOTS, SELF = SwarmKeys("test"), ("flock-0", "flock-1", "flock-2"), "flock-0"
MEASURES = ("range_m", "bearing_rad")
MAX_PAYLOAD_BYTES = 100


class FixedClock:
    """The time never changes."""

    def now_ns(self) -> int:
        return 5_000_000_000

    def utc_ns(self) -> int:
        return 1_767_225_600_000_000_000

    def sleep_until(self, time_ns: int) -> None:
        pass


CLOCK: Any = FixedClock()


class Terms(DocumentTarget):
    """The terms that a robot gets when it joins a world's radio."""

    name = "terms"

    def make_samples(self) -> list[bytes]:
        return [BridgeInfo(row, ("a", "b", "c"), 10, 100, MEASURES, ("radio.range",)).encode() for row in (0, 2)]

    def feed(self, case: bytes) -> None:
        BridgeInfo.decode(case)


class BridgeReceived(FrameTarget):
    """What a robot receives of a world's radio: taken or counted."""

    name = "medium-received"

    def make_samples(self) -> list[bytes]:
        run, row = small_run(), 1
        self.robots = run.world.static.robot_names
        self.terms = BridgeInfo(row, self.robots, 10, 100, MEASURES, ())
        received = run.received.select(np.flatnonzero(run.received.receiver == row)).compacted()
        assert len(received), "the robot received something"
        statuses = TxStatuses(np.array([row]), np.array([4]), np.array([1]))
        nothing = received.select(np.array([], np.int64))
        return [encode_bridged(11, row, received, statuses), encode_bridged(12, row, nothing, statuses)]

    def feed(self, case: bytes) -> str | None:
        radio = WorldRadio(None, KEYS, self.robots, self.robots[1], CLOCK)
        radio.terms, radio.measures = self.terms, MEASURES
        radio._inbox.put(_Arrival(case, CLOCK.now_ns(), CLOCK.utc_ns()))
        radio.received(3_000_000_000)
        return " ".join(name for name in radio.counts() if name.startswith("frames_")) or None


class BridgeSent(FrameTarget):
    """What a robot sends through a world's radio: taken or counted, and of that robot alone."""

    name = "medium-sent"

    def make_samples(self) -> list[bytes]:
        row, zero = np.array([1]), np.zeros(1)
        packets = SentPackets(np.array([1, 1]), np.array([BROADCAST, 2]), Payloads.from_rows([b"abc", b"defg"]))
        self.bridge = RadioBridge(Network(), KEYS, {"b": 1}, BridgedRadio(("a", "b", "c"), 10, 100, MEASURES, ()))
        return [encode_actions(7, Actions(row, np.zeros(1, np.bool_), zero, zero, zero, packets))]

    def feed(self, case: bytes) -> str | None:
        self.bridge._counted.clear()
        self.bridge._inbox.put((1, case))
        sent = self.bridge.pop_packets()
        if (sent.sender != 1).any():
            raise AssertionError("a packet of another robot")
        faults = [name for name in self.bridge.counts() if name.startswith("frames_")]
        if faults and len(sent):
            raise AssertionError("counted as refused, and taken")
        return " ".join(faults) or None


class KeyedPacket(NamedTuple):
    """The bytes of a packet under a zenoh key."""

    key: str
    data: bytes


class Sample(NamedTuple):
    """In place of zenoh's."""

    key_expr: str
    payload: Any
    kind: Any = zenoh.SampleKind.PUT


class Payload(bytes):
    """In place of zenoh's."""

    def to_bytes(self) -> bytes:
        return bytes(self)


class Packets(ByteTarget):
    """Packets of other robots: received, overheard or refused, and each counted exactly once."""

    name = "radio"
    quick = 200

    def make_samples(self) -> list[Any]:
        self.tracker = Tracker(None, KEYS, ROBOTS)
        for robot in ROBOTS:
            self.tracker._newest[robot] = (CLOCK.utc_ns(), Pose(1.0, 0.5, 0.1))
        messages = [(Word(number=1.5), BROADCAST), (Other(number=-7), 0), (Word(number=float("nan")), 2)]
        packets = [(one.tag, PacketHeader(to, 7, CLOCK.utc_ns()).encode() + one.encode()) for one, to in messages]
        return [KeyedPacket(KEYS.radio("flock-1", tag), data) for tag, data in packets]

    def mutated(self, draw: DrawFn) -> Any:
        key, data = pick(draw, self.samples)
        if one_in(draw, 5):
            parts = key.split("/")
            parts[pick(draw, range(len(parts)))] = pick(draw, (*TEXTS, *ROBOTS, "ffff", "0000"))
            key = "/".join(parts)
        return KeyedPacket(key, mutated_bytes(draw, data, [sample.data for sample in self.samples]))

    def feed(self, case: KeyedPacket) -> str | None:
        radio = ZenohRadio(None, KEYS, ROBOTS, SELF, MAX_PAYLOAD_BYTES, CLOCK, self.tracker)
        radio._arrive(Sample(case.key, Payload(case.data)))
        packets, _ = radio.received(3_000_000_000)
        packets.payloads.tags()
        counts = radio.counts()
        if sum(counts.values()) != 1:
            raise AssertionError(f"a packet that is not counted exactly once: {counts}")
        if len(packets) != counts.get("packets_received", 0):
            raise AssertionError("received, and not counted")
        return None if len(packets) else next(iter(counts))


class Poses(ByteTarget):
    """Poses of the tracker: kept or counted."""

    name = "poses"

    def make_samples(self) -> list[bytes]:
        return [encode_pose(Pose(1.0, -0.5, 3.0), CLOCK.utc_ns()), encode_pose(Pose(0.0, 0.0, 0.0), 0)]

    def feed(self, case: bytes) -> str | None:
        tracker = Tracker(None, KEYS, ROBOTS)
        tracker._store(Sample(KEYS.pose("flock-1"), Payload(case)))
        tracker.pose("flock-1", CLOCK.utc_ns())
        if tracker.malformed + len(tracker._newest) != 1:
            raise AssertionError("neither kept nor counted")
        return "poses_malformed" if tracker.malformed else None


class Questions(ByteTarget):
    """Questions of operators to a robot: it stops exactly when it is told to, and replies once."""

    name = "questions"

    def make_samples(self) -> list[bytes]:
        self.stops = 0
        return [b"estop", b"status"]

    def estop(self) -> None:
        """As the robot."""
        self.stops += 1

    def status(self) -> dict[str, Any]:
        """As the robot."""
        return {"tick": 3}

    def feed(self, case: bytes) -> str | None:
        self.stops, replies = 0, list[str]()
        point = ControlPoint(None, KEYS, SELF, self)

        class Query:
            payload = Payload(case)

            def reply(self, key: str, text: str) -> None:
                replies.append(text)

            def reply_err(self, text: str) -> None:
                replies.append("")

        point._answer(Query())
        if self.stops != (case == b"estop") or len(replies) != 1:
            raise AssertionError(f"stopped {self.stops} times, {len(replies)} replies")
        if case == b"status":
            json.loads(replies[0])
        return "questions_refused" if point.refused else None
