"""The world's side of the robots' network: the radio bridge and the emulated tracker.

The bridge carries packets between the world's radio medium and driver-run robots; the tracker publishes poses, as a
camera above a real arena would.
"""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.radio_bridge import (
    MAX_RADIO_FRAME_BYTES,
    BoundedInbox,
    BridgeInfo,
    Pose,
    encode_bridged,
    encode_pose,
)
from swarmwire.comms.wire.robot_network import endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.comms.wire.tick_frames import decode_actions

MAX_WAITING = 4096  # frames that may wait for the loop


@dataclass(frozen=True, slots=True)
class BridgedRadio:
    """The properties of the world's radio for all robots of an arena; `BridgeInfo` holds those for one robot."""

    robots: tuple[str, ...]  # all of the arena, by index
    rate_hz: int
    max_payload_bytes: int
    measures: tuple[str, ...]  # columns of `ReceivedPackets.measured`
    needs: tuple[str, ...]  # the needs of agents that it meets

    def terms(self, row: int) -> BridgeInfo:
        """The terms of the robot of this row."""
        return BridgeInfo(row, self.robots, self.rate_hz, self.max_payload_bytes, self.measures, self.needs)


class RadioBridge:
    """Carries packets between the loop and driver-run robots; the key of a frame identifies its robot.

    Attributes:
        session: the run's session in that network, also for other users; from `open` to `close`.
    """

    def __init__(
        self,
        network: Network,
        keys: SwarmKeys,
        rows: Mapping[str, int],
        medium: BridgedRadio | None,
        access: Mapping[str, Any] | None = None,
    ) -> None:
        """`rows` holds the rows of the robots that may take part, by name.

        `medium` is None in a run without radio.
        """
        self._network, self._keys, self._rows, self._medium, self._access = network, keys, dict(rows), medium, access
        self._row_of = {keys.bridge_sent(name): row for name, row in rows.items()}
        self._joins = {keys.bridge_join(name): row for name, row in rows.items()}
        self._inbox = BoundedInbox[tuple[int, bytes]](MAX_WAITING)
        self._session: zenoh.Session | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}  # by row
        self._declarations: tuple[object, ...] = ()  # zenoh undeclares what is not referenced
        self._counted = Counter[str]()
        self._states: dict[int, str] = {}  # by row, noted since the last call of `noted`
        self._values: dict[int, float] = {}  # the same of numbers
        self._unknown_keys = self._oversized = 0  # refused by the network's threads

    @property
    def session(self) -> zenoh.Session:
        """The session, while it is open."""
        if self._session is None:
            raise RuntimeError("the bridge is to be opened first")
        return self._session

    def open(self) -> tuple[str, ...]:
        """Join the network; returns its endpoints. BadInput if one is in use or a file does not fit."""
        session = self._session = open_swarm(self._network, self._access, small=False)
        self._publishers = {
            row: session.declare_publisher(
                self._keys.bridge_received(name), congestion_control=zenoh.CongestionControl.DROP
            )
            for name, row in self._rows.items()
        }
        self._declarations = (
            session.declare_subscriber(self._keys.any_bridge_sent, Callback(self._arrive, indirect=False)),
            session.declare_queryable(self._keys.any_bridge_join, Callback(self._answer, indirect=False)),
        )
        return endpoints_of(session, self._network)

    def publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Send a frame to each robot with received packets or transmit statuses; other rows are left out."""
        concerned = {*np.unique(received.receiver).tolist(), *np.unique(tx_status.row).tolist()}
        for row in sorted(concerned & self._publishers.keys()):
            robot_packets = received.select(np.flatnonzero(received.receiver == row)).compacted()
            robot_status = tx_status.select(np.flatnonzero(tx_status.row == row))
            try:
                self._publishers[row].put(encode_bridged(tick, row, robot_packets, robot_status))
            except zenoh.ZError:  # the session was closed
                self._counted["frames_refused"] += 1
            else:
                self._counted["packets_to_robots"] += len(robot_packets)

    def take(self) -> SentPackets:
        """The packets from robots since the last call; the medium ends those of dead robots."""
        parts = [actions for row, frame in self._inbox.pop_all() if (actions := self._actions(row, frame)) is not None]
        for actions in parts:  # each of one robot
            names = [actions.notes.names[int(index)] for index in actions.notes.value]
            self._states |= dict(zip(actions.notes.rows.tolist(), names, strict=True))
            self._values |= dict(zip(actions.values.rows.tolist(), actions.values.value.tolist(), strict=True))
        sent = SentPackets.joined([actions.sent for actions in parts])
        self._counted["packets_from_robots"] += len(sent)
        return sent

    def noted(self) -> tuple[SparseTable, SparseTable]:
        """The last state and number of each agent that noted one, in the frames taken since the last call."""
        states, self._states = self._states, {}
        values, self._values = self._values, {}
        names = tuple(dict.fromkeys(states.values()))
        indices = [names.index(state) for state in states.values()]
        return _table(list(states), indices, names), _table(list(values), list(values.values()))

    def counts(self) -> dict[str, int]:
        """Carried packets and unusable frames, by name, those above 0."""
        counted = Counter(self._counted)
        counted["frames_of_nobody"] += self._unknown_keys
        counted["frames_oversized"] += self._oversized
        counted["frames_dropped"] += self._inbox.dropped
        return {name: count for name, count in sorted(counted.items()) if count}

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        session, self._session = self._session, None
        if session is not None:
            close_session(session)

    def _arrive(self, sample: zenoh.Sample) -> None:
        """Called by the network's threads: it must be fast, and store nothing large."""
        row = self._row_of.get(str(sample.key_expr))  # the exact key alone speaks for a robot
        if row is None:
            self._unknown_keys += 1
        elif len(sample.payload) > MAX_RADIO_FRAME_BYTES:
            self._oversized += 1
        else:
            self._inbox.put((row, sample.payload.to_bytes()))

    def _answer(self, query: zenoh.Query) -> None:
        """Answer a join query. Called by the network's threads: the answers are fixed."""
        with query:  # a query that is kept alive blocks its sender
            row = self._joins.get(key := str(query.key_expr))
            if self._medium is None:
                query.reply_err("expected a world with a radio; this run has none")
            elif row is None:
                robots = ", ".join(self._rows) or "none"
                query.reply_err(f"expected a robot that the world lends its radio to: {robots}")
            else:
                query.reply(key, self._medium.terms(row).encode())

    def _actions(self, row: int, data: bytes) -> Actions | None:
        try:
            frame = frames.decode(data, MAX_RADIO_FRAME_BYTES)
            if frame.kind != "actions":
                raise BadFrame("malformed", frame.kind)
            return decode_actions(frame, np.array([row]))
        except BadFrame as error:
            self._counted[f"frames_{error.fault}"] += 1
            return None


def _table(rows: list[int], values: Sequence[float], names: tuple[str, ...] = ()) -> SparseTable:
    """A number for each of these rows."""
    return SparseTable(np.array(rows, np.int64), np.zeros(len(rows), np.int64), np.array(values, np.float64), names)


class EmulatedTracker:
    """Publishes the pose of each robot that is alive, once per tick; of several arenas, only the first."""

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, clock: DatedClock) -> None:
        """`clock` dates the poses: by the pace of the run, where that is not the wall clock's."""
        self._session, self._keys, self._clock = session, keys, clock
        self._publishers: list[zenoh.Publisher] = []
        self._refused = 0

    def begin(self, static: Static) -> None:
        """Declare the publishers, under the names of the robots in their arena."""
        self._publishers = [
            self._session.declare_publisher(
                self._keys.pose(name),
                congestion_control=zenoh.CongestionControl.DROP,
                allowed_destination=zenoh.Locality.REMOTE,
            )
            for name in static.robot_names
        ]

    def tell(self, poses: FloatArray, alive: BoolArray) -> None:
        """Publish the poses (rows, 3) of the robots of the first arena that are alive (rows,)."""
        stamp_ns = self._clock.utc_ns()
        pose = cast("list[list[float]]", poses[: len(self._publishers)].tolist())
        for publisher, is_alive, place in zip(self._publishers, alive.tolist(), pose, strict=False):
            if not is_alive:
                continue
            try:
                publisher.put(encode_pose(Pose(*place), stamp_ns))
            except zenoh.ZError:
                self._refused += 1

    def counts(self) -> dict[str, int]:
        """Poses that a closed session refused, by name, if any."""
        return {"tracker_poses_refused": self._refused} if self._refused else {}

    def end(self) -> None:
        """Publish no more."""
        publishers, self._publishers = self._publishers, []
        for publisher in publishers:
            if not self._session.is_closed():
                publisher.undeclare()
