"""External inputs of a run: robots' actions that do not follow from scenario and seed, tick by tick.

In lockstep all actions follow from scenario and seed until a runner is lost, or a runner with other code joins. With
runners in real time no actions do, since they depend on when an answer comes. From the first such tick on, each tick's
actions are appended to `inputs/actions.frames`: a length of 4 bytes, little-endian, and an `actions` frame of the wire.
In real time with a sub-tick, where packets come in the middle of a tick, the frame also has the time of each packet,
and whether it waits for its robot's turn (`within`). The poses of live sources are in the actions; with a sub-tick the
frame has the times at which the radio medium got them, and their place among the packets (`within/poses`). Each frame
is one write, so that a killed run keeps all its ticks; a frame that is cut off at the end of the file is ignored.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.observe.interfaces import AgentBackend, SubtickMedium, SubtickPackets, TimedBackend
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import NOTHING_SET, Actions, Readings, SparseTable
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import checked_array
from swarmwire.comms.wire.tick_frames import decode_actions, encode_actions, sent_arrays, sent_of
from swarmwire.metrics.records.run_folder.layout import INPUTS

LENGTH_BYTES = 4
WITHIN = "within/"  # array of the packets that came within the tick; also the prefix of the packets' arrays
POSES_WITHIN = "within/poses"  # array of the poses that came within the tick, which are the last of the actions' poses


@dataclass(frozen=True)
class InputsRecord:
    """The recorded inputs of a run."""

    path: str  #: path within the run folder
    sha256: str  #: hash of the file
    first_tick: int  #: first recorded tick; actions before it follow from scenario and seed
    ticks: int  #: number of ticks from the first recorded one to the end of the run
    ticks_not_recorded: int  #: number of ticks that could not be written, as on a full disk


class PosesWithin(NamedTuple):
    """Poses of robots of live sources that came in the middle of a tick."""

    at_ns: int  # simulated time from which the radio medium used them
    packets: int  # number of batches of packets that came before them in the tick
    poses: SparseTable


class RecordedBackend:
    """A backend whose actions are recorded from the first tick on for which `is_external(tick)` is True."""

    def __init__(self, backend: AgentBackend | TimedBackend, folder: Path, is_external: Callable[[int], bool]) -> None:
        self._backend, self._path, self._is_external = backend, folder / INPUTS, is_external
        self._sha256 = hashlib.sha256()
        self._first_tick: int | None = None
        self._ticks = self._missed = 0
        self.start, self.counts, self.close = backend.start, backend.counts, backend.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of all robots in this tick."""
        actions = self._backend.act(tick, readings, received, tx_status)
        if self._first_tick is not None or self._is_external(tick):
            self._record(tick, actions, {})
        return actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Return the actions of a backend that sends packets itself."""
        recorded = _RecordedMedium(medium)
        actions = cast("TimedBackend", self._backend).act_in_time(tick, readings, received, tx_status, recorded)
        if self._first_tick is not None or self._is_external(tick):
            self._record(tick, actions, _packet_arrays(recorded.packets) | _pose_arrays(recorded.poses))
        return actions

    def record(self) -> InputsRecord | None:
        """Return the record; None without external inputs."""
        if self._first_tick is None:
            return None
        return InputsRecord(INPUTS, self._sha256.hexdigest(), self._first_tick, self._ticks, self._missed)

    def _record(self, tick: int, actions: Actions, within: dict[str, AnyArray]) -> None:
        if self._first_tick is None:
            self._first_tick = tick
        if self._missed:  # ticks after a gap cannot be replayed
            self._missed += 1
            return
        frame = encode_actions(tick, actions, extra=within)
        data = len(frame).to_bytes(LENGTH_BYTES, "little") + frame
        try:
            self._path.parent.mkdir(exist_ok=True)
            with self._path.open("ab", buffering=0) as file:
                is_written = file.write(data) == len(data)
        except OSError:
            is_written = False
        if is_written:
            self._ticks += 1
            self._sha256.update(data)
        else:  # the run continues without its record
            self._missed += 1


class RecordedInputs:
    """The recorded inputs of a run folder.

    Attributes:
        sha256: the hash of the complete frames.
        ticks: the number of recorded ticks.
        first_tick: the first recorded tick.
    """

    def __init__(self, path: Path) -> None:
        """Read the file; BadInput if it is not a record of inputs."""
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
        """The first tick after the record."""
        return self.first_tick + self.ticks

    def actions(self, tick: int, robots: int) -> Actions:
        """Return the actions of a recorded tick, with `robots` in all arenas; BadInput for a damaged file."""
        frame = self._frame(tick - self.first_tick)
        try:
            if frame.kind != "actions" or frame.tick != tick or "rows" not in frame.arrays:
                raise BadFrame("wrong_tick", f"{frame.kind} {frame.tick}")
            rows = frame.arrays["rows"]
            if ((rows < 0) | (rows >= robots)).any():
                raise BadFrame("malformed", f"rows: expected robots of {robots}")
            return decode_actions(frame, rows, placed=np.arange(robots))
        except BadFrame as fault:
            raise self._damaged(tick, fault) from None

    def first_poses(self, robots: int) -> SparseTable:
        """Return the poses of robots of live sources before tick 0: those of its actions that came not within it."""
        if self.first_tick != 0:
            return NOTHING_SET
        poses = self.actions(0, robots).poses
        return poses.select(np.arange(len(poses) - sum(len(part.poses) for part in self.poses_within(0, poses))))

    def poses_within(self, tick: int, poses: SparseTable) -> list["PosesWithin"]:
        """Return the parts of a tick's `poses` that came in the middle of it, in order; BadInput for a damaged file."""
        frame = self._frame(tick - self.first_tick)
        if POSES_WITHIN not in frame.arrays:
            return []
        try:
            at_ns, packets, count = checked_array(frame, POSES_WITHIN, "<i8", (3, None))
            end: IntArray = len(poses) - count.sum() + np.cumsum(count)
            if (count < 1).any() or count.sum() > len(poses) or (packets[1:] < packets[:-1]).any():
                raise BadFrame("malformed", "within/poses: expected poses in the order in which they came")
        except BadFrame as fault:
            raise self._damaged(tick, fault) from None
        return [
            PosesWithin(int(at_ns[i]), int(packets[i]), poses.select(np.arange(int(end[i] - count[i]), int(end[i]))))
            for i in range(len(count))
        ]

    def packets_within(self, tick: int, robots: int) -> list[SubtickPackets]:
        """Return the packets that came in the middle of a recorded tick, in order; BadInput for a damaged file."""
        frame = self._frame(tick - self.first_tick)
        if WITHIN not in frame.arrays:
            return []
        try:
            arrays = {
                name.removeprefix(WITHIN): array for name, array in frame.arrays.items() if name.startswith(WITHIN)
            }
            sent = sent_of(frames.Frame("sent", tick, arrays), np.arange(robots))
            at_ns, step_tick, count = checked_array(frame, WITHIN, "<i8", (3, None))
            end: IntArray = np.cumsum(count)
            if (count < 1).any() or (end[-1:] != len(sent)).any() or (at_ns[1:] < at_ns[:-1]).any():
                raise BadFrame("malformed", "within: expected packets in the order in which they came")
        except BadFrame as fault:
            raise self._damaged(tick, fault) from None
        return [
            SubtickPackets(
                int(at_ns[i]),
                None if step_tick[i] == NO_TICK else int(step_tick[i]),
                sent.select(np.arange(int(end[i] - count[i]), int(end[i]))),
            )
            for i in range(len(count))
        ]

    def _frame(self, index: int) -> frames.Frame:
        data = self._data[self._spans[index]]
        try:
            return frames.decode(data, len(data))
        except BadFrame as fault:
            raise self._damaged(index, fault) from None

    def _damaged(self, index: int, fault: BadFrame) -> BadInput:
        return BadInput(str(self._path), f"frame {index}", f"expected the actions of a tick: {fault}")


class ReplayedBackend:
    """A backend whose actions are those of agents until the first recorded tick, then those of the record."""

    def __init__(
        self,
        agents: AgentBackend,
        inputs: RecordedInputs,
        robots: int,
        rate_hz: int,
        set_first_poses: Callable[[SparseTable], None],
    ) -> None:
        """`robots` is the number in all arenas; `set_first_poses` places robots of live sources before tick 0."""
        self._agents, self._inputs, self._robots, self._rate_hz = agents, inputs, robots, rate_hz
        self._set_first_poses = set_first_poses
        self.counts, self.close = agents.counts, agents.close

    def start(self) -> None:
        """Start the agents, and place robots at their recorded first poses."""
        self._agents.start()
        self._set_first_poses(self._inputs.first_poses(self._robots))

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of all robots in this tick."""
        if tick < self._inputs.first_tick:
            return self._agents.act(tick, readings, received, tx_status)
        return self._inputs.actions(tick, self._robots)

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Return the recorded actions; send packets and set poses at their times. Receptions are in the record."""
        actions, sent = self._inputs.actions(tick, self._robots), 0
        packets = self._inputs.packets_within(tick, self._robots)
        for part in self._inputs.poses_within(tick, actions.poses):
            for batch in packets[sent : part.packets]:
                medium.send(batch)
            medium.set_poses(part.at_ns, part.poses)
            sent = part.packets
        for batch in packets[sent:]:
            medium.send(batch)
        medium.advance(tick_start_ns(tick + 1, self._rate_hz))  # the run does this also in its last tick
        return actions


class _RecordedMedium:
    """A medium, the packets that were sent on it, and the poses that it got."""

    def __init__(self, medium: SubtickMedium) -> None:
        self._medium = medium
        self.packets: list[SubtickPackets] = []
        self.poses: list[PosesWithin] = []
        self.advance = medium.advance

    def send(self, packets: SubtickPackets) -> None:
        """Send and record packets."""
        self._medium.send(packets)
        if len(packets.sent):
            self.packets.append(packets)

    def set_poses(self, at_ns: int, poses: SparseTable) -> None:
        """Set and record poses."""
        self._medium.set_poses(at_ns, poses)
        self.poses.append(PosesWithin(at_ns, len(self.packets), poses))


def _packet_arrays(batches: Sequence[SubtickPackets]) -> dict[str, AnyArray]:
    """Return packets that were sent within a tick as arrays of its frame; packets without a tick have `NO_TICK`."""
    if not batches:
        return {}
    rows = [(batch.at_ns, NO_TICK if batch.tick is None else batch.tick, len(batch.sent)) for batch in batches]
    packets = sent_arrays(SentPackets.joined([batch.sent for batch in batches]))
    return {WITHIN: np.array(rows).T.copy(), **{f"{WITHIN}{name}": array for name, array in packets.items()}}


def _pose_arrays(parts: Sequence[PosesWithin]) -> dict[str, AnyArray]:
    """Return the times of poses that came within a tick, which are the last of its actions' poses, as an array."""
    rows = [(part.at_ns, part.packets, len(part.poses)) for part in parts]
    return {POSES_WITHIN: np.array(rows).T.copy()} if rows else {}


def recorded_inputs(folder: Path) -> RecordedInputs | None:
    """Read the inputs of a run folder; None without external inputs."""
    path = folder / INPUTS
    inputs = RecordedInputs(path) if path.exists() else None
    return inputs if inputs is not None and inputs.ticks else None
