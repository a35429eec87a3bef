"""Runners in real time, without any I/O: frames go out at each tick's start, answers count when they come.

    tick      open_tick     a frame for each ready runner of a group that acts, whether or not it has answered the last
              "actions"     if newer than any before: commands apply at once, its packets go to the medium at once;
                            every older frame without an answer was dropped
              take          commands that came since the last take; a robot asked `watchdog_s` ago or longer, with no
                            answer since, stops; any answer lets it go on
    time      open_tick     no answer to any frame for `timeout_s`: the runner is lost

An answer that came after its own tick is late. "At once" is the tick that is open then: its packets are handed to the
air with those of that tick, so they are sent at that tick's start plus their robot's phase and jitter.

With a subtick packets cross also between these: `packets` frames go out, and "sent" frames come, whenever there are
any. Then `puts` gives, many times in a tick, what came to be sent, and when; `take` has none left.

    subtick   hand_over     a frame "packets" to each ready runner some of whose robots received something
              "sent"        its packets go to the medium at once
              "actions"     as above, but its packets wait for their robots' turn only

How runners join and are lost stands in `roster`, and so does what becomes of frames that do not fit.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import tick_start_ns, to_ns, to_s
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.interfaces import SubtickPackets
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, ActuatorCommands, LedChanges, Notes, Readings, Values
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import decode_actions, decode_sent, encode_packets, encode_tick
from swarmwire.world.backends.allocation import Allocation, rows_of
from swarmwire.world.backends.join_policy import USUAL, JoinPolicy
from swarmwire.world.backends.lockstep import acting, split_readings, split_received, split_tx_status
from swarmwire.world.backends.registry import GOES_ON, OnLoss, RunnerHealth, RunnerRegistry, What

ANSWERED = -1


class _Asked(NamedTuple):
    """A frame that went out."""

    tick: int
    rows: IntArray  # (n,) in the order of the answer
    packets: int  # received, that it carried
    tx_status: int  # of packets sent
    at_ns: int  # wall time, pauses left out


@dataclass(eq=False)
class _Slot(Allocation):
    asked: deque[_Asked] = field(default_factory=deque[_Asked])  # without an answer so far, oldest first


class RealTime(RunnerRegistry[_Slot]):
    """The runners of a run that waits for none of them.

    Attributes:
        late: (rows,) answers that came after their own tick.
        watchdog_stops: (rows,) times that the watchdog stopped a robot.
        frames_dropped: frames to runners that were never answered though a later one was, or that were still out when
            their runner was lost: dropped by the network, or passed over by a runner that had a newer one.
        packets_dropped: packets in them, or for robots without a runner: received by a radio, never by an agent.
        tx_status_dropped: tx statuses in them, or for such robots: known to a radio, never to its agent.
        now_ns: wall time at which what is answered arrived; set by whoever hands it in.
    """

    def __init__(
        self,
        parts: list[Assignment],
        watchdog_s: float,
        timeout_s: float,
        on_loss: OnLoss,
        terms: JoinPolicy = USUAL,
        *,
        subtick: bool = False,
    ) -> None:
        """`subtick`: packets cross also between ticks."""
        super().__init__(parts, on_loss, terms)
        self.subtick = subtick
        rows = len(self._slots.owner)
        self._rate_hz = parts[0].rate_hz
        self._watchdog_ns, self._timeout_ns = to_ns(watchdog_s), to_ns(timeout_s)
        self._asked_ns = np.full(rows, ANSWERED, np.int64)  # simulated time of the first question without an answer
        self._stopped = np.zeros(rows, np.bool_)
        self._drive, self._command = np.zeros(rows, np.bool_), np.zeros((3, rows))
        self._sent: list[SubtickPackets] = []
        self._numbers = Counter[str]()  # of "packets" frames to each runner
        self.now_ns = 0
        self._notes: list[Notes] = []
        self._leds: list[LedChanges] = []
        self._own: list[ActuatorCommands] = []
        self._values: list[Values] = []
        self.late, self.watchdog_stops = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
        self.frames_dropped = self.packets_dropped = self.tx_status_dropped = 0

    def health(self) -> RunnerHealth:
        """How the runners are doing."""
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
        """Begin a tick at wall time `now_ns`, pauses left out: one frame for each runner that is ready."""
        self._tick = tick
        start_ns = tick_start_ns(tick, self._rate_hz)
        parts = split_readings(readings, self._slots.owner, self._slots.assignments)
        packets = split_received(received, self._slots.owner, len(self._slots))
        told = split_tx_status(tx_status, self._slots.owner, len(self._slots))
        out: list[tuple[str, bytes]] = []
        for slot, part, own, its in zip(self._slots, parts, packets, told, strict=True):
            if slot.asked and now_ns - slot.asked[0].at_ns > self._timeout_ns:
                self._lose(slot, f"no answer for {to_s(self._timeout_ns):g} s")
            if not part:  # none of its groups acts
                continue
            rows = acting(part)
            if slot.state == "ready" or self._on_loss not in GOES_ON:
                self._asked_ns[rows[self._asked_ns[rows] == ANSWERED]] = start_ns
            if slot.state == "ready":
                slot.asked.append(_Asked(tick, rows, len(own), len(its), now_ns))
                out.append((slot.runner or "", encode_tick(tick, part, own, its)))
            elif slot.state != "dead":
                self.packets_dropped += len(own)
                self.tx_status_dropped += len(its)
        return out

    def hand_over(
        self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses
    ) -> list[tuple[str, bytes]]:
        """Frames to runners that are ready, at `at_ns` of simulated time, with what robots were told since the last."""
        packets = split_received(received, self._slots.owner, len(self._slots))
        told = split_tx_status(tx_status, self._slots.owner, len(self._slots))
        out: list[tuple[str, bytes]] = []
        for slot, own, its in zip(self._slots, packets, told, strict=True):
            if slot.state == "ready" and (len(own) or len(its)):
                runner = slot.runner or ""
                out.append((runner, encode_packets(tick, at_ns, self._numbers[runner], own, its)))
                self._numbers[runner] += 1
            elif slot.state != "dead":
                self.packets_dropped += len(own)
                self.tx_status_dropped += len(its)
        return out

    def puts(self) -> list[SubtickPackets]:
        """Packets that came since the last call, `at_ns` in the time of `now_ns`."""
        puts, self._sent = self._sent, []
        return puts

    def take(self) -> Actions:
        """Commands and packets that came since the last take, and command 0 for robots whose watchdog ran out."""
        waited_ns = tick_start_ns(self._tick, self._rate_hz) - self._asked_ns
        overdue = (self._asked_ns != ANSWERED) & (waited_ns >= self._watchdog_ns) & ~self._stopped
        self.watchdog_stops += overdue
        self._stop(np.flatnonzero(overdue))
        rows = np.arange(len(self._drive))
        linear_mps, angular_radps, lateral_mps = self._command
        sent, notes = SentPackets.joined([put.sent for put in self.puts()]), self._latest_notes()
        leds, own, told = LedChanges.joined(self._leds), ActuatorCommands.joined(self._own), Values.joined(self._values)
        actions = Actions(rows, self._drive, linear_mps, angular_radps, lateral_mps, sent, notes, leds, own, told)
        self._drive, self._command = np.zeros_like(self._drive), np.zeros_like(self._command)
        self._notes, self._leds, self._own, self._values = [], [], [], []
        return actions

    def _acted(self, slot: _Slot, frame: Frame) -> None:
        asked = next((asked for asked in slot.asked if asked.tick == frame.tick), None)
        if asked is None:
            raise BadFrame("wrong_tick", str(frame.tick))
        actions, slot.memory = decode_actions(frame, asked.rows), self._memory(slot, frame)
        while slot.asked[0] is not asked:
            self._drop(slot.asked.popleft())
        slot.asked.popleft()
        self.late[asked.rows] += frame.tick < self._tick
        self._asked_ns[asked.rows], self._stopped[asked.rows] = ANSWERED, False
        given = actions.rows[actions.drive]
        self._drive[given] = True
        command: FloatArray = np.array((actions.linear_mps, actions.angular_radps, actions.lateral_mps))
        self._command[:, given] = command[:, actions.drive]
        self._sent.append(SubtickPackets(self.now_ns, frame.tick, actions.sent))
        self._notes.append(actions.notes)
        self._leds.append(actions.leds)
        self._own.append(actions.own)
        self._values.append(actions.values)

    def _sent_between(self, slot: _Slot, frame: Frame) -> None:
        if not self.subtick:
            super()._sent_between(slot, frame)
        sent, missed = decode_sent(frame, slot.all_rows), frame.values.get("missed", 0)
        self._sent.append(SubtickPackets(self.now_ns, None, sent))
        if type(missed) is int and missed > 0:
            self._counts["packets_frames_missed_by_runners"] += missed

    def _slot(self, assignment: Assignment) -> _Slot:
        return _Slot(assignment, rows_of(assignment))

    def _catch_up(self, slot: _Slot) -> Sequence[bytes]:
        return ()  # the next tick is soon

    def _free(self, slot: _Slot, runner: str, what: What, reason: str) -> None:
        super()._free(slot, runner, what, reason)
        del self._numbers[runner]
        while slot.asked:
            self._drop(slot.asked.popleft())
        if self._on_loss in GOES_ON:
            self._asked_ns[slot.all_rows] = ANSWERED  # nobody is asked any more: the watchdog has nothing to watch
        if slot.state == "dead" or self._on_loss == "stand":
            self._stop(slot.all_rows)

    def _latest_notes(self) -> Notes:
        """Of a robot that answered more than once since the last take, what it named last."""
        notes = Notes.joined(self._notes)
        _, back = np.unique(notes.rows[::-1], return_index=True)
        last = len(notes) - 1 - back
        return Notes(notes.rows[last], notes.code[last], notes.names)

    def _drop(self, asked: _Asked) -> None:
        self.frames_dropped += 1
        self.packets_dropped += asked.packets
        self.tx_status_dropped += asked.tx_status

    def _stop(self, rows: IntArray) -> None:
        self._stopped[rows] = self._drive[rows] = True
        self._command[:, rows] = 0.0
