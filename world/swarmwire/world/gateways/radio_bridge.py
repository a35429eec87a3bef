"""The world's air as driver-run robots have it, and the run's session in the robots' network."""

# pyright: reportUnknownMemberType=false

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.radio_bridge import MAX_RADIO_FRAME_BYTES, BoundedInbox, BridgeInfo, encode_bridged
from swarmwire.comms.wire.robot_network import SwarmKeys, endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.comms.wire.tick_frames import decode_actions

# zenoh's stubs leave out the return types of put, reply and close.


MAX_WAITING = 4096  # frames that may wait for the loop


@dataclass(frozen=True, slots=True)
class BridgedRadio:
    """What the world's radio is to every robot of an arena; `BridgeInfo` says the same to one of them."""

    robots: tuple[str, ...]  # all of the arena, by index
    rate_hz: int
    max_payload_bytes: int
    measures: tuple[str, ...]  # columns of `ReceivedPackets.given`
    needs: tuple[str, ...]  # what of an agent's needs it meets

    def terms(self, row: int) -> BridgeInfo:
        """The terms of the robot of this row."""
        return BridgeInfo(row, self.robots, self.rate_hz, self.max_payload_bytes, self.measures, self.needs)


class RadioBridge:
    """Carries packets between the loop and driver-run robots, which say by their key who they are.

    Attributes:
        session: the run's, for whoever else speaks in that network; from `open` to `close`.
    """

    def __init__(
        self,
        network: Network,
        keys: SwarmKeys,
        rows: Mapping[str, int],
        medium: BridgedRadio | None,
        access: Mapping[str, Any] | None = None,
    ) -> None:
        """`rows` are those of the world's robots that may take part, by name.

        `medium` is None in a run without radio.
        """
        self._network, self._keys, self._rows, self._medium, self._access = network, keys, dict(rows), medium, access
        self._row_of = {keys.bridge_sent(name): row for name, row in rows.items()}
        self._joins = {keys.bridge_join(name): row for name, row in rows.items()}
        self._inbox = BoundedInbox[tuple[int, bytes]](MAX_WAITING)
        self._session: zenoh.Session | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}  # by row
        self._declared: tuple[object, ...] = ()  # zenoh takes back what nobody holds on to
        self._counted = Counter[str]()
        self._of_nobody = self._far_too_large = 0  # refused by the network's threads

    @property
    def session(self) -> zenoh.Session:
        """The session, while it is open."""
        if self._session is None:
            raise RuntimeError("the bridge is to be opened first")
        return self._session

    def open(self) -> tuple[str, ...]:
        """Take part in the network; returns the endpoints to call. BadInput if one is taken, or a file will not do."""
        session = self._session = open_swarm(self._network, self._access, small=False)
        self._publishers = {
            row: session.declare_publisher(
                self._keys.bridge_received(name), congestion_control=zenoh.CongestionControl.DROP
            )
            for name, row in self._rows.items()
        }
        self._declared = (
            session.declare_subscriber(self._keys.any_bridge_sent, Callback(self._arrive, indirect=False)),
            session.declare_queryable(self._keys.any_bridge_join, Callback(self._answer, indirect=False)),
        )
        return endpoints_of(session, self._network)

    def publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """A frame to each robot that received something or learns of its packets; rows of others are left out."""
        concerned = {*np.unique(received.receiver).tolist(), *np.unique(tx_status.row).tolist()}
        for row in sorted(concerned & self._publishers.keys()):
            its = received.select(np.flatnonzero(received.receiver == row)).compacted()
            told = tx_status.select(np.flatnonzero(tx_status.row == row))
            try:
                self._publishers[row].put(encode_bridged(tick, row, its, told))
            except zenoh.ZError:  # the session was closed
                self._counted["frames_refused"] += 1
            else:
                self._counted["packets_to_robots"] += len(its)

    def take(self) -> SentPackets:
        """Packets that the robots sent since the last call; those of robots that died are for the medium to end."""
        parts = [sent for row, frame in self._inbox.take() if (sent := self._sent(row, frame)) is not None]
        self._counted["packets_from_robots"] += sum(map(len, parts))
        return SentPackets.joined(parts)

    def counts(self) -> dict[str, int]:
        """Packets carried, and what came that was of no use, by name, where there is any."""
        counted = Counter(self._counted)
        counted["frames_of_nobody"] += self._of_nobody
        counted["frames_oversized"] += self._far_too_large
        counted["frames_dropped"] += self._inbox.dropped
        return {name: count for name, count in sorted(counted.items()) if count}

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        session, self._session = self._session, None
        if session is not None:
            close_session(session)

    def _arrive(self, sample: zenoh.Sample) -> None:
        """Called by the network's threads: it must take no time, and keep nothing that is large."""
        row = self._row_of.get(str(sample.key_expr))  # the exact key alone speaks for a robot
        if row is None:
            self._of_nobody += 1
        elif len(sample.payload) > MAX_RADIO_FRAME_BYTES:
            self._far_too_large += 1
        else:
            self._inbox.put((row, sample.payload.to_bytes()))

    def _answer(self, query: zenoh.Query) -> None:
        """Called by the network's threads: what there is to say is known."""
        with query:  # one that is kept alive holds its asker
            row = self._joins.get(key := str(query.key_expr))
            if self._medium is None:
                query.reply_err("expected a world with a radio; this run has none")
            elif row is None:
                robots = ", ".join(self._rows) or "none"
                query.reply_err(f"expected a robot that the world lends its air to: {robots}")
            else:
                query.reply(key, self._medium.terms(row).encode())

    def _sent(self, row: int, data: bytes) -> SentPackets | None:
        try:
            frame = frames.decode(data, MAX_RADIO_FRAME_BYTES)
            if frame.kind != "actions":
                raise BadFrame("malformed", frame.kind)
            return decode_actions(frame, np.array([row])).sent
        except BadFrame as error:
            self._counted[f"frames_{error.fault}"] += 1
            return None
