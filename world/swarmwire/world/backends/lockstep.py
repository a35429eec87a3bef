"""The lockstep handshake with runners, without any I/O: bytes and tokens in, bytes and actions out.

A tick opens with one frame to each runner of a group that acts. It is complete once all of them have answered. The
functions at the top split the readings, received packets and transmit statuses of a tick into one part per runner.
`Lockstep` runs the handshake. `allocation` has the states and moves of a runner, `registry` the rules for runners
that join or are lost and for frames that do not fit.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, Readings
from swarmwire.comms.wire.agent_memory import GroupMemory
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import decode_actions, encode_tick
from swarmwire.world.backends.allocation import NO_ALLOCATION, Allocation
from swarmwire.world.backends.join_policy import DEFAULT_JOIN_POLICY, JoinPolicy
from swarmwire.world.backends.registry import NON_BLOCKING, OnLoss, RunnerRegistry
from swarmwire.world.backends.runner_reports import RunnerEventKind


def split_readings(readings: Readings, owner: IntArray, assignments: list[Assignment]) -> list[Readings]:
    """Return the readings of each assignment's robots; `owner` (rows,) is the index of each row's assignment."""
    parts: list[Readings] = [{} for _ in assignments]
    for name, group in readings.items():
        owners = owner[group.rows]
        order = np.argsort(owners, kind="stable")
        bounds = np.searchsorted(owners[order], np.arange(len(assignments) + 1))
        rows = group.rows[order]
        fields = {field: column[order] for field, column in group.fields.items()}
        spans = zip(assignments, parts, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
        for assignment, part, start, stop in spans:
            # A group without acting robots is included: its agents must forget, as they would in a larger assignment.
            if name in [group.name for group in assignment.groups]:
                selected = {field: column[start:stop] for field, column in fields.items()}
                part[name] = GroupReadings(rows[start:stop], selected)
    return parts


def acting_rows(part: Readings) -> IntArray:
    """Return the robot rows that act in a part, group after group as in the answer."""
    if len(part) == 1:
        return next(iter(part.values())).rows
    return np.concatenate([np.empty(0, np.int64), *(group.rows for group in part.values())])


def split_received(received: ReceivedPackets, owner: IntArray, parts: int) -> list[ReceivedPackets]:
    """Return the received packets of each part, each payload once per part; `owner` (rows,) is each row's part."""
    if not len(received):
        return [received] * parts
    order, first_packet, payload, payload_rows, first_payload = _order_by_part(
        owner.take(received.receiver), parts, received.payload, len(received.payloads)
    )
    ordered, payloads = received.select(order), received.payloads.select(payload_rows)
    spans = zip(itertools.pairwise(first_packet.tolist()), itertools.pairwise(first_payload.tolist()), strict=True)
    return [
        ReceivedPackets(
            ordered.receiver[a:b],
            ordered.sender_index[a:b],
            ordered.sequence[a:b],
            ordered.received_at_ns[a:b],
            {name: column[a:b] for name, column in ordered.measured.items()},
            payload[a:b],
            payloads.span(p, q),
        )
        for (a, b), (p, q) in spans
    ]


@njit()
def _order_by_part(
    part: IntArray, parts: int, payload: IntArray, payloads: int
) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Order packets by part, and list the payloads of each part, without sorting.

    Args:
        part: (k,) part of each packet, 0 to parts - 1; negative: no part.
        parts: number of parts.
        payload: (k,) row of each packet's payload, 0 to payloads - 1.
        payloads: number of payloads.

    Returns:
        order: (h,) packets, part after part.
        first_packet: (parts + 1,) index in `order` of each part's first packet.
        part_payload: (h,) index of each packet's payload among the payloads of its part.
        payload_rows: (p,) payloads, part after part.
        first_payload: (parts + 1,) index in `payload_rows` of each part's first payload.
    """
    first_packet, first_payload = np.zeros(parts + 1, np.int64), np.zeros(parts + 1, np.int64)
    for p in part:
        if p >= 0:
            first_packet[p + 1] += 1
    for p in range(parts):
        first_packet[p + 1] += first_packet[p]
    order, end = np.empty(first_packet[parts], np.int64), first_packet.copy()
    for k in range(len(part)):
        if part[k] >= 0:
            order[end[part[k]]] = k
            end[part[k]] += 1
    part_payload, payload_rows, count = np.empty_like(order), np.empty_like(order), 0
    # The latest part with each payload, and the payload's index in that part.
    last_part, index = np.full(payloads, -1), np.empty(payloads, np.int64)
    for p in range(parts):
        first_payload[p] = count
        for i in range(first_packet[p], first_packet[p + 1]):
            row = payload[order[i]]
            if last_part[row] != p:
                last_part[row], index[row], payload_rows[count] = p, count - first_payload[p], row
                count += 1
            part_payload[i] = index[row]
    first_payload[parts] = count
    return order, first_packet, part_payload, payload_rows[:count], first_payload


def split_tx_status(tx_status: TxStatuses, owner: IntArray, parts: int) -> list[TxStatuses]:
    """Return the transmit statuses of each part; `owner` (rows,) is each row's part."""
    if not len(tx_status):
        return [NO_TX_STATUSES] * parts
    part_index = owner[tx_status.row]
    order = np.argsort(part_index, kind="stable")
    first = np.searchsorted(part_index[order], np.arange(parts + 1)).tolist()
    return [tx_status.select(order[a:b]) for a, b in itertools.pairwise(first)]


@dataclass(eq=False)
class LockstepAllocation(Allocation):
    """An allocation with its answer to the open tick."""

    actions: Actions | None = None  # the answer
    idle: bool = False  # True: no runner plays its robots in the open tick
    # Memory at the start of the open tick, by group.
    memory_at_start: dict[str, list[GroupMemory]] = field(default_factory=dict[str, list[GroupMemory]])


class _OpenTick(NamedTuple):
    """The inputs of all robots in the open tick."""

    tick: int
    readings: Readings
    received: ReceivedPackets
    tx_status: TxStatuses


class Lockstep(RunnerRegistry[LockstepAllocation]):
    """The runners of a run in lockstep.

    Where a run waits for lost runners, a replacement that joins within a tick gets a frame of that tick. The lost
    runner's answer to that tick is discarded, and its agents' memory is restored to the start of the tick. Where a run
    continues, the robots of a lost runner stand or coast from that tick on, until the first tick that opens with an
    agent.
    """

    def __init__(
        self, parts: list[Assignment], on_loss: OnLoss = "stop", policy: JoinPolicy = DEFAULT_JOIN_POLICY
    ) -> None:
        super().__init__(parts, on_loss, policy)
        self._open: _OpenTick | None = None

    def open_tick(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> list[tuple[str, bytes]]:
        """Open a tick: one frame for each runner of a group that acts; the others stay ready."""
        self._tick, self._open = tick, _OpenTick(tick, readings, received, tx_status)
        parts = split_readings(readings, self._allocations.owner, self._allocations.assignments)
        received_parts = split_received(received, self._allocations.owner, len(self._allocations))
        status_parts = split_tx_status(tx_status, self._allocations.owner, len(self._allocations))
        out: list[tuple[str, bytes]] = []
        for allocation, part, part_received, part_status in zip(
            self._allocations, parts, received_parts, status_parts, strict=True
        ):
            allocation.rows, allocation.actions = acting_rows(part), None
            allocation.idle = not allocation.allows("is asked")
            if allocation.state == "dead" or not part:
                continue
            if allocation.idle:
                if self._on_loss in NON_BLOCKING:  # otherwise the next runner gets the packets and statuses
                    self._count_undelivered(part_received, part_status)
                continue
            allocation.move("is asked")
            out.append((allocation.runner or "", encode_tick(tick, part, part_received, part_status)))
        return out

    def pop_actions(self) -> Actions:
        """Close a complete tick, and return the actions of all robots; without an agent they stand still or coast."""
        self._open = None
        zero = [
            zero_commands(allocation)
            for allocation in self._allocations
            if allocation.idle and self._on_loss != "coast"
        ]
        return Actions.joined(
            [allocation.actions for allocation in self._allocations if allocation.actions is not None] + zero
        )

    def _new_allocation(self, assignment: Assignment) -> LockstepAllocation:
        return LockstepAllocation(assignment, assignment.rows, idle=True)

    def _accept_actions(self, allocation: LockstepAllocation, frame: Frame) -> None:
        if frame.tick != self._tick or not allocation.allows("answers"):
            raise BadFrame("wrong_tick", str(frame.tick))
        actions, memory = decode_actions(frame, allocation.rows), self._memory(allocation, frame)
        allocation.actions, allocation.memory_at_start, allocation.memory = actions, allocation.memory, memory
        allocation.move("answers")

    def _catch_up(self, allocation: LockstepAllocation) -> Sequence[bytes]:
        if self._open is None or self._on_loss in NON_BLOCKING:
            return ()
        tick, readings, received, tx_status = self._open
        owner = np.full(len(self._allocations.owner), NO_ALLOCATION)
        owner[allocation.all_rows] = 0
        (part,) = split_readings(readings, owner, [allocation.assignment])
        allocation.rows, allocation.idle = acting_rows(part), False
        if not part:
            return ()
        allocation.move("is asked")
        return (
            encode_tick(tick, part, split_received(received, owner, 1)[0], split_tx_status(tx_status, owner, 1)[0]),
        )

    def _free(self, allocation: LockstepAllocation, runner: str, event: RunnerEventKind, reason: str) -> None:
        super()._free(allocation, runner, event, reason)
        if self._open is not None and allocation.actions is not None:
            allocation.memory = allocation.memory_at_start
        allocation.actions, allocation.idle = None, True

    def _split_off(self, allocation: LockstepAllocation, rows: IntArray) -> LockstepAllocation:
        actions, memory_at_start = allocation.actions, allocation.memory_at_start
        part = super()._split_off(allocation, rows)
        if self._open is not None and actions is not None:  # the lost robots' answer to this tick is discarded
            part.memory = _select_memory(memory_at_start, rows)
            allocation.actions = actions.for_rows(allocation.all_rows)
            allocation.memory_at_start = _select_memory(memory_at_start, allocation.all_rows)
        return part

    def _count_undelivered(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        for name, undelivered in (("packets_without_agent", received), ("tx_status_without_agent", tx_status)):
            if len(undelivered):
                self._counts[name] += len(undelivered)


def _select_memory(memory: dict[str, list[GroupMemory]], rows: IntArray) -> dict[str, list[GroupMemory]]:
    return {name: [part.for_rows(rows) for part in parts] for name, parts in memory.items()}


def zero_commands(allocation: Allocation) -> Actions:
    """Return zero commands for every robot of an allocation."""
    rows = allocation.all_rows
    zero = np.zeros(len(rows))
    return Actions(rows, np.ones(len(rows), np.bool_), zero, zero, zero)
