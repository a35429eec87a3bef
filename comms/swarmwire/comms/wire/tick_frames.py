"""Frames of a tick between world and runners, checked on arrival.

A `tick` frame carries readings, received packets and tx statuses to a runner, an `actions` frame carries the actions
back. In real time with a sub-tick, `packets` and `sent` frames carry packets in the middle of a tick.
"""

from collections.abc import Mapping, Set
from dataclasses import replace
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.robot.bodies.drives import BRIGHTEST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxResult, TxStatuses
from swarmwire.comms.robot.tick_io import (
    MAX_STATES,
    NOTHING_SET,
    TABLES,
    Actions,
    GroupReadings,
    Readings,
    SparseTable,
    checked_state,
)
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemories, memory_arrays
from swarmwire.comms.wire.frames import Frame, checked_array

RECEIVED_COLUMNS = ("receiver", "sender_index", "sequence", "received_at_ns", "payload")  # rows of received/numbers
NO_EXTRA_ARRAYS: Mapping[str, AnyArray] = MappingProxyType({})
POSES, POSE_SLOTS = "poses", 4  # the table of poses, and its slots: x, y, z, heading


def encode_tick(tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> bytes:
    """Encode a `tick` frame: the readings, received packets and tx statuses of a runner's robots."""
    arrays: dict[str, AnyArray] = {}
    for name, group in readings.items():
        arrays[f"readings/{name}/rows"] = group.rows
        for sensor, column in group.fields.items():
            arrays[f"readings/{name}/{sensor}"] = column
    return frames.encode("tick", tick, arrays | result_arrays(received, tx_status))


def result_arrays(received: ReceivedPackets, tx_status: TxStatuses) -> dict[str, AnyArray]:
    """Return received packets and tx statuses as arrays of a frame."""
    arrays: dict[str, AnyArray] = {}
    if len(received):
        # A row of the array is a column of the table, which is thus contiguous after decoding.
        arrays["received/numbers"] = np.array([getattr(received, name) for name in RECEIVED_COLUMNS])
        measured = np.array(list(received.measured.values()))
        arrays["received/given"] = measured.reshape(len(received.measured), len(received))
        arrays["received/data"] = received.payloads.data
        arrays["received/offset"] = received.payloads.offset
    if len(tx_status):
        arrays["tx_status"] = np.array((tx_status.row, tx_status.id, tx_status.result))
    return arrays


def decode_tick(
    frame: Frame, measures: tuple[str, ...], groups: Set[str]
) -> tuple[Readings, ReceivedPackets, TxStatuses]:
    """Decode a frame by `encode_tick`; BadFrame if it has no readings, or readings of other groups than `groups`.

    `check_rows` checks the robots of the readings and the receivers.
    """
    arrays: dict[str, dict[str, AnyArray]] = {}
    try:
        for key, array in frame.arrays.items():
            if key.startswith("readings/"):
                _, name, sensor = key.split("/", 2)
                arrays.setdefault(name, {})[sensor] = array
        readings = {name: GroupReadings(fields.pop("rows"), fields) for name, fields in arrays.items()}
        if not readings or not readings.keys() <= groups:
            raise BadFrame("malformed", "readings: expected groups of this runner")
        return readings, *results_of(frame, measures)
    except (KeyError, ValueError) as error:
        raise BadFrame("malformed", f"an array is missing or of the wrong shape: {error}") from error


def check_rows(readings: Readings, received: ReceivedPackets, rows: Mapping[str, IntArray]) -> None:
    """Raise BadFrame unless readings are numbers of robots in the `rows` of their group, and receivers of any group."""
    for name, group in readings.items():
        index, n = group.rows, len(group.rows)
        if (
            index.ndim != 1
            or index.dtype != np.int64
            or np.count_nonzero(index[1:] <= index[:-1])
            or not _are_among(index, rows[name])
        ):
            raise BadFrame("malformed", f"readings/{name}/rows: expected robots of this runner, rising")
        for sensor, column in group.fields.items():
            if column.dtype != np.float64 or len(column) != n:
                raise BadFrame("malformed", f"readings/{name}/{sensor}: expected numbers of {n} robots")
    if len(received):
        last = max(int(group_rows[-1]) for group_rows in rows.values() if len(group_rows))
        if received.receiver[0] < 0 or received.receiver[-1] > last:
            raise BadFrame("malformed", "received/numbers: expected packets of robots of this runner")


def results_of(frame: Frame, measures: tuple[str, ...]) -> tuple[ReceivedPackets, TxStatuses]:
    """Decode the arrays of `result_arrays`; KeyError, ValueError or BadFrame if the frame does not hold them."""
    return _received(frame, measures), _tx_status(frame)


def _received(frame: Frame, measures: tuple[str, ...]) -> ReceivedPackets:
    if "received/numbers" not in frame.arrays:
        return ReceivedPackets.none(measures)
    numbers = checked_array(frame, "received/numbers", "<i8", (5, None))
    receiver, sender_index, sequence, received_at_ns, payload = numbers
    columns = checked_array(frame, "received/given", "<f8", (len(measures), numbers.shape[1]))
    measured = dict(zip(measures, columns, strict=True))
    data, offset = checked_array(frame, "received/data", "|u1", (None,)), frame.arrays["received/offset"]
    if not _rises_to(offset, len(data)):
        raise BadFrame("malformed", "received/offset: expected rising offsets into received/data")
    if np.count_nonzero((payload < 0) | (payload >= len(offset) - 1)) or np.count_nonzero(receiver[1:] < receiver[:-1]):
        raise BadFrame("malformed", "received/numbers: expected rows of the payloads, and rising receivers")
    return ReceivedPackets(receiver, sender_index, sequence, received_at_ns, measured, payload, Payloads(data, offset))


def _rises_to(offset: AnyArray, end: int) -> bool:
    """Return True if `offset` holds valid offsets of payloads of `end` bytes in total."""
    if offset.dtype != np.int64 or offset.ndim != 1 or not len(offset) or offset[0] != 0 or offset[-1] != end:
        return False
    return not np.count_nonzero(offset[1:] < offset[:-1])


def _tx_status(frame: Frame) -> TxStatuses:
    if "tx_status" not in frame.arrays:
        return NO_TX_STATUSES
    row, id_, result = checked_array(frame, "tx_status", "<i8", (3, None))
    if ((result < 0) | (result >= len(TxResult))).any():
        raise BadFrame("malformed", f"tx_status: expected results from 0 to {len(TxResult) - 1}")
    return TxStatuses(row, id_, result)


def encode_actions(
    tick: int,
    actions: Actions,
    dropped: int = 0,
    memory: GroupMemories | None = None,
    extra: Mapping[str, AnyArray] = NO_EXTRA_ARRAYS,
) -> bytes:
    """Encode an `actions` frame: the actions of a runner's robots, and the number of frames that the runner dropped.

    `memory` is the memory of their agents, for a world that keeps it; `extra` are more arrays, for a recording.
    """
    arrays: dict[str, AnyArray] = {
        **extra,
        "rows": actions.rows,
        "command": np.array((actions.drive, actions.linear_mps, actions.angular_radps, actions.lateral_mps)),
    }
    if len(actions.sent):
        arrays |= sent_arrays(actions.sent)
    for name in TABLES:
        table: SparseTable = getattr(actions, name)
        if len(table):
            arrays |= {name: np.array((table.rows, table.slot)), f"{name}/value": table.value}
    if memory:
        arrays |= memory_arrays(memory)
    values: dict[str, Any] = {"dropped": dropped} if dropped else {}
    if len(actions.notes):
        values["states"] = actions.notes.names
    return frames.encode("actions", tick, arrays, values)


def sent_arrays(sent: SentPackets) -> dict[str, AnyArray]:
    """Return packets as arrays of a frame."""
    arrays: dict[str, AnyArray] = {
        "sent": np.array((sent.sender, sent.to)),
        "sent/data": sent.payloads.data,
        "sent/offset": sent.payloads.offset,
    }
    return arrays if sent.tx_status_id is None else arrays | {"sent/tx_status_id": sent.tx_status_id}


def decode_actions(frame: Frame, rows: IntArray, placed: IntArray | None = None) -> Actions:
    """Decode the actions of the robots `rows` (n,); BadFrame if the frame has other rows or contradicts itself.

    Only the robots `placed` (m,) may have poses, in a frame that the world recorded itself; agents place no robots.
    """
    n = len(rows)
    if POSES in frame.arrays and placed is None:
        raise BadFrame("malformed", "poses: expected none from agents")
    if checked_array(frame, "rows", "<i8", (n,)).tobytes() != rows.tobytes():
        raise BadFrame("malformed", "rows: expected the runner's own robots")
    drive, linear_mps, angular_radps, lateral_mps = checked_array(frame, "command", "<f8", (4, n))
    sent = sent_of(frame, rows) if "sent" in frame.arrays else SentPackets.none()
    owners = {name: placed if name == POSES and placed is not None else rows for name in TABLES}
    tables = {name: _table(frame, name, owners[name]) for name in TABLES if name in frame.arrays}
    if "notes" in tables:
        tables["notes"] = _named(tables["notes"], frame.values.get("states"))
    _check_integers(tables.get("leds", NOTHING_SET), "leds", BRIGHTEST)
    _check_integers(tables.get("motors", NOTHING_SET), "motors", 1)
    if (tables.get(POSES, NOTHING_SET).slot >= POSE_SLOTS).any():
        raise BadFrame("malformed", f"poses: expected slots 0 to {POSE_SLOTS - 1}")
    return Actions(rows, drive != 0.0, linear_mps, angular_radps, lateral_mps, sent, **tables)


def sent_of(frame: Frame, rows: IntArray) -> SentPackets:
    """Decode the arrays of `sent_arrays`; BadFrame unless senders are among `rows` and the arrays fit each other."""
    sender, to = checked_array(frame, "sent", "<i8", (2, None))
    offset = checked_array(frame, "sent/offset", "<i8", (len(sender) + 1,))
    data = checked_array(frame, "sent/data", "|u1", (None,))
    if not _rises_to(offset, len(data)):
        raise BadFrame("malformed", "sent/offset: expected rising offsets into sent/data")
    if not _are_among(sender, rows) or np.count_nonzero(to < BROADCAST):
        raise BadFrame("malformed", "sent: expected packets of the runner's own robots")
    return SentPackets(sender, to, Payloads(data, offset), _tx_status_id(frame, to))


def _tx_status_id(frame: Frame, to: IntArray) -> IntArray | None:
    if "sent/tx_status_id" not in frame.arrays:
        return None
    tx_status_id = checked_array(frame, "sent/tx_status_id", "<i8", (len(to),))
    if (tx_status_id < NO_TX_STATUS).any() or ((tx_status_id != NO_TX_STATUS) & (to == BROADCAST)).any():
        raise BadFrame("malformed", "sent/tx_status_id: expected numbers from 0, or -1, as for every broadcast")
    return tx_status_id


def _table(frame: Frame, name: str, rows: IntArray) -> SparseTable:
    """Decode a sparse table; BadFrame unless its robots are among `rows`, and its numbers finite."""
    table_rows, slot = checked_array(frame, name, "<i8", (2, None))
    value = checked_array(frame, f"{name}/value", "<f8", (len(table_rows),))
    if not _are_among(table_rows, rows) or (slot < 0).any() or not np.isfinite(value).all():
        raise BadFrame("malformed", f"{name}: expected slots, and finite numbers, of the runner's own robots")
    return SparseTable(table_rows, slot, value)


def _named(notes: SparseTable, names: object) -> SparseTable:
    """Return the table of notes with the states of its frame; BadFrame if the two do not fit each other."""
    if type(names) is not list or not 0 < len(cast("list[object]", names)) <= MAX_STATES:
        raise BadFrame("malformed", f"states: expected a list of 1 to {MAX_STATES} texts")
    try:
        states = tuple(checked_state(name) for name in cast("list[object]", names))
    except ValueError as error:
        raise BadFrame("malformed", str(error)) from error
    if len(np.unique(notes.rows)) < len(notes):
        raise BadFrame("malformed", "notes: expected each robot once")
    _check_integers(notes, "notes", len(states) - 1)
    return replace(notes, names=states)


def _check_integers(table: SparseTable, name: str, largest: int) -> None:
    if ((table.value < 0) | (table.value > largest) | (table.value % 1 != 0)).any():
        raise BadFrame("malformed", f"{name}/value: expected integers from 0 to {largest}")


def _are_among(index: IntArray, rows: IntArray) -> bool:
    """Return True if all robots `index` are among `rows`."""
    if not len(index) or not len(rows):
        return not len(index)
    if len(rows) == 1:
        return np.count_nonzero(index == rows) == len(index)
    sorted_rows = np.sort(rows)
    return np.count_nonzero(sorted_rows[np.searchsorted(sorted_rows[:-1], index)] == index) == len(index)


def encode_packets(tick: int, at_ns: int, number: int, received: ReceivedPackets, tx_status: TxStatuses) -> bytes:
    """Encode a `packets` frame: packets received, and tx statuses, of a runner's robots since the last such frame.

    They are delivered at `at_ns` of simulated time, in `tick`; `number` counts these frames to a runner from 0.
    """
    return frames.encode("packets", tick, result_arrays(received, tx_status), {"at_ns": at_ns, "number": number})


def decode_packets(frame: Frame, measures: tuple[str, ...]) -> tuple[int, int, ReceivedPackets, TxStatuses]:
    """Decode the time, number, packets and statuses of a `packets` frame; BadFrame if it does not hold them."""
    at_ns, number = frame.values.get("at_ns"), frame.values.get("number")
    if type(at_ns) is not int or type(number) is not int:
        raise BadFrame("malformed", "expected at_ns and number")
    try:
        return at_ns, number, *results_of(frame, measures)
    except (KeyError, ValueError) as error:
        raise BadFrame("malformed", f"an array is missing or of the wrong shape: {error}") from error


def encode_sent(tick: int, sent: SentPackets, missed: int = 0) -> bytes:
    """Encode a `sent` frame: packets that robots sent between ticks; `missed` counts lost `packets` frames."""
    return frames.encode("sent", tick, sent_arrays(sent), {"missed": missed} if missed else {})


def decode_sent(frame: Frame, rows: IntArray) -> SentPackets:
    """Decode the packets of a `sent` frame; BadFrame if it has none, or packets of robots outside `rows`."""
    if "sent" not in frame.arrays:
        raise BadFrame("malformed", "expected packets")
    return sent_of(frame, rows)
