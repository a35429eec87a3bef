"""The world's side of the robots' network: the radio bridge and the emulated tracker.

The bridge carries packets between the world's radio medium and driver-run robots; the tracker publishes poses, as a
camera above a real arena would.
"""

# zenoh's stubs omit the return types of put, reply and close.
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

MAX_WAITING = 4096  # frames that wait for the loop


@dataclass(frozen=True, slots=True)
class BridgedRadio:
    """The properties of the world's radio for all robots of an arena; `BridgeInfo` has them for one robot."""

    robots: tuple[str, ...]  # names of the arena's robots, by index
    rate_hz: int
    max_payload_bytes: int
    measures: tuple[str, ...]  # columns of `ReceivedPackets.measured`
    needs: tuple[str, ...]  # agents' needs that it can meet

    def info(self, row: int) -> BridgeInfo:
        """Return the properties for the robot of this row."""
        return BridgeInfo(row, self.robots, self.rate_hz, self.max_payload_bytes, self.measures, self.needs)


class RadioBridge:
    """Carries packets between the loop and driver-run robots; the key of a frame identifies its robot.

    Attributes:
        session: the run's session in that network, from `open` to `close`; others may use it.
    """

    def __init__(
        self,
        network: Network,
        keys: SwarmKeys,
        rows: Mapping[str, int],
        medium: BridgedRadio | None,
        access: Mapping[str, Any] | None = None,
    ) -> None:
        """`rows` maps the names of participating robots to rows; `medium` is None in a run without radio."""
        self._network, self._keys, self._rows, self._medium, self._access = network, keys, dict(rows), medium, access
        self._row_of = {keys.bridge_sent(name): row for name, row in rows.items()}
        self._joins = {keys.bridge_join(name): row for name, row in rows.items()}
        self._inbox = BoundedInbox[tuple[int, bytes]](MAX_WAITING)
        self._session: zenoh.Session | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}  # robot row -> publisher
        self._declarations: tuple[object, ...] = ()  # zenoh undeclares unreferenced ones
        self._counted = Counter[str]()
        self._states: dict[int, str] = {}  # robot row -> last state that its agent noted
        self._values: dict[int, float] = {}  # robot row -> last number that its agent noted
        self._unknown_keys = self._oversized = 0  # numbers of frames that the network's threads refused

    @property
    def session(self) -> zenoh.Session:
        """The open session."""
        if self._session is None:
            raise RuntimeError("the bridge is not open")
        return self._session

    def open(self) -> tuple[str, ...]:
        """Join the network, and return its endpoints; BadInput if one is in use or a file does not fit."""
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
        """Send a frame to each robot with received packets or transmit statuses; other rows are ignored."""
        rows = {*np.unique(received.receiver).tolist(), *np.unique(tx_status.row).tolist()}
        for row in sorted(rows & self._publishers.keys()):
            robot_packets = received.select(np.flatnonzero(received.receiver == row)).compacted()
            robot_status = tx_status.select(np.flatnonzero(tx_status.row == row))
            try:
                self._publishers[row].put(encode_bridged(tick, row, robot_packets, robot_status))
            except zenoh.ZError:  # the session was closed
                self._counted["frames_refused"] += 1
            else:
                self._counted["packets_to_robots"] += len(robot_packets)

    def pop_packets(self) -> SentPackets:
        """Remove and return the packets from robots; the medium ends packets of dead robots."""
        parts = [actions for row, frame in self._inbox.pop_all() if (actions := self._actions(row, frame)) is not None]
        for actions in parts:  # one robot's actions
            names = [actions.notes.names[int(index)] for index in actions.notes.value]
            self._states |= dict(zip(actions.notes.rows.tolist(), names, strict=True))
            self._values |= dict(zip(actions.values.rows.tolist(), actions.values.value.tolist(), strict=True))
        sent = SentPackets.joined([actions.sent for actions in parts])
        self._counted["packets_from_robots"] += len(sent)
        return sent

    def pop_notes(self) -> tuple[SparseTable, SparseTable]:
        """Remove and return the last state and number that each agent noted in the frames so far."""
        states, self._states = self._states, {}
        values, self._values = self._values, {}
        names = tuple(dict.fromkeys(states.values()))
        indices = [names.index(state) for state in states.values()]
        return _table(list(states), indices, names), _table(list(values), list(values.values()))

    def counts(self) -> dict[str, int]:
        """Return the numbers above 0 of packets and unusable frames, by name."""
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
        """Queue a frame. The network's threads call this: it must be fast, and store nothing large."""
        row = self._row_of.get(str(sample.key_expr))  # only the exact key identifies a robot
        if row is None:
            self._unknown_keys += 1
        elif len(sample.payload) > MAX_RADIO_FRAME_BYTES:
            self._oversized += 1
        else:
            self._inbox.put((row, sample.payload.to_bytes()))

    def _answer(self, query: zenoh.Query) -> None:
        """Answer a join query. The network's threads call this: the answers are constant."""
        with query:  # a query that stays alive blocks its sender
            row = self._joins.get(key := str(query.key_expr))
            if self._medium is None:
                query.reply_err("expected a world with a radio; this run has none")
            elif row is None:
                robots = ", ".join(self._rows) or "none"
                query.reply_err(f"expected a robot that the world lends its radio to: {robots}")
            else:
                query.reply(key, self._medium.info(row).encode())

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
    """Return a table with a number for each row."""
    return SparseTable(np.array(rows, np.int64), np.zeros(len(rows), np.int64), np.array(values, np.float64), names)


class EmulatedTracker:
    """Publishes the poses of the first arena's robots that are alive, once per tick."""

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, clock: DatedClock) -> None:
        """`clock` dates the poses, by the pace of the run."""
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

    def publish(self, poses: FloatArray, alive: BoolArray) -> None:
        """Publish the poses (rows, 3) of the robots of the first arena that are alive (rows,)."""
        stamp_ns = self._clock.utc_ns()
        pose_list = cast("list[list[float]]", poses[: len(self._publishers)].tolist())
        for publisher, is_alive, pose in zip(self._publishers, alive.tolist(), pose_list, strict=False):
            if not is_alive:
                continue
            try:
                publisher.put(encode_pose(Pose(*pose), stamp_ns))
            except zenoh.ZError:
                self._refused += 1

    def counts(self) -> dict[str, int]:
        """Return the number of poses that a closed session refused, by name; {} for none."""
        return {"tracker_poses_refused": self._refused} if self._refused else {}

    def end(self) -> None:
        """Undeclare the publishers."""
        publishers, self._publishers = self._publishers, []
        for publisher in publishers:
            if not self._session.is_closed():
                publisher.undeclare()
