"""Answers of agent processes: written by a process, and read by its host as input that may be hostile.

A process runs the user's code, which may write anything to its socket. `answer_in` checks the sizes of one frame as it
arrives. `AnswerReader` joins the answers of many processes and checks the arrays at once: rows, senders and tables must
be of each process's robots. `AnswerReader.faults` finds the processes at fault once that check fails.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple, TypeVar

import msgpack
import msgspec
import numpy as np
from msgspec import Meta, Struct

from swarmwire.agent.process_frames import ACTIONS, ANSWER_HEAD, COMMAND, ROW, SENT_PACKET, answer_head
from swarmwire.agent.process_ticks import processes_of_rows
from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.robot.bodies.drives import BRIGHTEST
from swarmwire.comms.robot.packets import Payloads, SentPackets, offsets
from swarmwire.comms.robot.tick_io import MAX_STATE, MAX_STATES, NOTHING_SET, TABLES, Actions, SparseTable
from swarmwire.comms.wire.agent_memory import GroupMemories, GroupMemory, Layout
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.frames import BOOL, DTYPES, MAX_ITEMS
from swarmwire.comms.wire.limits import MAX_BYTES

MIN_LIMIT_BYTES = 1 << 20  # lowest limit of an answer, for a process with a small share of the robots
TABLE_ROW_BYTES = 24  # in the host's answer to the world: row, slot and value
HEAD_BYTES = 1 << 20  # reserved in the host's answer for names, shapes and states
SENT_NOTHING = SentPackets.none()

Numbers = Annotated[list[Annotated[int, Meta(ge=0, le=2**63 - 1)]], Meta(max_length=MAX_ITEMS)]
Values = Annotated[list[float], Meta(max_length=MAX_ITEMS)]
States = Annotated[list[Annotated[str, Meta(min_length=1, max_length=MAX_STATE)]], Meta(max_length=MAX_ITEMS)]
Table = tuple[Numbers, Numbers, Values]  # rows, slots, values
EMPTY: Table = ([], [], [])
T = TypeVar("T")


class Extras(Struct, forbid_unknown_fields=True):
    """The msgpack at the end of an answer: values that agents set seldom, and memory."""

    notes: tuple[Numbers, States] = ([], [])  # rows, and the state of each
    leds: Table = EMPTY
    actuators: Table = EMPTY
    values: Table = EMPTY
    memory: dict[str, dict[str, bytes]] = {}  # columns by group and name, with all robots of the group in the process


class Failure(Struct, forbid_unknown_fields=True):
    """The content of a frame FAILED."""

    robots: str
    traceback: str
    reason: str


_EXTRAS, _FAILURE = msgspec.msgpack.Decoder(Extras), msgspec.msgpack.Decoder(Failure)


class AnswerFrame(NamedTuple):
    """A frame "actions" with consistent sizes."""

    process: int  # number of the process
    robots: int
    packets: int
    payload_bytes: int
    data: bytes


def write_actions(tick: int, actions: Actions, memory: GroupMemories | None = None) -> bytes:
    """Encode a frame "actions"."""
    sent = actions.sent
    command = np.array((actions.drive, actions.linear_mps, actions.angular_radps, actions.lateral_mps), np.float64)
    heads = np.array((sent.sender, sent.to, sent.tx_status_ids, sent.payloads.sizes))
    extras: dict[str, Any] = {
        name: (table.rows.tolist(), table.slot.tolist(), table.value.tolist())
        for name in TABLES
        if name != "notes" and len(table := getattr(actions, name))
    }
    if len(actions.notes):
        names = actions.notes.names
        extras["notes"] = actions.notes.rows.tolist(), [names[index] for index in actions.notes.integers.tolist()]
    data = extras_data(extras, memory)
    return b"".join(
        (
            answer_head(tick, len(actions.rows), len(sent), len(sent.payloads.data), data),
            actions.rows.tobytes(),
            command.T.tobytes(),
            heads.T.tobytes(),
            sent.payloads.data.tobytes(),
            data,
        )
    )


def extras_data(extras: dict[str, Any], memory: GroupMemories | None) -> bytes:
    """Encode the end of an answer; empty without content."""
    if memory is not None:
        columns = {
            name: {key: column.tobytes() for key, column in group.columns.items()} for name, group in memory.items()
        }
        extras = {**extras, "memory": columns}
    return msgpack.packb(extras) if extras else b""


def size_limits(parts: Sequence[Assignment]) -> list[int]:
    """Return the most bytes of an answer of each process: its share of the largest answer that a world accepts."""
    robots = [sum(len(group.rows) for group in part.groups) for part in parts]
    return [max(MIN_LIMIT_BYTES, MAX_BYTES * count // sum(robots)) for count in robots]


def answer_in(process: int, data: bytes, tick: int, rows: bytes) -> AnswerFrame:
    """Return the answer of a process to a frame of this tick, in which these robot rows act; BadFrame for another."""
    _, kind, answered, robots, packets, payload_bytes = ANSWER_HEAD.unpack_from(data)
    start = ANSWER_HEAD.size
    if kind != ACTIONS or answered != tick:
        raise BadFrame("wrong_tick", f"kind {kind} of tick {answered}, expected actions of tick {tick}")
    if robots * ROW.size != len(rows) or data[start : start + len(rows)] != rows:
        raise BadFrame("malformed", "rows: expected the process's robots that act in this tick")
    fixed = start + robots * (ROW.size + COMMAND.size) + packets * SENT_PACKET.size + payload_bytes
    if packets < 0 or payload_bytes < 0 or fixed > len(data) or (payload_bytes and not packets):
        raise BadFrame("malformed", "expected as many packets as the frame has bytes for")
    return AnswerFrame(process, robots, packets, payload_bytes, data)


def failure_in(data: bytes) -> Failure:
    """Decode the failure in a frame FAILED; BadFrame if it has none."""
    return _decoded(_FAILURE, data[ANSWER_HEAD.size :])


def _decoded(decoder: "msgspec.msgpack.Decoder[T]", data: bytes) -> T:
    try:
        return decoder.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise BadFrame("malformed", str(error)) from error


class AnswerReader:
    """Reads the answers of a host's processes."""

    def __init__(self, parts: Sequence[Assignment], layouts: Mapping[str, Layout]) -> None:
        """Begin; `parts` are the robots of each process, `layouts` the columns of memory by group, if there is any."""
        self._rows = [{group.name: group.rows for group in part.groups} for part in parts]
        self._process_of_row = processes_of_rows(self._rows)
        self._layouts = layouts

    def read(self, answers: Sequence[AnswerFrame], *, is_step: bool = True) -> tuple[Actions, GroupMemories | None]:
        """Return the joined actions and memory of these processes, in this order; BadFrame if any answer is at fault.

        The cost is a few slices per frame, and a few operations on arrays for all.
        """
        rows, commands, heads, payloads = list[bytes](), list[bytes](), list[bytes](), list[bytes]()
        extras: list[tuple[int, Extras]] = []
        for process, robots, packets, payload_bytes, data in answers:
            rows_start = ANSWER_HEAD.size
            rows_end = rows_start + ROW.size * robots
            end = rows_end + COMMAND.size * robots
            rows.append(data[rows_start:rows_end])
            commands.append(data[rows_end:end])
            if packets:
                heads_end = end + SENT_PACKET.size * packets
                heads.append(data[end:heads_end])
                end = heads_end + payload_bytes
                payloads.append(data[heads_end:end])
            if len(data) > end:
                extras.append((process, _decoded(_EXTRAS, data[end:])))
        robot_rows = np.frombuffer(b"".join(rows), np.int64)
        drive, linear_mps, angular_radps, lateral_mps = np.frombuffer(b"".join(commands)).reshape(-1, 4).T.copy()
        acting = None
        if is_step:
            acting = np.zeros(len(self._process_of_row), np.bool_)
            acting[robot_rows] = True
        sent = self._sent(answers, heads, payloads, acting) if heads else SENT_NOTHING
        tables = self._tables(extras, acting)
        size = sum(len(answer.data) for answer in answers) + TABLE_ROW_BYTES * sum(map(len, tables.values()))
        if size > MAX_BYTES - HEAD_BYTES:
            raise BadFrame("oversized", f"{size} bytes of all processes")
        actions = Actions(robot_rows, drive != 0.0, linear_mps, angular_radps, lateral_mps, sent, **tables)
        return actions, self._memory(extras)

    def faults(self, answers: Sequence[AnswerFrame], *, is_step: bool = True) -> dict[int, str]:
        """Return the reason by process, for each process whose answer alone is at fault.

        If there are none, all answers together are more than a world accepts; then the largest is at fault.
        """
        faults: dict[int, str] = {}
        for answer in answers:
            try:
                self.read([answer], is_step=is_step)
            except BadFrame as fault:
                faults[answer.process] = str(fault)
        if faults or not answers:
            return faults
        largest = max(answers, key=lambda answer: (len(answer.data), answer.process))
        return {largest.process: "oversized: with the other answers of its host more than a world accepts"}

    def _sent(
        self, answers: Sequence[AnswerFrame], heads: list[bytes], payloads: list[bytes], acting: BoolArray | None
    ) -> SentPackets:
        """Return the packets of all answers."""
        sender, to, tx_status_id, sizes = np.frombuffer(b"".join(heads), np.int64).reshape(-1, 4).T.copy()
        data = np.frombuffer(b"".join(payloads), np.uint8)
        if sizes.min() < 0 or sizes.max() > len(data):  # before their sum, which could overflow
            raise BadFrame("malformed", "expected sizes of the payloads in the frame")
        offset, counts = offsets(sizes), [answer.packets for answer in answers]
        if (offset[np.cumsum(counts)] != np.cumsum([answer.payload_bytes for answer in answers])).any():
            raise BadFrame("malformed", "expected as many bytes of payloads as the sum of their sizes")
        self._check_rows(sender, np.repeat([answer.process for answer in answers], counts), acting, "senders")
        if (to < BROADCAST).any():
            raise BadFrame("malformed", "expected receivers from 0, or -1 for all")
        wants_status = tx_status_id != NO_TX_STATUS
        if not wants_status.any():
            return SentPackets(sender, to, Payloads(data, offset))
        if (tx_status_id < NO_TX_STATUS).any() or (wants_status & (to == BROADCAST)).any():
            raise BadFrame("malformed", "expected ids of tx statuses from 0, or -1, as for every broadcast")
        return SentPackets(sender, to, Payloads(data, offset), tx_status_id)

    def _tables(self, extras: Sequence[tuple[int, Extras]], acting: BoolArray | None) -> dict[str, SparseTable]:
        """Return the sparse tables of all answers."""
        tables: dict[str, SparseTable] = {}
        if not extras:
            return tables
        if acting is None:
            raise BadFrame("malformed", "expected only packets between ticks")
        for name in ("leds", "actuators", "values"):
            parts = [(process, table) for process, extra in extras if (table := getattr(extra, name)) != EMPTY]
            for _, (rows, slots, values) in parts:
                if not len(rows) == len(slots) == len(values):
                    raise BadFrame("malformed", f"{name}: expected as many rows as slots and values")
            row = _joined([rows for _, (rows, _, _) in parts], np.int64)
            slot = _joined([slots for _, (_, slots, _) in parts], np.int64)
            value = _joined([values for _, (_, _, values) in parts], np.float64)
            self._check_rows(row, _repeated(parts, [len(rows) for _, (rows, _, _) in parts]), acting, name)
            if not np.isfinite(value).all():
                raise BadFrame("malformed", f"{name}: expected finite numbers")
            tables[name] = SparseTable(row, slot, value) if len(row) else NOTHING_SET
        leds = tables["leds"].value
        if ((leds < 0) | (leds > BRIGHTEST) | (leds % 1 != 0)).any():
            raise BadFrame("malformed", f"leds: expected integers from 0 to {BRIGHTEST}")
        tables["notes"] = self._notes(extras, acting)
        return tables

    def _notes(self, extras: Sequence[tuple[int, Extras]], acting: BoolArray | None) -> SparseTable:
        parts = [(process, extra.notes) for process, extra in extras if extra.notes[0] or extra.notes[1]]
        if not parts:
            return NOTHING_SET
        if any(len(rows) != len(states) for _, (rows, states) in parts):
            raise BadFrame("malformed", "notes: expected as many rows as states")
        row = _joined([rows for _, (rows, _) in parts], np.int64)
        self._check_rows(row, _repeated(parts, [len(rows) for _, (rows, _) in parts]), acting, "notes")
        if len(np.unique(row)) < len(row):
            raise BadFrame("malformed", "notes: expected each robot once")
        noted = [state for _, (_, states) in parts for state in states]
        index_of_state = {state: index for index, state in enumerate(dict.fromkeys(noted))}
        if len(index_of_state) > MAX_STATES:
            raise BadFrame("oversized", f"notes: more than {MAX_STATES} states in one tick")
        value = np.array([index_of_state[state] for state in noted], np.float64)
        return SparseTable(row, np.zeros(len(row), np.int64), value, tuple(index_of_state))

    def _check_rows(self, rows: IntArray, process: IntArray, acting: BoolArray | None, name: str) -> None:
        """Raise BadFrame unless each row is of a robot of its process and, with a mask `acting`, of one that acts."""
        if not len(rows):
            return
        processes = self._process_of_row
        are_valid = rows.min() >= 0 and rows.max() < len(processes) and (processes[rows] == process).all()
        if are_valid and (acting is None or acting[rows].all()):
            return
        raise BadFrame("malformed", f"{name}: expected the process's robots that act in this tick")

    def _memory(self, extras: Sequence[tuple[int, Extras]]) -> GroupMemories | None:
        """Return the memory of all answers, by group."""
        parts: dict[str, list[tuple[IntArray, Mapping[str, bytes]]]] = {}
        for process, extra in extras:
            for name, columns in extra.memory.items():
                rows = self._rows[process].get(name)
                layout = self._layouts.get(name)
                if rows is None or layout is None or columns.keys() != layout.keys():
                    raise BadFrame("malformed", f"memory/{name}: expected the memory of the world's agents")
                for column, (code, shape) in layout.items():
                    if len(columns[column]) != len(rows) * _width(shape) * DTYPES[code].itemsize:
                        raise BadFrame("malformed", f"memory/{name}/{column}: expected {code} of shape {shape}")
                parts.setdefault(name, []).append((rows, columns))
        memory: GroupMemories = {}
        for name, group_parts in parts.items():
            rows = np.concatenate([rows for rows, _ in group_parts])
            order = np.argsort(rows)
            memory[name] = GroupMemory(
                rows[order],
                {
                    column: _column([columns[column] for _, columns in group_parts], code, shape)[order]
                    for column, (code, shape) in self._layouts[name].items()
                },
            )
        return memory or None


def _column(parts: Iterable[bytes], code: str, shape: tuple[int, ...]) -> AnyArray:
    data = b"".join(parts)
    if DTYPES[code] is BOOL and data.translate(None, b"\x00\x01"):
        raise BadFrame("malformed", "memory: expected truth values")
    return np.frombuffer(data, DTYPES[code]).reshape(-1, *shape)


def _width(shape: tuple[int, ...]) -> int:
    return shape[0] if shape else 1


def _joined(parts: Sequence[Sequence[float]], kind: Any) -> AnyArray:
    return np.array([number for part in parts for number in part], kind)


def _repeated(parts: Sequence[tuple[int, Any]], counts: Sequence[int]) -> IntArray:
    """Return the process of each row of a joined table."""
    return np.repeat(np.array([process for process, _ in parts], np.int64), np.array(counts, np.int64))


def in_order(actions: Actions, rows: IntArray) -> Actions:
    """Return the actions with their robots in the order of `rows`, which may have further robots."""
    order = np.argsort(actions.rows)
    sorted_rows = actions.rows[order]
    rows = rows[np.isin(rows, sorted_rows)]
    index = order[np.searchsorted(sorted_rows, rows)]
    columns: dict[str, FloatArray] = {
        name: getattr(actions, name)[index] for name in ("drive", "linear_mps", "angular_radps", "lateral_mps")
    }
    return replace(actions, rows=rows, **columns)
