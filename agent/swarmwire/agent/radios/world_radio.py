"""The radio medium of a nearby world as the radio of a real robot: its packets are emulated among the world's robots.

The radio joins by a query, whose answer describes the world's medium (`BridgeInfo`). Then it sends `actions` frames, of
which only packets, states and noted numbers count, and receives `tick` frames without readings.
"""

# zenoh's stubs leave out the return types of put and undeclare.
# pyright: reportUnknownMemberType=false

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.radios.radio import SENT, TOO_LARGE, NoRadioLog, RadioLog, ReceivedPacket, SentPacket
from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import Clock, DatedClock, WallClock, tick_start_ns, to_ns, to_s
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.radio_bridge import MAX_RADIO_FRAME_BYTES, BoundedInbox, BridgeInfo, decode_bridged
from swarmwire.comms.wire.tick_frames import encode_actions

JOIN_TIMEOUT_S = 10.0  # of all queries
QUERY_TIMEOUT_S = 1.0
QUERY_INTERVAL_NS = to_ns(0.1)
MAX_WAITING = 1024  # frames that may wait for the agent's next step
NO_COMMAND = np.zeros(1)


def _no_actions(row: int) -> Actions:
    """The actions of a robot that only a driver commands."""
    return Actions(np.array([row]), NO_COMMAND != 0.0, NO_COMMAND, NO_COMMAND, NO_COMMAND)


class _Arrival(NamedTuple):
    frame: bytes
    at_ns: int
    utc_ns: int


class WorldRadio:
    """The radio of the robot `own`, one of `robots`, in the medium of the world that answers in this network.

    Attributes:
        terms: the world's medium; None before `open`, when `needs` and `measures` are empty.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: SwarmKeys,
        robots: Sequence[str],
        own: str,
        clock: DatedClock,
        log: RadioLog | None = None,
        wall: Clock | None = None,
    ) -> None:
        """`clock` runs at the agent's pace; timeouts of the network use the `wall` clock."""
        self._session, self._keys, self._robots, self._own = session, keys, tuple(robots), own
        self._row, self._clock = self._robots.index(own), clock
        self._wall: Clock = wall or WallClock()
        self._log: RadioLog = log or NoRadioLog()
        self._inbox = BoundedInbox[_Arrival](MAX_WAITING)
        self._subscriber: zenoh.Subscriber[None] | None = None
        self._sequence = self._frames = self._far_too_large = 0
        self._counted = Counter[str]()
        self.terms: BridgeInfo | None = None
        self.measures: tuple[str, ...] = ()
        self.needs: frozenset[str] = frozenset()

    def open(self) -> None:
        """Join the medium; BadInput if no world answers, or its robots differ from those of the swarm."""
        terms = self._join()
        if terms.robots != self._robots:
            names = ", ".join(terms.robots)
            raise BadInput("robots", "", f"expected the robots of the world, in its order: {names}")
        self.terms, self.measures, self.needs = terms, terms.measures, frozenset(terms.needs)
        self._subscriber = self._session.declare_subscriber(
            self._keys.bridge_received(self._own), Callback(self._arrive, indirect=False)
        )

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Packets and tx statuses from the medium since the last call."""
        terms, received, tx_status = self._joined(), ReceivedPackets.none(self.measures), NO_TX_STATUSES
        started_ns = self._clock.now_ns() - now_ns
        for arrival in self._inbox.pop_all():
            try:
                tick, packets, statuses = decode_bridged(arrival.frame, terms)
            except BadFrame as error:
                self._counted[f"frames_{error.fault}"] += 1
                continue
            # The frame left the world as its tick began.
            ahead_ns = arrival.at_ns - started_ns - tick_start_ns(tick, terms.rate_hz)
            mine = self._own_rows(packets, ahead_ns)
            self._log_received(mine, arrival.utc_ns - arrival.at_ns + started_ns)
            received = ReceivedPackets.joined([received, mine])
            tx_status = TxStatuses.joined(
                [tx_status, TxStatuses(self._rows(statuses.row), statuses.id, statuses.result)]
            )
        return received, tx_status

    def send(self, sent: SentPackets) -> None:
        """Send packets to the medium, also those that are too large for it: the world counts them."""
        if not len(sent):
            return
        terms, utc_ns = self._joined(), self._clock.utc_ns()
        for to, tag, size_bytes in zip(
            sent.to.tolist(), sent.payloads.tags().tolist(), sent.payloads.sizes.tolist(), strict=True
        ):
            fits = size_bytes <= terms.max_payload_bytes
            self._counted["packets_sent" if fits else "packets_too_large"] += 1
            self._log.sent(SentPacket(utc_ns, self._sequence, to, size_bytes, tag, SENT if fits else TOO_LARGE))
            self._sequence += 1
        packets = SentPackets(np.full(len(sent), terms.row), sent.to, sent.payloads, sent.tx_status_id)
        if not self._put(replace(_no_actions(terms.row), sent=packets)):
            self._counted["packets_refused"] += len(sent)

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """Pass what the agent noted to the world."""
        row = self._joined().row
        notes, values = (replace(table, rows=np.full(len(table), row)) for table in (states, values))
        self._put(replace(_no_actions(row), notes=notes, values=values))

    def _put(self, actions: Actions) -> bool:
        """Whether the session took a frame with these actions."""
        self._frames += 1
        try:
            self._session.put(
                self._keys.bridge_sent(self._own),
                encode_actions(self._frames, actions),
                congestion_control=zenoh.CongestionControl.DROP,
            )
        except zenoh.ZError:  # the session was closed
            return False
        return True

    def counts(self) -> dict[str, int]:
        """Packets and frames sent, received and lost on the way to the world, by name, without zeros."""
        counted = Counter(self._counted)
        counted["frames_oversized"] += self._far_too_large
        counted["frames_dropped"] += self._inbox.dropped
        return {name: count for name, count in sorted(counted.items()) if count}

    def close(self) -> None:
        """Stop receiving; the session is closed by its owner."""
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None and not self._session.is_closed():
            subscriber.undeclare()

    def _join(self) -> BridgeInfo:
        """The world's answer; repeated queries allow for a network that is still starting."""
        end_ns = self._wall.now_ns() + to_ns(JOIN_TIMEOUT_S)
        while (left_ns := end_ns - self._wall.now_ns()) > 0:
            for reply in self._session.get(
                self._keys.bridge_join(self._own), timeout=min(QUERY_TIMEOUT_S, to_s(left_ns))
            ):
                if reply.ok is not None:
                    try:
                        return BridgeInfo.decode(reply.ok.payload.to_bytes())
                    except BadFrame as error:
                        raise BadInput("radio", "world", f"expected a world of this version: {error}") from error
                if reply.err is not None and (error := reply.err.payload.to_string()) != "Timeout":
                    raise BadInput("radio", "world", error)
            self._wall.sleep_until(min(self._wall.now_ns() + QUERY_INTERVAL_NS, end_ns))
        expected = f"expected a world that lends its radio to {self._own}; none in the network answers"
        raise BadInput("radio", "world", expected)

    def _joined(self) -> BridgeInfo:
        if self.terms is None:
            raise RuntimeError("the radio is to be opened first")
        return self.terms

    def _arrive(self, sample: zenoh.Sample) -> None:
        """Called by the network's thread, which it must not delay; it keeps nothing large."""
        if len(sample.payload) > MAX_RADIO_FRAME_BYTES:
            self._far_too_large += 1
            return
        self._inbox.put(_Arrival(sample.payload.to_bytes(), self._clock.now_ns(), self._clock.utc_ns()))

    def _own_rows(self, received: ReceivedPackets, ahead_ns: int) -> ReceivedPackets:
        """The packets with this robot's row, and times since its agent's start."""
        at_ns = received.received_at_ns + ahead_ns
        rows = self._rows(received.receiver)
        return ReceivedPackets(
            rows,
            received.sender_index,
            received.sequence,
            at_ns,
            received.measured,
            received.payload,
            received.payloads,
        )

    def _rows(self, rows: IntArray) -> IntArray:
        return np.full(len(rows), self._row)

    def _log_received(self, received: ReceivedPackets, start_utc_ns: int) -> None:
        """Log the packets; `start_utc_ns` is the UTC time of the agent's start."""
        sizes, tags = received.payloads.sizes, received.payloads.tags()
        for at, payload in enumerate(received.payload.tolist()):
            packet = ReceivedPacket(
                utc_ns=int(received.received_at_ns[at]) + start_utc_ns,
                sender=int(received.sender_index[at]),
                sequence=int(received.sequence[at]),
                to=BROADCAST,  # the medium does not report the addressed robot
                size_bytes=int(sizes[payload]),
                tag=int(tags[payload]),
                latency_ns=None,
                distance_m=float(received.measured["range_m"][at]) if "range_m" in received.measured else None,
                given=True,
            )
            self._log.received(packet)
        self._counted["packets_received"] += len(received)
