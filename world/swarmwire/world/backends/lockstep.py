"""What all robots sense and received, cut into one part for each runner."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, GroupReadings, Readings
from swarmwire.comms.wire.agent_memory import GroupMemory
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import decode_actions, encode_tick
from swarmwire.world.backends.allocation import NOBODY, Allocation, rows_of
from swarmwire.world.backends.join_policy import USUAL, JoinPolicy
from swarmwire.world.backends.registry import GOES_ON, OnLoss, RunnerRegistry, What


def split_readings(readings: Readings, owner: IntArray, assignments: list[Assignment]) -> list[Readings]:
    """What the robots of each assignment sense; `owner` (rows,) names the assignment of each robot row."""
    parts: list[Readings] = [{} for _ in assignments]
    for name, group in readings.items():
        owners = owner[group.rows]
        order = np.argsort(owners, kind="stable")
        bounds = np.searchsorted(owners[order], np.arange(len(assignments) + 1))
        rows = group.rows[order]
        fields = {field: column[order] for field, column in group.fields.items()}
        spans = zip(assignments, parts, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
        for assignment, part, first, last in spans:
            # Also a group none of whose robots acts now: their agents must forget, as they do beside others.
            if name in [group.name for group in assignment.groups]:
                own = {field: column[first:last] for field, column in fields.items()}
                part[name] = GroupReadings(rows[first:last], own)
    return parts


def acting(part: Readings) -> IntArray:
    """The robot rows of a part, group after group: the order of the answer."""
    if len(part) == 1:
        return next(iter(part.values())).rows
    return np.concatenate([np.empty(0, np.int64), *(group.rows for group in part.values())])


def split_received(received: ReceivedPackets, owner: IntArray, slots: int) -> list[ReceivedPackets]:
    """What the robots of each of `slots` parts received, each with its payloads, once; `owner` is (rows,)."""
    if not len(received):
        return [received] * slots
    by_slot = np.argsort(owner[received.receiver], kind="stable")
    slot_of = owner[received.receiver[by_slot]]
    sorted_received = received.select(by_slot)
    packets = len(received.payloads)
    wanted, place = np.unique(slot_of * packets + sorted_received.payload, return_inverse=True)
    payloads = received.payloads.rows(wanted % packets)
    first_row = np.searchsorted(slot_of, np.arange(slots + 1)).tolist()
    first_payload = np.searchsorted(wanted // packets, np.arange(slots + 1)).tolist()
    place = place.reshape(-1)
    return [
        ReceivedPackets(
            sorted_received.receiver[a:b],
            sorted_received.sender[a:b],
            sorted_received.sequence[a:b],
            sorted_received.received_at_ns[a:b],
            {name: column[a:b] for name, column in sorted_received.given.items()},
            place[a:b] - p,
            payloads.span(p, q),
        )
        for a, b, p, q in zip(first_row[:-1], first_row[1:], first_payload[:-1], first_payload[1:], strict=True)
    ]


def split_tx_status(tx_status: TxStatuses, owner: IntArray, slots: int) -> list[TxStatuses]:
    """What the robots of each of `slots` parts learn of their packets; `owner` is (rows,)."""
    if not len(tx_status):
        return [NO_TX_STATUSES] * slots
    slot_of = owner[tx_status.row]
    by_slot = np.argsort(slot_of, kind="stable")
    first = np.searchsorted(slot_of[by_slot], np.arange(slots + 1)).tolist()
    return [tx_status.select(by_slot[a:b]) for a, b in itertools.pairwise(first)]


# --- The lockstep hand-shake with runners, without any I/O: bytes and tokens in, bytes and actions out.
#
# A tick opens with one frame to each runner of a group that acts, and is complete once all of them have answered. Where
# the run waits for lost runners, who takes over within a tick gets a frame of it; what the lost one answered in that
# tick counts no more, and its agents' memory is that from before. Where the run goes on, its robots stand or coast from
# that tick on until the first tick that opens with an agent. States and moves stand in `slot`; how runners join and are
# lost, and what becomes of frames that do not fit, in `roster`.


@dataclass(eq=False)
class _Slot(Allocation):
    actions: Actions | None = None  # in the open tick
    idle: bool = False  # whether its robots have no agent in the open tick
    before: dict[str, list[GroupMemory]] = field(default_factory=dict[str, list[GroupMemory]])  # memory, at its start


class _Open(NamedTuple):
    """What the tick that is open brings to all robots."""

    tick: int
    readings: Readings
    received: ReceivedPackets
    tx_status: TxStatuses


class Lockstep(RunnerRegistry[_Slot]):
    """The runners of a run: who plays which robots, and how far each has come."""

    def __init__(self, parts: list[Assignment], on_loss: OnLoss = "stop", terms: JoinPolicy = USUAL) -> None:
        super().__init__(parts, on_loss, terms)
        self._open: _Open | None = None

    def open_tick(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> list[tuple[str, bytes]]:
        """Begin a tick: one frame for each runner of a group that acts; the others stay ready."""
        self._tick, self._open = tick, _Open(tick, readings, received, tx_status)
        parts = split_readings(readings, self._slots.owner, self._slots.assignments)
        packets = split_received(received, self._slots.owner, len(self._slots))
        told = split_tx_status(tx_status, self._slots.owner, len(self._slots))
        out: list[tuple[str, bytes]] = []
        for slot, part, own, its in zip(self._slots, parts, packets, told, strict=True):
            slot.rows, slot.actions, slot.idle = acting(part), None, not slot.may("is asked")
            if slot.state == "dead" or not part:
                continue
            if slot.idle:
                if self._on_loss in GOES_ON:  # else whoever is waited for gets it all
                    self._to_nobody(own, its)
                continue
            slot.move("is asked")
            out.append((slot.runner or "", encode_tick(tick, part, own, its)))
        return out

    def take(self) -> Actions:
        """The actions of all robots, once the tick is complete; without an agent they stand still, or coast."""
        self._open = None
        still = [standing(slot) for slot in self._slots if slot.idle and self._on_loss != "coast"]
        return Actions.joined([slot.actions for slot in self._slots if slot.actions is not None] + still)

    def _slot(self, assignment: Assignment) -> _Slot:
        return _Slot(assignment, rows_of(assignment), idle=True)

    def _acted(self, slot: _Slot, frame: Frame) -> None:
        if frame.tick != self._tick or not slot.may("answers"):
            raise BadFrame("wrong_tick", str(frame.tick))
        actions, memory = decode_actions(frame, slot.rows), self._memory(slot, frame)
        slot.actions, slot.before, slot.memory = actions, slot.memory, memory
        slot.move("answers")

    def _catch_up(self, slot: _Slot) -> Sequence[bytes]:
        if self._open is None or self._on_loss in GOES_ON:
            return ()
        tick, readings, received, tx_status = self._open
        own = np.full(len(self._slots.owner), NOBODY)
        own[slot.all_rows] = 0
        (part,) = split_readings(readings, own, [slot.assignment])
        slot.rows, slot.idle = acting(part), False
        if not part:
            return ()
        slot.move("is asked")
        return (encode_tick(tick, part, split_received(received, own, 1)[0], split_tx_status(tx_status, own, 1)[0]),)

    def _free(self, slot: _Slot, runner: str, what: What, reason: str) -> None:
        super()._free(slot, runner, what, reason)
        if self._open is not None and slot.actions is not None:
            slot.memory = slot.before
        slot.actions, slot.idle = None, True

    def _to_nobody(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        for name, some in (("packets_without_agent", received), ("tx_status_without_agent", tx_status)):
            if len(some):
                self._counts[name] += len(some)


def standing(slot: Allocation) -> Actions:
    """Command 0 for every robot of a slot."""
    rows = slot.all_rows
    still = np.zeros(len(rows))
    return Actions(rows, np.ones(len(rows), np.bool_), still, still, still)
