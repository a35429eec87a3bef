"""Peers of a robots' network on this machine, with ports that the system chose, and radios that hear one another."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager

import numpy as np
import zenoh

from swarmwire.agent.radios.radio import NoRadioLog, ReceivedPacket, SentPacket
from swarmwire.agent.radios.zenoh_radio import ZenohRadio
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.messages import Message, f4
from swarmwire.comms.robot.packets import Payloads, SentPackets
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import close_session
from tests.support.clocks import until

ANY_PORT = ("tcp/127.0.0.1:0",)
ROBOTS = ("flock-0", "flock-1", "flock-2")
KEYS = SwarmKeys("test")
MAX_BYTES = 100
PROBE = KEYS.radio("probe", 0)  # no robot of the swarm


class Word(Message):
    """A message of 6 bytes."""

    number: f4


class Wide(Message):
    """Another message, of 10 bytes."""

    x_m: f4
    y_m: f4


class KeptLog(NoRadioLog):
    """What a radio told its log."""

    def __init__(self) -> None:
        self.received_packets: list[ReceivedPacket] = []
        self.sent_packets: list[SentPacket] = []

    def received(self, packet: ReceivedPacket) -> None:
        self.received_packets.append(packet)

    def sent(self, packet: SentPacket) -> None:
        self.sent_packets.append(packet)


@contextmanager
def peers(count: int) -> Generator[list[zenoh.Session]]:
    """So many peers, each linked with all others, or about to be."""
    sessions: list[zenoh.Session] = []
    endpoints: tuple[str, ...] = ()
    try:
        for _ in range(count):
            network = Network(listen=ANY_PORT, connect=endpoints)
            sessions.append(open_swarm(network))
            endpoints += endpoints_of(sessions[-1], network)
        yield sessions
    finally:
        for session in sessions:
            close_session(session)


def radio(session: zenoh.Session, own: str, clock=None, robots: Sequence[str] = ROBOTS, **options) -> ZenohRadio:
    """An open radio of a robot."""
    made = ZenohRadio(session, KEYS, robots, own, MAX_BYTES, clock or WallClock(), **options)
    made.open()
    return made


@contextmanager
def radios(count: int = 2, **options) -> Generator[list[ZenohRadio]]:
    """Radios of the first robots of the swarm, each of which hears all others."""
    with peers(count) as sessions:
        made = [radio(session, own, **options) for session, own in zip(sessions, ROBOTS, strict=False)]
        for session, its in zip(sessions, made, strict=True):
            meet(session, [other for other in made if other is not its])
        yield made


def meet(session: zenoh.Session, others: list[ZenohRadio]) -> None:
    """Return once each of the others hears what this peer puts, and nothing of it is on its way any more."""

    def reached() -> bool:
        session.put(PROBE, b"")
        for other in others:
            other.received(0)
        return all(
            other.counts().get("packets_of_unknown", 0) > its for other, its in zip(others, unknown, strict=True)
        )

    unknown = [other.counts().get("packets_of_unknown", 0) for other in others]
    until(reached)
    large = [other.counts().get("packets_oversized", 0) for other in others]
    session.put(PROBE, bytes(2 * MAX_BYTES))  # counted as soon as it arrives, and last
    for other, its in zip(others, large, strict=True):
        until(lambda other=other, its=its: other.counts().get("packets_oversized", 0) > its)
        other.received(0)


def words(*numbers: float, to: int = BROADCAST, row: int = 0) -> SentPackets:
    """A packet with each of these numbers."""
    payloads = Payloads.from_rows([Word(number=number).encode() for number in numbers])
    return SentPackets(np.full(len(numbers), row), np.full(len(numbers), to), payloads)


def received_by(radio, packets: int, now_ns: int = 0) -> list[tuple[int, int, float]]:
    """Sender, sequence and number of so many words that a radio hears."""
    rows: list[tuple[int, int, float]] = []

    def all_there() -> bool:
        received, _ = radio.received(now_ns)
        its = zip(received.sender_index.tolist(), received.sequence.tolist(), received.payload.tolist(), strict=True)
        rows.extend((sender, number, Word.decode(received.payloads.row(at)).number) for sender, number, at in its)
        return len(rows) >= packets

    until(all_there)
    return rows
