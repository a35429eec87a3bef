"""The runner's side of the protocol, without any I/O: bytes and the world's token in, events and bytes out.

    state      move      next     by
    searching  finds     joining  `world_present(True)`
    joining    joins     joined   `receive_assignment`, with the world's reply to the request of `join`
    joined     is ready  ready    `ready`, once the agents are made
    ready      is asked  acting   the event `Tick`
    acting     answers   ready    `answer`
    ready      sends     ready    `send` after the event `PacketsBetween`; `answer_late`; `lose` after the end of a
                                  process, `restart` after its restart
    acting     sends     acting   likewise; `lose` and `restart` also while joined
    joined, ready or acting
               leaves    leaving  `leave`; the runner stays until the world confirms it
    all        ends      ended    a frame "end", or `world_present(False)`; `Ended` is the last event

The caller passes on all arrivals, then reads events from `next_event` until there are none. So of the frames "tick"
that wait, a runner acts on the newest; in lockstep there is only one. Each `Tick` has exactly one answer. Frames
"packets", which come between ticks, are events in their order.

A frame is counted and dropped if it comes before the assignment, is malformed, out of order or replaced by a newer one;
the next answer reports the count. A call that the state does not allow raises RuntimeError and changes nothing. The
world's side is `RunnerRegistry`, with `Lockstep` and `RealTime`.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from msgspec import Struct

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemories, Layout, decode_memory
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.join import JoinRequest, versioned
from swarmwire.comms.wire.limits import MAX_BYTES
from swarmwire.comms.wire.tick_frames import check_rows, decode_packets, decode_tick, encode_actions, encode_sent

RunnerState = Literal["searching", "joining", "joined", "ready", "acting", "leaving", "ended"]
Move = Literal["finds", "joins", "is ready", "is asked", "answers", "sends", "leaves", "ends"]

MOVES: dict[RunnerState, dict[Move, RunnerState]] = {
    "searching": {"finds": "joining", "ends": "ended"},
    "joining": {"joins": "joined", "ends": "ended"},
    "joined": {"is ready": "ready", "leaves": "leaving", "ends": "ended"},
    "ready": {"is asked": "acting", "sends": "ready", "leaves": "leaving", "ends": "ended"},
    "acting": {"answers": "ready", "sends": "acting", "leaves": "leaving", "ends": "ended"},
    "leaving": {"ends": "ended"},
    "ended": {},
}
WITH_ROBOTS: tuple[RunnerState, ...] = ("joined", "ready", "acting")


@dataclass(frozen=True)
class JoinOptions:
    """The request of a runner for robots, and its agents."""

    request: JoinRequest = field(default_factory=JoinRequest)
    agents: Mapping[str, str] = field(default_factory=dict[str, str])  # spec by group, instead of the world's


class Assigned(NamedTuple):
    """The robots of the runner, and the memory of their earlier agents."""

    assignment: Assignment
    memory: GroupMemories | None  # None: the world keeps no memory
    layouts: Mapping[str, Layout]  # columns of the world's memory, by group; empty if it keeps none
    timeout_s: float  # a process that is silent for this time is lost
    answer_within_s: float | None  # in real time, the host answers without late processes after this time


class Tick(NamedTuple):
    """The newest tick: its readings, and the packets and statuses since the runner's robots acted last."""

    tick: int
    readings: Readings
    received: ReceivedPackets
    tx_status: TxStatuses


class PacketsReceived(NamedTuple):
    """Packets and statuses that came between ticks; they wait for the next step, or for `PacketsBetween`."""

    received: ReceivedPackets
    tx_status: TxStatuses
    tick: int
    at_ns: int  # simulated time


class PacketsBetween(NamedTuple):
    """The agents may read the packets received so far, at this time, and send others: no newer tick waits."""

    tick: int
    at_ns: int


class Ended(NamedTuple):
    """The end of a runner: the run is over, it left, the world removed it, or the world is gone."""

    outcome: Literal["over", "left", "removed", "gone"]
    reason: str = ""  # the world's reason, if it removed the runner


class _Times(Struct):
    """The times in a reply to a request."""

    timeout_s: float
    answer_within_s: float | None


Event = Tick | PacketsReceived | PacketsBetween | Ended


class RunnerProtocol:
    """The protocol of one runner, from its search for the world to its end.

    Attributes:
        state: the present state; `MOVES` has the moves from it.
        dropped: number of dropped frames since the last answer.
        missed: number of frames "packets" that never arrived, since the last frame "sent".
    """

    def __init__(self) -> None:
        self.state: RunnerState = "searching"
        self.dropped = self.missed = 0
        self._agents: Mapping[str, str] = {}
        self._rows: dict[str, IntArray] = {}  # robot rows by group; empty before the assignment
        self._measures: tuple[str, ...] = ()
        self._period = 1  # ticks between two in which any group acts
        self._newest: Tick | None = None  # no event yet
        self._last_tick = self._open_tick = NO_TICK  # the newest tick that arrived, and the tick to answer
        self._packets: deque[PacketsReceived] = deque()
        self._between: PacketsBetween | None = None
        self._next_number = 0  # expected number of the next frame "packets"
        self._ended: Ended | None = None

    def world_present(self, present: bool) -> None:
        """Accept that the world's liveliness token appeared or vanished."""
        if not present:
            self._end(Ended("left" if self.state == "leaving" else "gone"))
        elif self.state == "searching":
            self._move("finds")

    def join(self, options: JoinOptions) -> bytes:
        """Return the request for robots."""
        self._require("joins")
        self._agents = options.agents
        return options.request.encode()

    def receive_assignment(self, data: bytes) -> Assigned:
        """Return the robots in the world's reply to the request; BadFrame if it assigns none."""
        self._require("joins")
        reply = versioned(data, MAX_BYTES)
        assignment, memory = Assignment.from_mapping(reply).with_agents(self._agents), reply.get("memory")
        if not assignment.groups:
            raise BadFrame("malformed", "groups: expected at least one")
        layouts = _layouts(assignment, reply) if memory is not None else {}
        if memory is not None and not isinstance(memory, bytes):
            raise BadFrame("malformed", "memory: expected a frame")
        times = frames.typed(_Times, {name: reply[name] for name in _Times.__struct_fields__ if name in reply}, "")
        rows = {group.name: group.rows for group in assignment.groups}
        group_memories = None if memory is None else decode_memory(frames.decode(memory), layouts, rows)
        assigned = Assigned(assignment, group_memories, layouts, times.timeout_s, times.answer_within_s)
        self._rows = rows
        self._measures = assignment.measures or ()
        self._period = math.gcd(*(group.act_every_ticks for group in assignment.groups))
        self._move("joins")
        return assigned

    def receive_frame(self, data: bytes) -> None:
        """Accept a frame from the world; a wrong frame is counted and dropped."""
        try:
            frame = frames.decode(data)
            if not self._rows or self.state == "ended":
                raise BadFrame("unexpected_kind", frame.kind)
            if frame.kind == "end":
                self._end(self._ended_by(frame))
            elif self.state == "leaving":
                raise BadFrame("unexpected_kind", frame.kind)
            elif frame.kind == "packets":
                self._receive_packets(frame)
            else:
                self._receive_tick(frame)
        except BadFrame:
            self.dropped += 1

    def next_event(self) -> Event | None:
        """Return the next event; None: the runner must wait for an arrival, or answer. `Ended` is repeated."""
        if self.state != "ready":
            return self._ended
        if self._packets:
            return self._packets.popleft()
        if self._newest is None:
            between, self._between = self._between, None
            return between
        tick, self._newest, self._between = self._newest, None, None
        self._open_tick = tick.tick
        self._move("is asked")
        return tick

    def ready(self, processes: int = 1) -> bytes:
        """Return a frame "ready": the agents are made, in this number of processes."""
        self._move("is ready")
        return frames.encode("ready", NO_TICK, {}, {"processes": processes})

    def answer(self, actions: Actions, memory: GroupMemories | None = None) -> bytes:
        """Return a frame "actions", the answer to the last `Tick`, with the agents' memory if the world keeps any."""
        self._require("answers")
        data = encode_actions(self._open_tick, actions, self.dropped, memory)
        self.dropped = 0
        self._move("answers")
        return data

    def answer_late(self, tick: int, actions: Actions, memory: GroupMemories | None) -> bytes:
        """Return a frame "actions" for an earlier tick, in real time, with robots that `answer` did not have."""
        self._require("sends")
        return encode_actions(tick, actions, 0, memory)

    def lose(self, rows: IntArray, process: str, reason: str, failed: str = "", traceback: str = "") -> bytes:
        """Return a frame "lost": robots are lost with their process; `failed` names those of an agent that raised.

        The runner has these robots no more, but ticks that the world sent before may still have them.
        """
        agent = {"robots": failed, "traceback": traceback} if failed else {}
        return self._process_frame("lost", rows, {"process": process, "reason": reason, **agent})

    def restart(self, rows: IntArray, process: str, reason: str) -> bytes:
        """Return a frame "restarted": a process ended and was restarted with its robots, which the runner keeps."""
        return self._process_frame("restarted", rows, {"process": process, "reason": reason})

    def _process_frame(self, kind: str, rows: IntArray, values: dict[str, str]) -> bytes:
        if self.state != "joined":
            self._require("sends")
        return frames.encode(kind, NO_TICK, {"rows": rows}, values)

    def send(self, tick: int, sent: SentPackets) -> bytes:
        """Return a frame "sent", with the packets that the agents sent at `PacketsBetween`."""
        self._require("sends")
        data = encode_sent(tick, sent, self.missed)
        self.missed = 0
        return data

    def leave(self) -> bytes | None:
        """Leave the run; return a frame "leave". Without robots, or in a second call, end at once and return None."""
        if "leaves" not in MOVES[self.state]:
            self._end(Ended("left"))
            return None
        self._move("leaves")
        self._drop_waiting()
        return frames.encode("leave", NO_TICK, {})

    def _receive_tick(self, frame: Frame) -> None:
        if frame.kind != "tick" or frame.tick <= self._last_tick or frame.tick % self._period:
            raise BadFrame("wrong_tick", f"{frame.kind} {frame.tick}")
        readings, received, tx_status = decode_tick(frame, self._measures, self._rows.keys())
        check_rows(readings, received, self._rows)
        self.dropped += self._newest is not None
        self._newest, self._last_tick = Tick(frame.tick, readings, received, tx_status), frame.tick

    def _receive_packets(self, frame: Frame) -> None:
        at_ns, number, received, tx_status = decode_packets(frame, self._measures)
        self.missed += max(0, number - self._next_number)
        self._next_number = number + 1
        self._packets.append(PacketsReceived(received, tx_status, frame.tick, at_ns))
        self._between = PacketsBetween(frame.tick, at_ns)

    def _ended_by(self, frame: Frame) -> Ended:
        if self.state == "leaving":
            return Ended("left")
        reason = frame.values.get("why")
        return Ended("removed", reason) if isinstance(reason, str) else Ended("over")

    def _end(self, ended: Ended) -> None:
        if self.state != "ended":
            self._drop_waiting()
            self._move("ends")
            self._ended = ended

    def _drop_waiting(self) -> None:
        """Drop the frames that wait."""
        self.dropped += len(self._packets) + (self._newest is not None)
        self._packets.clear()
        self._newest = self._between = None

    def _require(self, move: Move) -> None:
        if move not in MOVES[self.state]:
            raise RuntimeError(f"a runner that is {self.state} has no move {move!r}")

    def _move(self, move: Move) -> None:
        self._require(move)
        self.state = MOVES[self.state][move]


def _layouts(assignment: Assignment, reply: Mapping[str, object]) -> dict[str, Layout]:
    """Return the columns of memory of each group in a reply; BadFrame unless it has those of all groups."""
    columns = dict[str, dict[str, tuple[Literal["<f8", "<i8", "<u8", "|b1", "|u1"], tuple[int, ...]]]]
    layouts = frames.typed(columns, reply.get("memory_columns"), "memory_columns")
    if not {group.name for group in assignment.groups} <= layouts.keys():
        raise BadFrame("malformed", "memory_columns: expected those of each group")
    return {group.name: layouts[group.name] for group in assignment.groups}
