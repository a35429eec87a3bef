"""Answers of agent processes: written by a process, and read by its host as input that may be hostile.

A process runs the user's code, which may write anything to its socket. `answer_in` checks the sizes of one frame as it
arrives. `AnswerReader` joins the answers of many processes and checks the arrays at once: rows, senders and tables must
be of each process's own robots. `AnswerReader.faults` finds the processes at fault once that check fails.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple, TypeVar

import msgpack
import msgspec
import numpy as np
from msgspec import Meta, Struct

from swarmwire.agent.process_frames import ACTIONS, ANSWER_HEAD, COMMAND, ROW, SENT_PACKET, answer_head, owners
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

MIN_LIMIT_BYTES = 1 << 20  # of the answers of a process, however small its share of the robots is
TABLE_ROW_BYTES = 24  # in the host's own answer: row, place and value
HEAD_BYTES = 1 << 20  # left in the host's answer for names, shapes and states
SENT_NOTHING = SentPackets.none()

Numbers = Annotated[list[Annotated[int, Meta(ge=0, le=2**63 - 1)]], Meta(max_length=MAX_ITEMS)]
Values = Annotated[list[float], Meta(max_length=MAX_ITEMS)]
States = Annotated[list[Annotated[str, Meta(min_length=1, max_length=MAX_STATE)]], Meta(max_length=MAX_ITEMS)]
Table = tuple[Numbers, Numbers, Values]  # rows, places, values
EMPTY: Table = ([], [], [])
T = TypeVar("T")


class Extras(Struct, forbid_unknown_fields=True):
    """The msgpack at the end of an answer: what agents set seldom."""

    notes: tuple[Numbers, States] = ([], [])  # rows, and the state of each
    leds: Table = EMPTY
    actuators: Table = EMPTY
    values: Table = EMPTY
    memory: dict[str, dict[str, bytes]] = {}  # by group and column: the values of all robots of the group here


class Failure(Struct, forbid_unknown_fields=True):
    """The content of a frame FAILED."""

    robots: str
    traceback: str
    reason: str


_EXTRAS, _FAILURE = msgspec.msgpack.Decoder(Extras), msgspec.msgpack.Decoder(Failure)


class AnswerFrame(NamedTuple):
    """A frame "actions" whose sizes fit each other."""

    process: int  # its number
    robots: int
    packets: int
    payload_bytes: int
    data: bytes


# The process's side.


def write_actions(tick: int, actions: Actions, memory: GroupMemories | None = None) -> bytes:
    """A frame "actions"."""
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
        extras["notes"] = actions.notes.rows.tolist(), [names[at] for at in actions.notes.integers.tolist()]
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
    """The msgpack at the end of an answer; nothing without content."""
    if memory is not None:
        columns = {
            name: {key: column.tobytes() for key, column in group.columns.items()} for name, group in memory.items()
        }
        extras = {**extras, "memory": columns}
    return msgpack.packb(extras) if extras else b""


# The host's side.


def size_limits(parts: Sequence[Assignment]) -> list[int]:
    """The most bytes of an answer of each process: its share of the largest answer that a world takes."""
    robots = [sum(len(group.rows) for group in part.groups) for part in parts]
    return [max(MIN_LIMIT_BYTES, MAX_BYTES * own // sum(robots)) for own in robots]


def answer_in(process: int, data: bytes, tick: int, rows: bytes) -> AnswerFrame:
    """The answer of a process to a frame of this tick, in which these robot rows act; BadFrame for another."""
    _, kind, answered, robots, packets, payload_bytes = ANSWER_HEAD.unpack_from(data)
    start = ANSWER_HEAD.size
    if kind != ACTIONS or answered != tick:
        raise BadFrame("wrong_tick", f"kind {kind} of tick {answered}, expected actions of tick {tick}")
    if robots * ROW.size != len(rows) or data[start : start + len(rows)] != rows:
        raise BadFrame("malformed", "rows: expected the process's own robots that act in this tick")
    fixed = start + robots * (ROW.size + COMMAND.size) + packets * SENT_PACKET.size + payload_bytes
    if packets < 0 or payload_bytes < 0 or fixed > len(data) or (payload_bytes and not packets):
        raise BadFrame("malformed", "expected as many packets as the frame has bytes for")
    return AnswerFrame(process, robots, packets, payload_bytes, data)


def failure_in(data: bytes) -> Failure:
    """The failure in a frame FAILED; BadFrame if it has none."""
    return _typed(_FAILURE, data[ANSWER_HEAD.size :])


def _typed(decoder: "msgspec.msgpack.Decoder[T]", data: bytes) -> T:
    try:
        return decoder.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise BadFrame("malformed", str(error)) from error


class AnswerReader:
    """Reads the answers of a host's processes."""

    def __init__(self, parts: Sequence[Assignment], layouts: Mapping[str, Layout]) -> None:
        """`parts` are the robots of each process, `layouts` the columns of memory by group; empty without memory."""
        self._rows = [{group.name: group.rows for group in part.groups} for part in parts]
        self._owner = owners(self._rows)
        self._layouts = layouts

    def read(self, answers: Sequence[AnswerFrame], *, is_step: bool = True) -> tuple[Actions, GroupMemories | None]:
        """The joined actions and memory of these processes, in this order; BadFrame if any answer is at fault.

        The cost is a few slices for each frame, and a few operations on arrays for all.
        """
        rows, commands, heads, payloads = list[bytes](), list[bytes](), list[bytes](), list[bytes]()
        extras: list[tuple[int, Extras]] = []
        for process, robots, packets, payload_bytes, data in answers:
            a = ANSWER_HEAD.size
            b = a + ROW.size * robots
            c = b + COMMAND.size * robots
            rows.append(data[a:b])
            commands.append(data[b:c])
            if packets:
                d = c + SENT_PACKET.size * packets
                heads.append(data[c:d])
                c = d + payload_bytes
                payloads.append(data[d:c])
            if len(data) > c:
                extras.append((process, _typed(_EXTRAS, data[c:])))
        index = np.frombuffer(b"".join(rows), np.int64)
        drive, linear_mps, angular_radps, lateral_mps = np.frombuffer(b"".join(commands)).reshape(-1, 4).T.copy()
        acting = None
        if is_step:
            acting = np.zeros(len(self._owner), np.bool_)
            acting[index] = True
        sent = self._sent(answers, heads, payloads, acting) if heads else SENT_NOTHING
        tables = self._tables(extras, acting)
        size = sum(len(answer.data) for answer in answers) + TABLE_ROW_BYTES * sum(map(len, tables.values()))
        if size > MAX_BYTES - HEAD_BYTES:
            raise BadFrame("oversized", f"{size} bytes of all processes")
        actions = Actions(index, drive != 0.0, linear_mps, angular_radps, lateral_mps, sent, **tables)
        return actions, self._memory(extras)

    def faults(self, answers: Sequence[AnswerFrame], *, is_step: bool = True) -> dict[int, str]:
        """The processes whose answers, each by itself, are at fault, and why.

        If there are none, the answers are together more than a world takes, of which the largest is at fault.
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
        return {largest.process: "oversized: with the other answers of its host more than a world takes"}

    def _sent(
        self, answers: Sequence[AnswerFrame], heads: list[bytes], payloads: list[bytes], acting: BoolArray | None
    ) -> SentPackets:
        """The packets of all answers."""
        sender, to, tx_status_id, sizes = np.frombuffer(b"".join(heads), np.int64).reshape(-1, 4).T.copy()
        data = np.frombuffer(b"".join(payloads), np.uint8)
        if sizes.min() < 0 or sizes.max() > len(data):  # so that their sum has no overflow
            raise BadFrame("malformed", "expected sizes of payloads that are there")
        offset, counts = offsets(sizes), [answer.packets for answer in answers]
        if (offset[np.cumsum(counts)] != np.cumsum([answer.payload_bytes for answer in answers])).any():
            raise BadFrame("malformed", "expected as many bytes of payloads as the sum of their sizes")
        self._check_own(sender, np.repeat([answer.process for answer in answers], counts), acting, "senders")
        if (to < BROADCAST).any():
            raise BadFrame("malformed", "expected receivers from 0, or -1 for all")
        is_measured = tx_status_id != NO_TX_STATUS
        if not is_measured.any():
            return SentPackets(sender, to, Payloads(data, offset))
        if (tx_status_id < NO_TX_STATUS).any() or (is_measured & (to == BROADCAST)).any():
            raise BadFrame("malformed", "expected ids of tx statuses from 0, or -1, as for every broadcast")
        return SentPackets(sender, to, Payloads(data, offset), tx_status_id)

    def _tables(self, extras: Sequence[tuple[int, Extras]], acting: BoolArray | None) -> dict[str, SparseTable]:
        """The sparse tables of all answers."""
        tables: dict[str, SparseTable] = {}
        if not extras:
            return tables
        if acting is None:
            raise BadFrame("malformed", "expected only packets between ticks")
        for name in ("leds", "actuators", "values"):
            parts = [(process, table) for process, extra in extras if (table := getattr(extra, name)) != EMPTY]
            for _, (rows, places, values) in parts:
                if not len(rows) == len(places) == len(values):
                    raise BadFrame("malformed", f"{name}: expected as many rows as places and values")
            index, place = (_joined([table[at] for _, table in parts], np.int64) for at in (0, 1))
            value = _joined([table[2] for _, table in parts], np.float64)
            self._check_own(index, _repeated(parts, [len(table[0]) for _, table in parts]), acting, name)
            if not np.isfinite(value).all():
                raise BadFrame("malformed", f"{name}: expected finite numbers")
            tables[name] = SparseTable(index, place, value) if len(index) else NOTHING_SET
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
        index = _joined([rows for _, (rows, _) in parts], np.int64)
        self._check_own(index, _repeated(parts, [len(rows) for _, (rows, _) in parts]), acting, "notes")
        if len(np.unique(index)) < len(index):
            raise BadFrame("malformed", "notes: expected each robot once")
        number = {state: at for at, state in enumerate(dict.fromkeys(of for _, (_, states) in parts for of in states))}
        if len(number) > MAX_STATES:
            raise BadFrame("oversized", f"notes: more than {MAX_STATES} states in one tick")
        value = np.array([number[state] for _, (_, states) in parts for state in states], np.float64)
        return SparseTable(index, np.zeros(len(index), np.int64), value, tuple(number))

    def _check_own(self, rows: IntArray, process: IntArray, acting: BoolArray | None, what: str) -> None:
        """BadFrame unless each row is of a robot of its process and, with a mask of those, one that acts."""
        if not len(rows):
            return
        is_own = rows.min() >= 0 and rows.max() < len(self._owner) and (self._owner[rows] == process).all()
        if is_own and (acting is None or acting[rows].all()):
            return
        raise BadFrame("malformed", f"{what}: expected the process's own robots that act in this tick")

    def _memory(self, extras: Sequence[tuple[int, Extras]]) -> GroupMemories | None:
        """The memory of all answers, by group."""
        parts: dict[str, list[tuple[IntArray, Mapping[str, bytes]]]] = {}
        for process, of in extras:
            for name, columns in of.memory.items():
                rows = self._rows[process].get(name)
                layout = self._layouts.get(name)
                if rows is None or layout is None or columns.keys() != layout.keys():
                    raise BadFrame("malformed", f"memory/{name}: expected the memory of the world's agents")
                for column, (code, shape) in layout.items():
                    if len(columns[column]) != len(rows) * _width(shape) * DTYPES[code].itemsize:
                        raise BadFrame("malformed", f"memory/{name}/{column}: expected {code} of shape {shape}")
                parts.setdefault(name, []).append((rows, columns))
        memory: GroupMemories = {}
        for name, of_group in parts.items():
            rows = np.concatenate([rows for rows, _ in of_group])
            order = np.argsort(rows)
            memory[name] = GroupMemory(
                rows[order],
                {
                    column: _column([of[column] for _, of in of_group], code, shape)[order]
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
    """The process of each row of a joined table."""
    return np.repeat(np.array([process for process, _ in parts], np.int64), np.array(counts, np.int64))


def in_order(actions: Actions, rows: IntArray) -> Actions:
    """The actions with their robots in the order of `rows`, which has at least these."""
    order = np.argsort(actions.rows)
    known = actions.rows[order]
    wanted = rows[np.isin(rows, known)]
    place = order[np.searchsorted(known, wanted)]
    columns: dict[str, FloatArray] = {
        name: getattr(actions, name)[place] for name in ("drive", "linear_mps", "angular_radps", "lateral_mps")
    }
    return replace(actions, rows=wanted, **columns)
