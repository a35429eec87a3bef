"""Packets between robots, poses from a tracker, and questions of operators: all that robots hear in their network."""

import json
from typing import Any, NamedTuple

import zenoh

from swarmwire.agent.radios.control import ControlPoint
from swarmwire.agent.radios.packet_header import PacketHeader
from swarmwire.agent.radios.tracker import Tracker
from swarmwire.agent.radios.zenoh_radio import ZenohRadio
from swarmwire.comms.packets import BROADCAST
from swarmwire.comms.wire.poses import Pose, encode_pose
from swarmwire.comms.wire.swarm_keys import SwarmKeys
from tests.support.agent.players import Other, Word
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.magic import TEXTS
from tests.tools.fuzz.target import ByteTarget
from tests.tools.fuzz.targets.air import StillClock

KEYS, ROBOTS, OWN = SwarmKeys("test"), ("flock-0", "flock-1", "flock-2"), "flock-0"
MOST_BYTES = 100


class Keyed(NamedTuple):
    """Bytes under a key."""

    key: str
    data: bytes


class Sample(NamedTuple):
    """As zenoh hands it over."""

    key_expr: str
    payload: Any
    kind: Any = zenoh.SampleKind.PUT


class Payload(bytes):
    """As zenoh hands it over."""

    def to_bytes(self) -> bytes:
        """The bytes."""
        return bytes(self)


class Radio(ByteTarget):
    """Packets, from the network's thread to what the agent hears."""

    name = "radio"
    quick = 500

    def make_samples(self) -> list[Any]:
        """To all and to one, of two kinds, and one that stands under a wrong key."""
        self.tracker = Tracker(None, KEYS, ROBOTS)
        for robot in ROBOTS:
            self.tracker._newest[robot] = (StillClock().utc_ns(), Pose(1.0, 0.5, 0.1))
        messages = [(Word(number=1.5), BROADCAST), (Other(number=-7), 0), (Word(number=float("nan")), 2)]
        return [
            Keyed(
                KEYS.radio("flock-1", message.tag),
                PacketHeader(to, 7, StillClock().utc_ns()).encode() + message.encode(),
            )
            for message, to in messages
        ]

    def case(self, dice: Dice) -> Any:
        """A packet with its bytes changed, now and then its key."""
        sample: Keyed = dice.pick(self.samples)
        key = sample.key
        if dice.chance(0.2):
            part, parts = dice.below(4), key.split("/")
            parts[part % len(parts)] = dice.pick((*TEXTS, *ROBOTS, "ffff", "0000"))
            key = "/".join(parts)
        from tests.tools.fuzz.byte_changes import changed_bytes

        return Keyed(key, changed_bytes(dice, sample.data, [one.data for one in self.samples]))

    def door(self, case: Keyed) -> str | None:
        """The radio: what it takes is heard, or counted as overheard; what it refuses is counted."""
        clock: Any = StillClock()
        radio = ZenohRadio(None, KEYS, ROBOTS, OWN, MOST_BYTES, clock, self.tracker)
        radio._arrive(Sample(case.key, Payload(case.data)))
        heard, _ = radio.heard(3_000_000_000)
        heard.payloads.tags()
        counts = radio.counts()
        if sum(counts.values()) != 1:
            raise AssertionError(f"a packet that is counted otherwise than once: {counts}")
        if len(heard) != counts.get("packets_heard", 0):
            raise AssertionError("heard, and not counted")
        for link in radio.links.values():
            assert 0.0 <= link.delivery <= 1.0
        return None if len(heard) else next(iter(counts))


class Poses(ByteTarget):
    """Poses, from the network's thread to the tracker of a robot."""

    name = "poses"

    def make_samples(self) -> list[bytes]:
        """Of the present, and of 1970."""
        now_ns = StillClock().utc_ns()
        return [encode_pose(Pose(1.0, -0.5, 3.0), now_ns), encode_pose(Pose(0.0, 0.0, 0.0), 0)]

    def door(self, case: bytes) -> str | None:
        """The tracker: it keeps the pose, or counts it."""
        tracker = Tracker(None, KEYS, ROBOTS)
        tracker._keep(Sample(KEYS.pose("flock-1"), Payload(case)))
        tracker.pose("flock-1", StillClock().utc_ns())
        if tracker.malformed + len(tracker._newest) != 1:
            raise AssertionError("neither kept nor counted")
        return "poses_malformed" if tracker.malformed else None


class Questions(ByteTarget):
    """What operators ask of a robot."""

    name = "questions"

    def make_samples(self) -> list[bytes]:
        """Both questions."""
        self.stops = 0
        return [b"estop", b"status"]

    def estop(self) -> None:
        """As the robot."""
        self.stops += 1

    def status(self) -> dict[str, Any]:
        """As the robot."""
        return {"tick": 3}

    def door(self, case: bytes) -> str | None:
        """The control point: it stops the robot exactly when it is told to."""
        self.stops, replies = 0, []
        point = ControlPoint(None, KEYS, OWN, self)

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
