"""The radio medium of a world as the radio of a real robot: its packets are emulated among the world's robots.

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

JOIN_TIMEOUT_S = 10.0  # sum over all queries
QUERY_TIMEOUT_S = 1.0
QUERY_INTERVAL_NS = to_ns(0.1)
MAX_WAITING = 1024  # frames that may wait for the agent's next step
NO_COMMAND = np.zeros(1)


def _no_actions(row: int) -> Actions:
    """Return empty actions of a robot: its driver has the commands."""
    return Actions(np.array([row]), NO_COMMAND != 0.0, NO_COMMAND, NO_COMMAND, NO_COMMAND)


class _Arrival(NamedTuple):
    frame: bytes
    received_ns: int  # time of arrival by the agent's clock
    utc_ns: int


class WorldRadio:
    """The radio of `robot`, one of `robots`, in the medium of the world that answers in this network.

    Attributes:
        terms: the world's medium; None before `open`, when `needs` and `measures` are empty.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: SwarmKeys,
        robots: Sequence[str],
        robot: str,
        clock: DatedClock,
        log: RadioLog | None = None,
        wall: Clock | None = None,
    ) -> None:
        """Keep the parameters; `clock` runs at the agent's pace, and timeouts of the network use the `wall` clock."""
        self._session, self._keys, self._robots, self._robot = session, keys, tuple(robots), robot
        self._row, self._clock = self._robots.index(robot), clock
        self._wall: Clock = wall or WallClock()
        self._log: RadioLog = log or NoRadioLog()
        self._inbox = BoundedInbox[_Arrival](MAX_WAITING)
        self._subscriber: zenoh.Subscriber[None] | None = None
        self._sequence = self._frames = self._oversized = 0
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
            self._keys.bridge_received(self._robot), Callback(self._arrive, indirect=False)
        )

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Return packets and tx statuses from the medium since the last call."""
        terms, received, tx_status = self._joined(), ReceivedPackets.none(self.measures), NO_TX_STATUSES
        started_ns = self._clock.now_ns() - now_ns
        for arrival in self._inbox.pop_all():
            try:
                tick, packets, statuses = decode_bridged(arrival.frame, terms)
            except BadFrame as error:
                self._counted[f"frames_{error.fault}"] += 1
                continue
            # The world sent the frame at the start of its tick.
            offset_ns = arrival.received_ns - started_ns - tick_start_ns(tick, terms.rate_hz)
            arrived = self._with_own_row(packets, offset_ns)
            self._log_received(arrived, arrival.utc_ns - arrival.received_ns + started_ns)
            received = ReceivedPackets.joined([received, arrived])
            tx_status = TxStatuses.joined(
                [tx_status, TxStatuses(self._rows(statuses.row), statuses.id, statuses.result)]
            )
        return received, tx_status

    def send(self, sent: SentPackets) -> None:
        """Send packets to the medium, including too large ones, which the world counts."""
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
        """Pass the agent's notes to the world."""
        row = self._joined().row
        notes, values = (replace(table, rows=np.full(len(table), row)) for table in (states, values))
        self._put(replace(_no_actions(row), notes=notes, values=values))

    def _put(self, actions: Actions) -> bool:
        """Send a frame with these actions; return False if the session is closed."""
        self._frames += 1
        try:
            self._session.put(
                self._keys.bridge_sent(self._robot),
                encode_actions(self._frames, actions),
                congestion_control=zenoh.CongestionControl.DROP,
            )
        except zenoh.ZError:
            return False
        return True

    def counts(self) -> dict[str, int]:
        """Return the numbers of packets and frames sent, received and lost, by name, without zeros."""
        counted = Counter(self._counted)
        counted["frames_oversized"] += self._oversized
        counted["frames_dropped"] += self._inbox.dropped
        return {name: count for name, count in sorted(counted.items()) if count}

    def close(self) -> None:
        """Stop receiving; the session is closed by its owner."""
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None and not self._session.is_closed():
            subscriber.undeclare()

    def _join(self) -> BridgeInfo:
        """Query until the world answers, also while the network is still starting; BadInput if none does in time."""
        deadline_ns = self._wall.now_ns() + to_ns(JOIN_TIMEOUT_S)
        while (remaining_ns := deadline_ns - self._wall.now_ns()) > 0:
            for reply in self._session.get(
                self._keys.bridge_join(self._robot), timeout=min(QUERY_TIMEOUT_S, to_s(remaining_ns))
            ):
                if reply.ok is not None:
                    try:
                        return BridgeInfo.decode(reply.ok.payload.to_bytes())
                    except BadFrame as error:
                        raise BadInput("radio", "world", f"expected a world of this version: {error}") from error
                if reply.err is not None and (error := reply.err.payload.to_string()) != "Timeout":
                    raise BadInput("radio", "world", error)
            self._wall.sleep_until(min(self._wall.now_ns() + QUERY_INTERVAL_NS, deadline_ns))
        expected = f"expected a world that lends its radio to {self._robot}; none in the network answers"
        raise BadInput("radio", "world", expected)

    def _joined(self) -> BridgeInfo:
        if self.terms is None:
            raise RuntimeError("the radio is not open")
        return self.terms

    def _arrive(self, sample: zenoh.Sample) -> None:
        """Queue a frame, without delay for the network's thread, which calls this; drop an oversized one."""
        if len(sample.payload) > MAX_RADIO_FRAME_BYTES:
            self._oversized += 1
            return
        self._inbox.put(_Arrival(sample.payload.to_bytes(), self._clock.now_ns(), self._clock.utc_ns()))

    def _with_own_row(self, received: ReceivedPackets, offset_ns: int) -> ReceivedPackets:
        """Convert packets to this robot's row, and to times since its agent's start."""
        received_ns = received.received_at_ns + offset_ns
        return replace(received, receiver=self._rows(received.receiver), received_at_ns=received_ns)

    def _rows(self, rows: IntArray) -> IntArray:
        return np.full(len(rows), self._row)

    def _log_received(self, received: ReceivedPackets, start_utc_ns: int) -> None:
        """Log the packets; `start_utc_ns` is the UTC time of the agent's start."""
        sizes, tags = received.payloads.sizes, received.payloads.tags()
        for i, payload in enumerate(received.payload.tolist()):
            packet = ReceivedPacket(
                utc_ns=int(received.received_at_ns[i]) + start_utc_ns,
                sender=int(received.sender_index[i]),
                sequence=int(received.sequence[i]),
                to=BROADCAST,  # the medium does not report the addressed robot
                size_bytes=int(sizes[payload]),
                tag=int(tags[payload]),
                latency_ns=None,
                distance_m=float(received.measured["range_m"][i]) if "range_m" in received.measured else None,
                delivered=True,
            )
            self._log.received(packet)
        self._counted["packets_received"] += len(received)
