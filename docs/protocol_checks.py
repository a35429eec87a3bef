"""Checks that docs/protocol.md says what the code does: keys, fields, arrays, kinds of frames, limits and counts."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np

from swarmwire.agent import runner_protocol
from swarmwire.agent.behaviours.flocking import Heading
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, SentPackets, TxResult, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, SparseTable
from swarmwire.comms.wire import frames, join, tick_frames
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment
from swarmwire.comms.wire.join import GroupInfo, JoinRequest, SessionInfo
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.limits import LIMITS, MAX_BYTES
from swarmwire.comms.wire.tick_frames import encode_actions, encode_tick
from swarmwire.world.backends import inbox, join_policy, lockstep, realtime, registry, zenoh_backend

PAGE = Path(__file__).parent / "protocol.md"
ROWS = np.array([4, 6])
ENCODERS = (runner_protocol, tick_frames, zenoh_backend)
COUNTERS = (frames, frames, tick_frames, join_policy, registry, lockstep, realtime, inbox)


def protocol_page() -> Iterator[str]:
    """What the page tells, each time beside what the code has."""
    page = _Page(PAGE.read_text(encoding="utf-8"))
    for subject, documented, ours in (*_joining(page), *_frames(page), *_numbers(page)):
        if documented != ours:
            yield f"docs/protocol.md: {subject}: the page has {documented}, the code has {ours}"


class _Page:
    def __init__(self, text: str) -> None:
        self.text = text

    def table(self, name: str) -> dict[str, list[str]]:
        """The other cells of each row of a table, by the first; empty where there is no such table."""
        matched = re.search(rf"<!-- table: {name} -->\n((?:\|.*\n)+)", self.text)
        lines = matched[1].splitlines()[2:] if matched else []
        rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
        return {row[0].strip("`").replace("\\|", "|"): [cell.replace("\\|", "|") for cell in row[1:]] for row in rows}

    def arrays(self, name: str) -> dict[str, tuple[str, int]]:
        """Dtype and number of axes of each array in a table."""
        return {array: (dtype.strip("`"), _axes(shape)) for array, (dtype, shape, _) in self.table(name).items()}


Comparison = tuple[str, Any, Any]  # of what, as the page has it, as the code has it


def _joining(page: _Page) -> Iterator[Comparison]:
    version = str(frames.VERSION)
    yield "the version in examples", set(re.findall(r'"v": (\d)', page.text)), {version}
    for name in ("session_info", "join request", "assignment", "frame"):
        yield f"the version in {name}", page.table(name).get("v", ["", ""])[1], version
    keys = Keys("RUN")
    named = {f"`{getattr(keys, key)('NAME')}`" for key in ("session_info", "join", "alive", "frame", "answer")}
    named.add(f"`{keys.world}`")
    yield "keys", named & set(page.text.split()), named
    group = GroupAssignment("g", "a", {}, load_body("epuck"), ROWS, ("g-0", "g-1"), np.zeros(2, np.uint64))
    assigned = Assignment((group,), 1, ()).as_mapping()
    for name, keys_of_it in {
        "session_info": _names(SessionInfo) | {"v"},
        "group": _names(GroupInfo),
        "join request": _names(JoinRequest) | {"v"},
        "assignment": {*assigned, "v", "memory", "memory_columns", "timeout_s", "answer_within_s"},
        "assigned group": set(assigned["groups"][0]),
        "frame": set(msgpack.unpackb(frames.encode("end", -1, {}))),
    }.items():
        yield f"fields of {name}", set(page.table(name)), keys_of_it


def _frames(page: _Page) -> Iterator[Comparison]:
    packet_row, zeros = np.zeros(1, np.int64), np.zeros(2)
    received = ReceivedPackets(
        packet_row,
        packet_row,
        packet_row,
        packet_row,
        {"range_m": np.zeros(1)},
        packet_row,
        Payloads.from_rows([b"abc"]),
    )
    sensors = {"GROUP": GroupReadings(ROWS, {"SENSOR.FIELD": np.zeros(2)})}
    sent = SentPackets(ROWS, np.array([BROADCAST, 1]), Payloads.from_rows([b"a", b"b"]), np.array([-1, 0]))
    actions = replace(
        Actions(ROWS, zeros == 0, zeros, zeros, zeros, sent, SparseTable(ROWS, ROWS, zeros, ("x",))),
        **dict.fromkeys(("leds", "actuators", "values", "motors"), SparseTable(ROWS, ROWS, zeros)),
    )
    tick = encode_tick(0, sensors, received, TxStatuses(packet_row, packet_row, packet_row))
    for name, data in (("tick", tick), ("actions", encode_actions(0, actions))):
        ours = {array: (value.dtype.str, value.ndim) for array, value in frames.decode(data).arrays.items()}
        yield f"arrays of {name}", page.arrays(name), ours
    encoded = set(re.findall(r'frames\.encode\("(\w+)"', _source(*ENCODERS)))
    yield "kinds of frames", encoded & page.table("kinds").keys(), encoded


def _numbers(page: _Page) -> Iterator[Comparison]:
    sizes = {code: dtype.itemsize for code, dtype in frames.DTYPES.items()}
    yield "bytes of dtypes", {code: int(size) for code, (_, size) in page.table("dtypes").items()}, sizes
    yield "results of sending", [int(number) for number in page.table("results")], [key.value for key in TxResult]
    yield "the tag of Heading", re.findall(r"<!-- tag: Heading -->(\d+)", page.text), [str(Heading.tag)]
    limits = {field.name: float(getattr(LIMITS, field.name)) for field in fields(LIMITS)}
    limits |= {"frame": MAX_BYTES, "items": frames.MAX_ITEMS, "request to join": join.MAX_JOIN_BYTES}
    yield "limits", {name: float(value.split()[0]) for name, (value, _) in page.table("limits").items()}, limits
    source = _source(*COUNTERS)
    counted = {f"{fault}_frames" for fault in re.findall(r'BadFrame\("(\w+)"', source)}
    counted |= set(re.findall(r'"((?:bad|refused)_join|flooded_(?:frames|requests))"', source))
    yield "counts", set(page.table("counted")), counted


def _names(key: type[Any]) -> set[str]:
    return {field.name for field in fields(key)}


def _axes(shape: str) -> int:
    return len([length for length in shape.split(")", maxsplit=1)[0].strip("(").split(",") if length])


def _source(*modules: Any) -> str:
    return "".join(map(inspect.getsource, modules))
