"""Ticks as frames: an agent host cuts its tick into one frame per process, and a process reads its frame.

The host writes the records of all its robots at once and cuts them by process with slices. This module reads a frame
into arrays, for a process of several robots; `one_robot` reads the frame of one robot with `struct` alone, without
numpy. A process trusts its host.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from swarmwire.agent.process_frames import (
    COUNT,
    HEAD,
    NOT_ACTING,
    PACKET_NUMBERS,
    PACKETS,
    ROW,
    STATUS,
    TICK,
    Buffers,
    ProcessFrame,
    RecordField,
    RecordFields,
)
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, TxStatuses, offsets
from swarmwire.comms.robot.tick_io import GroupReadings, Readings

NO_PROCESS = -1


def processes_of_rows(rows: Sequence[Mapping[str, IntArray]]) -> IntArray:
    """Return the process of each robot row, or NO_PROCESS; `rows` has the rising rows of each process, by group."""
    count = 1 + max(int(group_rows[-1]) for groups in rows for group_rows in groups.values())
    processes = np.full(count, NO_PROCESS)
    for process, groups in enumerate(rows):
        for group_rows in groups.values():
            processes[group_rows] = process
    return processes


class TickCutter:
    """Cuts the tick of a host into one frame per process.

    The cost is a few operations on arrays for all robots, and a few slices per process.
    """

    def __init__(self, rows: Sequence[dict[str, IntArray]], measures: tuple[str, ...]) -> None:
        """Begin; `rows` has the rising rows of each process, by group, with each robot in one process."""
        self._measures = measures
        self._groups = [tuple(groups) for groups in rows]
        self._process_of_row = processes_of_rows(rows)
        self._processes = len(rows)

    def tick(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses
    ) -> list[ProcessFrame]:
        """Return the frame "tick" of each process; empty for a process whose groups do not act."""
        parts = {name: self._records(group) for name, group in readings.items()}
        packets = self._packets(received, tx_status)
        frames: list[ProcessFrame] = []
        for process, names in enumerate(self._groups):
            buffers: Buffers = []
            acting_rows: Buffers = []
            acts = False
            for name in names:
                if name not in parts:
                    buffers.append(COUNT.pack(NOT_ACTING))
                    continue
                acts = True
                rows, records, first, record_bytes = parts[name]
                start, end = first[process], first[process + 1]
                buffers.append(COUNT.pack(end - start))
                if end > start:
                    acting_rows.append(rows[start * ROW.size : end * ROW.size])
                    buffers += (acting_rows[-1], records[start * record_bytes : end * record_bytes])
            frame = _with_head(TICK, tick, 0, buffers, packets[process]) if acts else []
            frames.append(ProcessFrame(frame, b"".join(acting_rows)))
        return frames

    def packets(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> list[ProcessFrame]:
        """Return the frame "packets" of each process; empty for a process without any."""
        return [
            ProcessFrame(_with_head(PACKETS, tick, at_ns, [], part) if part.packets or part.statuses else [])
            for part in self._packets(received, tx_status)
        ]

    def _records(self, group: GroupReadings) -> tuple[memoryview, memoryview, list[int], int]:
        """Return rows and records sorted by process, the index of each process's first, and bytes per record."""
        n = len(group.rows)
        columns = [column if column.ndim == 2 else column[:, None] for column in group.fields.values()]
        records = np.concatenate(columns, axis=1) if columns else np.empty((n, 0))
        process, rows = self._process_of_row[group.rows], group.rows
        if np.count_nonzero(process[1:] < process[:-1]):  # a process has robots between those of another
            order = np.argsort(process, kind="stable")
            process, rows, records = process[order], rows[order], records[order]
        first = np.searchsorted(process, np.arange(self._processes + 1)).tolist()
        return memoryview(rows.tobytes()), memoryview(records.tobytes()), first, 8 * records.shape[1]

    def _packets(self, received: ReceivedPackets, tx_status: TxStatuses) -> "list[_PacketsPart]":
        """Return the packets and statuses of each process."""
        processes = np.arange(self._processes + 1)
        process = self._process_of_row[received.receiver]
        if np.count_nonzero(process[1:] < process[:-1]):
            order = np.argsort(process, kind="stable")
            process, received = process[order], received.select(order)
        payloads = received.payloads.select(received.payload)
        width = PACKET_NUMBERS + len(self._measures)
        heads = np.empty((len(received), width))
        numbers = (received.receiver, received.sender_index, received.sequence, received.received_at_ns, payloads.sizes)
        heads.view(np.int64)[:, :PACKET_NUMBERS] = np.array(numbers).T
        for column, name in enumerate(self._measures, PACKET_NUMBERS):
            heads[:, column] = received.measured[name]
        first_packet = np.searchsorted(process, processes)
        first_byte = payloads.offset[first_packet].tolist()
        status_process = self._process_of_row[tx_status.row]
        order = np.argsort(status_process, kind="stable")
        first_status = np.searchsorted(status_process[order], processes).tolist()
        statuses = memoryview(np.array((tx_status.row, tx_status.id, tx_status.result)).T[order].tobytes())
        head_data, data = memoryview(heads.tobytes()), memoryview(payloads.data.tobytes())
        head_bytes = 8 * width
        return [
            _PacketsPart(
                packets_end - packets_start,
                statuses_end - statuses_start,
                head_data[head_bytes * packets_start : head_bytes * packets_end],
                statuses[STATUS.size * statuses_start : STATUS.size * statuses_end],
                data[bytes_start:bytes_end],
            )
            for (packets_start, packets_end), (bytes_start, bytes_end), (statuses_start, statuses_end) in zip(
                pairwise(first_packet.tolist()), pairwise(first_byte), pairwise(first_status), strict=True
            )
        ]


class _PacketsPart(NamedTuple):
    """The packets and statuses of one process."""

    packets: int
    statuses: int
    heads: memoryview
    status_rows: memoryview
    payloads: memoryview


def _with_head(kind: int, tick: int, at_ns: int, buffers: Buffers, part: _PacketsPart) -> Buffers:
    buffers += part[2:]
    size = HEAD.size + sum(map(len, buffers))
    return [HEAD.pack(size, kind, tick, at_ns, part.packets, part.statuses, len(part.payloads)), *buffers]


def read_tick(
    frame: bytes, groups: Sequence[str], fields: Mapping[str, RecordFields], measures: tuple[str, ...]
) -> tuple[int, Readings, ReceivedPackets, TxStatuses]:
    """Return the tick, readings, packets and statuses in a frame "tick" for a process with robots of these groups."""
    _, _, tick, _, *numbers = HEAD.unpack_from(frame)
    start, readings = HEAD.size, dict[str, GroupReadings]()
    for name in groups:
        (count,) = COUNT.unpack_from(frame, start)
        start += COUNT.size
        if count == NOT_ACTING:
            continue
        rows = np.frombuffer(frame, np.int64, count, start)
        start += rows.nbytes
        width = fields[name][-1].last if fields[name] else 0
        records = np.frombuffer(frame, np.float64, count * width, start).reshape(count, width)
        start += records.nbytes
        readings[name] = GroupReadings(rows, {field.name: _column(records, field) for field in fields[name]})
    received, tx_status = _read_packets(frame, start, numbers, measures)
    return tick, readings, received, tx_status


def _column(records: FloatArray, field: RecordField) -> FloatArray:
    values = records[:, field.first] if field.is_single else records[:, field.first : field.last]
    column = np.ascontiguousarray(values)
    column.setflags(write=False)
    return column


def read_packets(frame: bytes, measures: tuple[str, ...]) -> tuple[int, int, ReceivedPackets, TxStatuses]:
    """Return the tick, time in ns, packets and statuses in a frame "packets"."""
    _, _, tick, at_ns, *numbers = HEAD.unpack_from(frame)
    return tick, at_ns, *_read_packets(frame, HEAD.size, numbers, measures)


def _read_packets(
    frame: bytes, start: int, numbers: Sequence[int], measures: tuple[str, ...]
) -> tuple[ReceivedPackets, TxStatuses]:
    """Return the packets and statuses that begin at the byte `start`; `numbers` are the last three of HEAD."""
    packets, statuses, payload_bytes = numbers
    received, tx_status = ReceivedPackets.none(measures), NO_TX_STATUSES
    width = PACKET_NUMBERS + len(measures)
    heads_end = start + 8 * packets * width
    if packets:
        heads = np.frombuffer(frame, np.float64, packets * width, start).reshape(packets, width)
        receiver, sender, sequence, received_at_ns, sizes = heads.view(np.int64)[:, :PACKET_NUMBERS].T.copy()
        measured = {name: heads[:, column].copy() for column, name in enumerate(measures, PACKET_NUMBERS)}
        data = np.frombuffer(frame, np.uint8, payload_bytes, heads_end + statuses * STATUS.size)
        payloads, payload = Payloads(data, offsets(sizes)), np.arange(packets)
        received = ReceivedPackets(receiver, sender, sequence, received_at_ns, measured, payload, payloads)
    if statuses:
        columns = np.frombuffer(frame, np.int64, 3 * statuses, heads_end).reshape(statuses, 3).T.copy()
        tx_status = TxStatuses(*columns)
    return received, tx_status
