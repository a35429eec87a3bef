"""What came into a run from outside: its robots' actions, tick by tick, where scenario and seed do not give them.

In lockstep all actions follow from scenario and seed until a runner is lost, or one comes with code of its own. With
runners in real time none do: it matters when an answer comes. From the first such tick on, each tick's actions are
appended to `inputs/actions.frames`: a length of 4 bytes, little-endian, and an `actions` frame of the wire. In real
time with a subtick, where packets come in the middle of a tick, its frame also holds when each came and whether it
waits for its robot's turn (`within`). Each goes to the system in one write, so that a run that is killed keeps all its
ticks; a frame that is cut off at the end of the file is passed over.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.observe.interfaces import AgentBackend, SubtickMedium, SubtickPackets, TimedBackend
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import checked_array
from swarmwire.comms.wire.tick_frames import decode_actions, encode_actions, sent_arrays, sent_of
from swarmwire.metrics.records.run_folder.layout import INPUTS

LENGTH_BYTES = 4
WITHIN = "within/"  # name of the array of what came within the tick, and of its packets' arrays before their names
AT_ONCE = -1  # in place of a tick: packets that waited for nobody's turn


@dataclass(frozen=True)
class InputsRecord:
    """The recorded inputs of a run."""

    path: str  # within the run folder
    sha256: str  # of the file
    first_tick: int  # before it, all follows from scenario and seed
    ticks: int  # from there to the end of the run
    ticks_not_recorded: int  # the disk was full, or the like


class RecordedBackend:
    """A backend whose actions are recorded from the first tick on at which `outside(tick)` holds."""

    def __init__(self, backend: AgentBackend | TimedBackend, folder: Path, outside: Callable[[int], bool]) -> None:
        self._backend, self._path, self._outside = backend, folder / INPUTS, outside
        self._sha256 = hashlib.sha256()
        self._first_tick: int | None = None
        self._ticks = self._missed = 0
        self.start, self.counts, self.close = backend.start, backend.counts, backend.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What every robot does in this tick."""
        actions = self._backend.act(tick, readings, received, tx_status)
        if self._first_tick is not None or self._outside(tick):
            self._record(tick, actions, {})
        return actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """The same of a backend that puts packets on air itself."""
        noted = _Noted(medium)
        actions = cast("TimedBackend", self._backend).act_in_time(tick, readings, received, tx_status, noted)
        if self._first_tick is not None or self._outside(tick):
            self._record(tick, actions, _puts_arrays(noted.puts))
        return actions

    def record(self) -> InputsRecord | None:
        """What was recorded; None if nothing came from outside."""
        if self._first_tick is None:
            return None
        return InputsRecord(INPUTS, self._sha256.hexdigest(), self._first_tick, self._ticks, self._missed)

    def _record(self, tick: int, actions: Actions, within: dict[str, AnyArray]) -> None:
        if self._first_tick is None:
            self._first_tick = tick
        if self._missed:  # after a gap nothing can be replayed
            self._missed += 1
            return
        frame = encode_actions(tick, actions, extra=within)
        data = len(frame).to_bytes(LENGTH_BYTES, "little") + frame
        try:
            self._path.parent.mkdir(exist_ok=True)
            with self._path.open("ab", buffering=0) as file:
                whole = file.write(data) == len(data)
        except OSError:
            whole = False
        if whole:
            self._ticks += 1
            self._sha256.update(data)
        else:  # the run is worth more than its record
            self._missed += 1


class RecordedInputs:
    """The recorded inputs of a run folder.

    Attributes:
        sha256: of the whole frames.
        ticks: how many there are.
        first_tick: the tick of the first.
    """

    def __init__(self, path: Path) -> None:
        """Read the file; BadInput if it is none of ours."""
        self._path = path
        try:
            self._data = path.read_bytes()
        except OSError as error:
            raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
        self._spans: list[slice] = []
        start = 0
        while (body := start + LENGTH_BYTES) <= len(self._data):
            stop = body + int.from_bytes(self._data[start:body], "little")
            if stop > len(self._data):
                break
            self._spans.append(slice(body, stop))
            start = stop
        self.sha256 = hashlib.sha256(self._data[:start]).hexdigest()
        self.ticks = len(self._spans)
        self.first_tick = self._frame(0).tick if self._spans else 0

    @property
    def end_tick(self) -> int:
        """The first tick after those recorded."""
        return self.first_tick + self.ticks

    def actions(self, tick: int, robots: int) -> Actions:
        """What the robots, so many in all arenas, did in a recorded tick; BadInput if the file does not say."""
        frame = self._frame(tick - self.first_tick)
        try:
            if frame.kind != "actions" or frame.tick != tick or "rows" not in frame.arrays:
                raise BadFrame("wrong_tick", f"{frame.kind} {frame.tick}")
            rows = frame.arrays["rows"]
            if ((rows < 0) | (rows >= robots)).any():
                raise BadFrame("malformed", f"rows: expected robots of {robots}")
            return decode_actions(frame, rows)
        except BadFrame as fault:
            raise self._damaged(tick, fault) from None

    def puts(self, tick: int, robots: int) -> list[SubtickPackets]:
        """Packets that came in the middle of a recorded tick, in order; BadInput if the file does not say."""
        frame = self._frame(tick - self.first_tick)
        if WITHIN not in frame.arrays:
            return []
        try:
            named = ((name, array) for name, array in frame.arrays.items() if name.startswith(WITHIN))
            arrays = {name.removeprefix(WITHIN): array for name, array in named}
            sent = sent_of(frames.Frame("sent", tick, arrays), np.arange(robots))
            at_ns, of_tick, count = checked_array(frame, WITHIN, "<i8", (3, None))
            end: IntArray = np.cumsum(count)
            if (count < 1).any() or (end[-1:] != len(sent)).any() or (at_ns[1:] < at_ns[:-1]).any():
                raise BadFrame("malformed", "within: expected packets in the order in which they came")
        except BadFrame as fault:
            raise self._damaged(tick, fault) from None
        return [
            SubtickPackets(
                int(at_ns[i]),
                None if of_tick[i] == AT_ONCE else int(of_tick[i]),
                sent.select(np.arange(int(end[i] - count[i]), int(end[i]))),
            )
            for i in range(len(count))
        ]

    def _frame(self, place: int) -> frames.Frame:
        data = self._data[self._spans[place]]
        try:
            return frames.decode(data, len(data))
        except BadFrame as fault:
            raise self._damaged(place, fault) from None

    def _damaged(self, place: int, fault: BadFrame) -> BadInput:
        return BadInput(str(self._path), f"frame {place}", f"expected the actions of a tick: {fault}")


class ReplayedBackend:
    """A backend whose agents act until the first recorded tick; from there on the record does."""

    def __init__(self, agents: AgentBackend, inputs: RecordedInputs, robots: int, rate_hz: int) -> None:
        """`robots` in all arenas."""
        self._agents, self._inputs, self._robots, self._rate_hz = agents, inputs, robots, rate_hz
        self.start, self.counts, self.close = agents.start, agents.counts, agents.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What every robot does in this tick, or did."""
        if tick < self._inputs.first_tick:
            return self._agents.act(tick, readings, received, tx_status)
        return self._inputs.actions(tick, self._robots)

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """What every robot did; packets are sent when they were. None is received: receptions are in the record."""
        for put in self._inputs.puts(tick, self._robots):
            medium.send(put)
        medium.advance(tick_start_ns(tick + 1, self._rate_hz))  # as far as in the run, if this is its last tick
        return self._inputs.actions(tick, self._robots)


class _Noted:
    """a medium, and what is put on it."""

    def __init__(self, medium: SubtickMedium) -> None:
        self._medium = medium
        self.puts: list[SubtickPackets] = []
        self.advance = medium.advance

    def send(self, packets: SubtickPackets) -> None:
        """Take packets."""
        self._medium.send(packets)
        if len(packets.sent):
            self.puts.append(packets)


def _puts_arrays(puts: Sequence[SubtickPackets]) -> dict[str, AnyArray]:
    """What was put on air within a tick, as arrays of its frame."""
    if not puts:
        return {}
    rows = [(put.at_ns, AT_ONCE if put.tick is None else put.tick, len(put.sent)) for put in puts]
    packets = sent_arrays(SentPackets.joined([put.sent for put in puts]))
    return {WITHIN: np.array(rows).T.copy(), **{f"{WITHIN}{name}": array for name, array in packets.items()}}


def recorded_inputs(folder: Path) -> RecordedInputs | None:
    """The inputs of a run folder; None if nothing came from outside."""
    path = folder / INPUTS
    inputs = RecordedInputs(path) if path.exists() else None
    return inputs if inputs is not None and inputs.ticks else None
