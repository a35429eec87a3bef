"""What crosses between a world's air and robots nearby: terms, what they heard, what they send."""

from typing import Any

import numpy as np

from swarmwire.agent.radios.air_radio import AirRadio
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import BROADCAST, Payloads, Sent
from swarmwire.comms.senses import Actions
from swarmwire.comms.wire.air_frames import encode_air
from swarmwire.comms.wire.air_terms import AirTerms
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.swarm_keys import SwarmKeys
from swarmwire.comms.wire.tick_frames import encode_actions
from swarmwire.world.gateways.air_bridge import AirBridge, LentAir
from tests.tools.fuzz.miniature import begun
from tests.tools.fuzz.target import FrameTarget, MsgpackTarget

GIVES = ("range_m", "bearing_rad")
KEYS = SwarmKeys("test")


class StillClock:
    """The time stands still."""

    def now_ns(self) -> int:
        """Of the robot."""
        return 5_000_000_000

    def utc_ns(self) -> int:
        """Since 1970."""
        return 1_767_225_600_000_000_000

    def sleep_until(self, time_ns: int) -> None:
        """At once."""


class Terms(MsgpackTarget):
    """What a robot learns when it joins."""

    name = "terms"

    def make_samples(self) -> list[bytes]:
        """Of two robots."""
        return [AirTerms(row, ("a", "b", "c"), 10, 100, GIVES, ("radio.range",)).encode() for row in (0, 2)]

    def door(self, case: bytes) -> None:
        """The decoder."""
        AirTerms.decode(case)


class Heard(FrameTarget):
    """What a world tells a robot: the radio takes it, or counts it."""

    name = "air-heard"

    def make_samples(self) -> list[bytes]:
        """Of a real tick."""
        of = begun()
        self.robots, row = of.world.static.robot_names, 1
        self.terms = AirTerms(row, self.robots, 10, 100, GIVES, ())
        its = of.heard.select(np.flatnonzero(of.heard.receiver == row)).compacted()
        assert len(its), "the robot heard something"
        told = Outcomes(np.array([row]), np.array([4]), np.array([1]))
        return [encode_air(11, row, its, told), encode_air(12, row, its.select(np.array([], np.int64)), told)]

    def door(self, case: bytes) -> str | None:
        """The radio of the robot."""
        clock: Any = StillClock()
        radio = AirRadio(None, KEYS, self.robots, self.robots[1], clock)
        radio.terms, radio.gives = self.terms, GIVES
        radio._inbox.put(_arrived(case, clock))
        radio.heard(3_000_000_000)
        faults = [name for name in radio.counts() if name.startswith("frames_")]
        return " ".join(faults) or None


class AirSent(FrameTarget):
    """What a robot sends into a world's air: the bridge takes it, or counts it."""

    name = "air-sent"

    def make_samples(self) -> list[bytes]:
        """Packets to all, and to one."""
        row, still = np.array([1]), np.zeros(1)
        packets = Sent(np.array([1, 1]), np.array([BROADCAST, 2]), Payloads.of([b"abc", b"defg"]))
        actions = Actions(row, np.zeros(1, np.bool_), still, still, still, packets)
        lent = LentAir(("a", "b", "c"), 10, 100, GIVES, ())
        self.bridge = AirBridge(Network(), KEYS, {"b": 1}, lent)
        return [encode_actions(7, actions)]

    def door(self, case: bytes) -> str | None:
        """The bridge."""
        self.bridge._counted.clear()
        self.bridge._inbox.put((1, case))
        sent = self.bridge.take()
        if (sent.sender != 1).any():
            raise AssertionError("a packet of another robot")
        faults = [name for name in self.bridge.counts() if name.startswith("frames_")]
        if faults and len(sent):
            raise AssertionError("counted as refused, and taken")
        return " ".join(faults) or None


def _arrived(data: bytes, clock: DatedClock) -> Any:
    from swarmwire.agent.radios.air_radio import _Arrival

    return _Arrival(data, clock.now_ns(), clock.utc_ns())
