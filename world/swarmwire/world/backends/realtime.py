"""The real-time handshake with runners, without any I/O: frames go out each tick, no answer is awaited.

    tick      open_tick     a frame to each ready runner of a group that acts, also to one with unanswered frames
              "actions"     if newer than any before: its commands apply at once, its packets go to the medium at once;
                            every older unanswered frame counts as dropped
              pop_actions   the commands since the last call; a robot without an answer for `watchdog_s` stops;
                            any answer starts it again
    time      open_tick     no answer to any frame for `timeout_s`: the runner is lost

An answer that arrives after its own tick is late. "At once" is the tick that is open at the arrival: the packets go to
the medium with those of that tick, so they are sent at that tick's start plus their robot's phase and jitter.

With sub-ticks, packets cross also within a tick: "packets" frames go out and "sent" frames come in as packets are due.
Then `pop_sent` returns, many times in a tick, the packets to send and their times; `pop_actions` returns no packets.

    subtick   deliver       a frame "packets" to each ready runner whose robots received something
              "sent"        its packets go to the medium at once
              "actions"     as above, but its packets wait only for their robots' turn

`registry` has the rules for runners that join or are lost and for frames that do not fit.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns, to_ns, to_s
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.observe.interfaces import SubtickPackets
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, joined_tables
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import decode_actions, decode_sent, encode_packets, encode_tick
from swarmwire.world.backends.allocation import Allocation
from swarmwire.world.backends.join_policy import DEFAULT_JOIN_POLICY, HOST_GRACE_S, JoinPolicy
from swarmwire.world.backends.lockstep import acting_rows, split_readings, split_received, split_tx_status
from swarmwire.world.backends.registry import NON_BLOCKING, OnLoss, RunnerRegistry
from swarmwire.world.backends.runner_reports import RunnerEventKind, RunnerHealth

NO_PENDING = -1  # sentinel of `_pending_since_ns`: the robot has no unanswered frame


@dataclass(eq=False)
class _SentFrame:
    """A frame that was sent to a runner."""

    tick: int
    rows: IntArray  # (n,) robot rows that have not answered, in the order of the answer
    receivers: IntArray  # (k,) receiver of each packet in the frame
    senders: IntArray  # (k,) sender of each transmit status in the frame
    sent_ns: int  # wall time of sending, or of the last restart of a process; without pauses


@dataclass(eq=False)
class RealTimeAllocation(Allocation):
    """An allocation with its unanswered frames."""

    unanswered: deque[_SentFrame] = field(default_factory=deque[_SentFrame])  # oldest first


class RealTime(RunnerRegistry[RealTimeAllocation]):
    """The runners of a run in real time, which waits for none of them.

    Attributes:
        rate_hz: ticks per simulated second.
        late: (rows,) answers that arrived after their own tick.
        watchdog_stops: (rows,) stops of a robot by the watchdog.
        frames_dropped: frames without an answer, though a later frame has an answer or the runner was lost: dropped by
            the network, or skipped by a runner with a newer frame.
        packets_dropped: packets in these frames, or for robots without a runner: received by a radio, not by an agent.
        tx_status_dropped: transmit statuses in these frames, or for robots without a runner.
        now_ns: wall time at which the answer arrived; the caller sets it before `answer`.
    """

    def __init__(
        self,
        parts: list[Assignment],
        watchdog_s: float,
        timeout_s: float,
        on_loss: OnLoss,
        policy: JoinPolicy = DEFAULT_JOIN_POLICY,
        *,
        subtick: bool = False,
    ) -> None:
        """`subtick`: packets cross also within a tick."""
        super().__init__(parts, on_loss, policy)
        self.subtick = subtick
        rows = len(self._allocations.owner)
        self.rate_hz = parts[0].rate_hz
        self._watchdog_ns, self._timeout_ns = to_ns(watchdog_s), to_ns(timeout_s)
        self._pending_since_ns = np.full(rows, NO_PENDING, np.int64)  # simulated time of the oldest unanswered frame
        self._stopped = np.zeros(rows, np.bool_)
        self._drive, self._command = np.zeros(rows, np.bool_), np.zeros((3, rows))
        self._sent: list[SubtickPackets] = []
        self._frame_numbers = Counter[str]()  # number of the next "packets" frame to each runner
        self.now_ns = self._opened_ns = 0
        self._answers: list[Actions] = []
        self.late, self.watchdog_stops = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
        self.frames_dropped = self.packets_dropped = self.tx_status_dropped = 0

    def health(self) -> RunnerHealth:
        """Return the health of the runners."""
        return replace(
            super().health(),
            late_answers=int(self.late.sum()),
            frames_dropped=self.frames_dropped,
            watchdog_stops=int(self.watchdog_stops.sum()),
        )

    def open_tick(
        self,
        tick: int,
        now_ns: int,
        readings: Readings,
        received: ReceivedPackets,
        tx_status: TxStatuses = NO_TX_STATUSES,
    ) -> list[tuple[str, bytes]]:
        """Open a tick at wall time `now_ns`, without pauses: one frame for each runner that is ready."""
        self._tick, self._opened_ns = tick, now_ns
        start_ns = tick_start_ns(tick, self.rate_hz)
        parts = split_readings(readings, self._allocations.owner, self._allocations.assignments)
        received_parts = split_received(received, self._allocations.owner, len(self._allocations))
        status_parts = split_tx_status(tx_status, self._allocations.owner, len(self._allocations))
        out: list[tuple[str, bytes]] = []
        for allocation, part, part_received, part_status in zip(
            self._allocations, parts, received_parts, status_parts, strict=True
        ):
            grace_ns = to_ns(HOST_GRACE_S) if allocation.processes > 1 else 0
            if allocation.unanswered and now_ns - allocation.unanswered[0].sent_ns > self._timeout_ns + grace_ns:
                self._lose(allocation, f"no answer for {to_s(self._timeout_ns):g} s")
            if not part:  # none of its groups acts
                continue
            rows = acting_rows(part)
            if allocation.state == "ready" or self._on_loss not in NON_BLOCKING:
                self._pending_since_ns[rows[self._pending_since_ns[rows] == NO_PENDING]] = start_ns
            if allocation.state == "ready":
                allocation.unanswered.append(_SentFrame(tick, rows, part_received.receiver, part_status.row, now_ns))
                out.append((allocation.runner or "", encode_tick(tick, part, part_received, part_status)))
            elif allocation.state != "dead":
                self.packets_dropped += len(part_received)
                self.tx_status_dropped += len(part_status)
        return out

    def deliver(
        self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses
    ) -> list[tuple[str, bytes]]:
        """Return frames with packets and statuses for the robots of ready runners, at `at_ns` of simulated time."""
        received_parts = split_received(received, self._allocations.owner, len(self._allocations))
        status_parts = split_tx_status(tx_status, self._allocations.owner, len(self._allocations))
        out: list[tuple[str, bytes]] = []
        for allocation, part_received, part_status in zip(self._allocations, received_parts, status_parts, strict=True):
            if allocation.state == "ready" and (len(part_received) or len(part_status)):
                runner = allocation.runner or ""
                out.append(
                    (runner, encode_packets(tick, at_ns, self._frame_numbers[runner], part_received, part_status))
                )
                self._frame_numbers[runner] += 1
            elif allocation.state != "dead":
                self.packets_dropped += len(part_received)
                self.tx_status_dropped += len(part_status)
        return out

    def pop_sent(self) -> list[SubtickPackets]:
        """Remove and return the packets that arrived from runners; their `at_ns` is in the time of `now_ns`."""
        sent, self._sent = self._sent, []
        return sent

    def pop_actions(self) -> Actions:
        """Remove and return commands and packets, with zero commands for robots whose watchdog timed out."""
        waited_ns = tick_start_ns(self._tick, self.rate_hz) - self._pending_since_ns
        timed_out = (self._pending_since_ns != NO_PENDING) & (waited_ns >= self._watchdog_ns) & ~self._stopped
        self.watchdog_stops += timed_out
        self._stop(np.flatnonzero(timed_out))
        rows = np.arange(len(self._drive))
        linear_mps, angular_radps, lateral_mps = self._command
        sent = SentPackets.joined([packets.sent for packets in self.pop_sent()])
        tables = joined_tables(self._answers)
        # A robot with several answers keeps its latest note.
        _, from_end = np.unique(tables["notes"].rows[::-1], return_index=True)
        tables["notes"] = tables["notes"].select(len(tables["notes"]) - 1 - from_end)
        actions = Actions(rows, self._drive, linear_mps, angular_radps, lateral_mps, sent, **tables)
        self._drive, self._command, self._answers = np.zeros_like(self._drive), np.zeros_like(self._command), []
        return actions

    def _accept_actions(self, allocation: RealTimeAllocation, frame: Frame) -> None:
        sent_frame = next((sent_frame for sent_frame in allocation.unanswered if sent_frame.tick == frame.tick), None)
        if sent_frame is None:
            raise BadFrame("wrong_tick", str(frame.tick))
        # A host may omit robots whose processes are late, and send their answers later.
        rows = frames.checked_array(frame, "rows", "<i8", (None,))
        if len(np.unique(rows)) < len(rows) or not np.isin(rows, sent_frame.rows).all():
            raise BadFrame("malformed", "rows: expected the runner's own robots, each once")
        actions, allocation.memory = decode_actions(frame, rows), self._memory(allocation, frame)
        for older in [*allocation.unanswered]:
            if older is sent_frame:
                break
            self._count_dropped(older, rows)
            if not len(older.rows):
                allocation.unanswered.remove(older)
        sent_frame.rows = sent_frame.rows[~np.isin(sent_frame.rows, rows)]
        if not len(sent_frame.rows):
            allocation.unanswered.remove(sent_frame)
        self.late[rows] += frame.tick < self._tick
        self._pending_since_ns[rows], self._stopped[rows] = NO_PENDING, False
        commanded = actions.rows[actions.drive]
        self._drive[commanded] = True
        command: FloatArray = np.array((actions.linear_mps, actions.angular_radps, actions.lateral_mps))
        self._command[:, commanded] = command[:, actions.drive]
        self._sent.append(SubtickPackets(self.now_ns, frame.tick, actions.sent))
        self._answers.append(actions)

    def _accept_sent(self, allocation: RealTimeAllocation, frame: Frame) -> None:
        if not self.subtick:
            super()._accept_sent(allocation, frame)
        sent, missed = decode_sent(frame, allocation.all_rows), frame.values.get("missed", 0)
        self._sent.append(SubtickPackets(self.now_ns, None, sent))
        if type(missed) is int and missed > 0:
            self._counts["packets_frames_missed_by_runners"] += missed

    def _new_allocation(self, assignment: Assignment) -> RealTimeAllocation:
        return RealTimeAllocation(assignment, assignment.rows)

    def _catch_up(self, allocation: RealTimeAllocation) -> Sequence[bytes]:
        return ()  # the next tick is soon

    def _free(self, allocation: RealTimeAllocation, runner: str, event: RunnerEventKind, reason: str) -> None:
        super()._free(allocation, runner, event, reason)
        del self._frame_numbers[runner]
        for sent_frame in allocation.unanswered:
            self._count_dropped(sent_frame, sent_frame.rows)
        allocation.unanswered.clear()
        if self._on_loss in NON_BLOCKING:
            self._pending_since_ns[allocation.all_rows] = NO_PENDING  # without frames the watchdog never times out
        if allocation.state == "dead" or self._on_loss == "stand":
            self._stop(allocation.all_rows)

    def _split_off(self, allocation: RealTimeAllocation, rows: IntArray) -> RealTimeAllocation:
        for sent_frame in [*allocation.unanswered]:
            self._count_dropped(sent_frame, rows)
            if not len(sent_frame.rows):
                allocation.unanswered.remove(sent_frame)
        return super()._split_off(allocation, rows)

    def _process_restarted(self, allocation: RealTimeAllocation, frame: Frame) -> None:
        super()._process_restarted(allocation, frame)
        for sent_frame in allocation.unanswered:  # the new process gets as much time as the last
            sent_frame.sent_ns = self._opened_ns

    def _count_dropped(self, sent_frame: _SentFrame, rows: IntArray) -> None:
        """Count a frame as dropped by those of its robots that are in `rows`, and remove them from it."""
        is_dropped = np.isin(sent_frame.rows, rows)
        dropped = sent_frame.rows[is_dropped]
        if len(dropped):
            self.frames_dropped += 1
            self.packets_dropped += int(np.isin(sent_frame.receivers, dropped).sum())
            self.tx_status_dropped += int(np.isin(sent_frame.senders, dropped).sum())
            sent_frame.rows = sent_frame.rows[~is_dropped]

    def _stop(self, rows: IntArray) -> None:
        self._stopped[rows] = self._drive[rows] = True
        self._command[:, rows] = 0.0
