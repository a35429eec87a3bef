"""Hypothesis draws that mutate samples: bytes, and documents (msgpack, JSON, TOML, CSV) as trees of plain values.

A sample is mutated in one to five places. The values that come in are limits of types, numbers that are not finite,
texts that look like something else, and parts of other samples. No sample is ever written to.
"""

import csv
import io
import json
import struct
import tomllib
from collections.abc import Callable, Sequence
from functools import cache
from math import prod
from typing import Any, NamedTuple, TypeVar

import msgpack
import tomli_w
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

T = TypeVar("T")
MAX_BYTES = 1 << 20  # repeated doubling would only test the machine's memory
MUTATIONS = st.sampled_from((1, 1, 1, 1, 2, 2, 3, 5))

INTEGERS = (
    *(0, 1, -1, 2, 7, 10, 127, 128, 255, 256, -128, 32767, 65535, 65536, 10**6, 2**24, 2**31 - 1, 2**31, 2**32),
    *(-(2**31), 2**53 + 1, 2**62, 2**63 - 1, 2**63, 2**64 - 1, -(2**63), 2**64, -(2**63) - 1, 10**30),
)
FLOATS = (
    *(0.0, -0.0, 0.5, -1.0, 1e-9, 5e-324, 1e-308, 1e9, 1e18, 1e19, 1e154, 1e300, 1.7976931348623157e308),
    *(float("nan"), float("inf"), float("-inf"), 2.0**31, 2.0**53, 2.0**63, -(2.0**63), 1 / 3),
)
TEXTS = (
    *("", " ", "\n", "\x00", "a\x00b", "ä", "\u202e", "\U0001f41d", "\ufeff", "\x1b[31m", "%s%n", "{}", "../..", "/"),
    *(".", "nan", "inf", "-inf", "0", "-1", "0.5", "1e308", "1e999", "1e19", "9223372036854775808", "0x10", "true"),
    *("null", "*", "**", "a/b", '"', "-0", "\ud7ff", "é" * 300, "a" * 70, "x" * 5000, "file.py:Agent", "os:system"),
    *("swarmwire.agent.behaviours:Flocking", "robots.flock"),
)
FRAGMENTS = (
    *(b"\x00", b"\xff", b"\xc1", b"\xc0", b"\x80", b"\x90", b"\xde\xff\xff", b"\xdd\xff\xff\xff\xff"),
    *(b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\xdb\x7f\xff\xff\xff", b"\x91" * 600, b"\x81\x01" * 600),
    *(b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\r\n", b"[[", b"=", b'"""', b"[" * 600, b"{" * 600),
    *(struct.pack(order + kind, value) for order in "<>" for kind, value in (("d", 1e308), ("q", -(2**63)), ("i", -1))),
    *(struct.pack("<d", value) for value in (float("nan"), float("inf"), -0.0, 2.0**63)),
    *(struct.pack(order + "I", value) for order in "<>" for value in (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 1)),
    *(struct.pack(order + "H", value) for order in "<>" for value in (0xFFFF, 0x7FFF, 0x8000)),
)


def pick(draw: DrawFn, items: Sequence[T]) -> T:
    """One of the items."""
    return items[draw(st.integers(0, len(items) - 1))]


def one_in(draw: DrawFn, count: int) -> bool:
    """True in about one case of `count`; shrinks to False."""
    return draw(st.integers(0, count - 1)) == count - 1


def mutated_bytes(draw: DrawFn, data: bytes, corpus: Sequence[bytes]) -> bytes:
    """The data after some mutations, as a broken link, disk or sender makes them."""
    for _ in range(draw(MUTATIONS)):
        start, size = draw(st.integers(0, len(data))), pick(draw, (1, 2, 4, 7, 8, 21, 64, len(data)))
        new = _piece(draw, data[start : start + size], data[start + size :], corpus)
        data = (data[:start] + new)[:MAX_BYTES]
    return data


def _piece(draw: DrawFn, piece: bytes, tail: bytes, corpus: Sequence[bytes]) -> bytes:
    """What a piece of the data and the rest after it become."""
    match draw(st.integers(0, 10)):
        case 0:  # deleted
            return tail
        case 1:  # truncated
            return b""
        case 2:  # a bit flipped
            return bytes([byte ^ 1 << draw(st.integers(0, 7)) for byte in piece[:1]]) + piece[1:] + tail
        case 3:  # overwritten
            return draw(st.binary(min_size=len(piece[:16]), max_size=16)) + tail
        case 4:
            fragment = pick(draw, FRAGMENTS)
            return fragment + (piece + tail)[len(fragment) :]
        case 5:  # something inserted
            return pick(draw, FRAGMENTS) + piece + tail
        case 6:  # repeated
            return piece * pick(draw, (2, 3, 5)) + tail
        case 7:  # moved
            to = draw(st.integers(0, len(tail)))
            return tail[:to] + piece + tail[to:]
        case 8:  # a number, such as a length, is one more or less, twice or half as large, or as large as it can be
            field, order = piece[:4], pick(draw, ("little", "big"))
            value, mask = int.from_bytes(field, order), (1 << 8 * len(field)) - 1
            value = pick(draw, (value + 1, value - 1, value * 2, value // 2, mask)) & mask
            return value.to_bytes(len(field), order) + piece[4:] + tail
        case splice:  # another sample goes on, or a part of it comes in between
            other = pick(draw, corpus)
            other = other[draw(st.integers(0, len(other))) :]
            return other if splice == 9 else other[: len(piece)] + piece + tail


class Codec(NamedTuple):
    """How a tree is written as bytes, and read from them."""

    pack: Callable[[Any], bytes]
    unpack: Callable[[bytes], Any]


def _csv_table(data: bytes) -> Any:
    header, *rows = csv.reader(io.StringIO(data.decode()))
    return {"header": header, "rows": rows}


def _csv_bytes(table: Any) -> bytes:
    return "".join(",".join(map(str, row)) + "\n" for row in (table["header"], *table["rows"])).encode()


MSGPACK = Codec(msgpack.packb, msgpack.unpackb)
JSON = Codec(lambda tree: json.dumps(tree).encode(), json.loads)
JSON_LINES = Codec(
    lambda trees: b"".join(JSON.pack(tree) + b"\n" for tree in trees),
    lambda data: [json.loads(line) for line in data.splitlines()],
)
TOML = Codec(lambda tree: tomli_w.dumps(tree).encode(), lambda data: tomllib.loads(data.decode()))
CODECS = {".json": JSON, ".jsonl": JSON_LINES, ".toml": TOML, ".csv": Codec(_csv_bytes, _csv_table)}
UNREADABLE = (ValueError, TypeError, AttributeError, KeyError, OverflowError, RecursionError)


def mutated_document(
    draw: DrawFn, data: bytes, corpus: Sequence[bytes], codec: Codec, inner: Sequence[str] = ()
) -> bytes:
    """A document with its tree mutated, mostly below the keys `inner`, or, in a third of the cases, its bytes."""
    if draw(st.integers(0, 2)) < 2:
        try:
            tree, others = _unpacked(codec, data), [_unpacked(codec, other) for other in corpus]
            keys = [key for key in inner if isinstance(tree, dict) and tree.get(key)]
            if not keys or one_in(draw, 3):
                return codec.pack(mutated_tree(draw, tree, others))
            key = pick(draw, keys)
            parts = [other[key] for other in others if isinstance(other, dict) and key in other]
            return codec.pack({**tree, key: mutated_tree(draw, tree[key], parts)})
        except UNREADABLE:  # the sample or the mutated tree cannot be written in this format
            pass
    return mutated_bytes(draw, data, corpus)


@cache
def _unpacked(codec: Codec, data: bytes) -> Any:
    return codec.unpack(data)


def mutated_tree(draw: DrawFn, tree: Any, corpus: Sequence[Any]) -> Any:
    """The tree after some mutations."""
    for _ in range(draw(MUTATIONS)):
        tree = _mutated(draw, tree, corpus)
    return tree


def _mutated(draw: DrawFn, node: Any, corpus: Sequence[Any]) -> Any:
    """The same with one part mutated, however deep."""
    if isinstance(node, dict | list) and node:
        at = draw(st.integers(0, len(node) + (2 if _is_array(node) else 0)))
        if at < len(node) and isinstance(node, dict):
            key = list(node)[at]
            return {**node, key: _mutated(draw, node[key], corpus)}
        if at < len(node):
            return [*node[:at], _mutated(draw, node[at], corpus), *node[at + 1 :]]
    match draw(st.integers(0, 11)):
        case 0:
            return pick(draw, pick(draw, ((None, True, False, [], {}, [[]], {"": None}, b""), INTEGERS, FLOATS, TEXTS)))
        case 1:
            return _part(draw, pick(draw, corpus))
        case 2:
            in_maps = draw(st.booleans())
            for _ in range(pick(draw, (3, 30, 200))):  # msgpack itself ends at 512
                node = {"a": node} if in_maps else [node]
            return node
        case _:
            return _of_its_type(draw, node, corpus)


def _part(draw: DrawFn, tree: Any) -> Any:
    """A part of a tree, or all of it."""
    parts = list(tree.values()) if isinstance(tree, dict) else tree
    at = draw(st.integers(0, len(parts))) if isinstance(parts, list) else 0
    return _part(draw, parts[at]) if isinstance(parts, list) and at < len(parts) else tree


def _of_its_type(draw: DrawFn, node: Any, corpus: Sequence[Any]) -> Any:
    if isinstance(node, dict):
        return _mutated_map(draw, node, corpus)
    if isinstance(node, list):
        if _is_array(node) and not one_in(draw, 4):
            return _mutated_array(draw, *node)
        at = draw(st.integers(0, len(node)))
        items, tail = node[at : at + 1], node[at + 1 :]
        return node[:at] + pick(draw, (tail, (items or [None]) * pick(draw, (2, 3, 400)) + tail, tail[::-1] + items))
    if isinstance(node, str):
        at, text = draw(st.integers(0, len(node))), pick(draw, TEXTS)
        return pick(draw, (node[:at], node[at:], node + node, node[:at] + text + node[at:], text))
    if isinstance(node, bytes):
        return _mutated_items(draw, node)
    if type(node) in (int, float):
        values = (node + 1, node - 1, -node, node * 2, node * 10, node / 10, str(node))
        return pick(draw, pick(draw, (values, INTEGERS, FLOATS)))
    return pick(draw, (None, True, False, *INTEGERS[:3], *TEXTS[:3]))


def _mutated_map(draw: DrawFn, node: dict[Any, Any], corpus: Sequence[Any]) -> Any:
    """A key dropped, renamed or added, or two values swapped."""
    keys = [*node, ""]
    key, other = pick(draw, keys), pick(draw, keys)
    match draw(st.integers(0, 3)):
        case 0:
            return {name: value for name, value in node.items() if name != key}
        case 1:
            new = pick(draw, (f"{key}x", str(key)[:-1], str(key).upper(), pick(draw, TEXTS)))
            return {new if name == key else name: value for name, value in node.items()}
        case 2:
            source = _part(draw, pick(draw, corpus))
            source = source if isinstance(source, dict) and source else {pick(draw, TEXTS): source}
            new = pick(draw, list(source))
            return {**node, new: source[new]}
        case _:
            return {**node, key: node.get(other), other: node.get(key)}


def _is_array(node: Any) -> bool:
    """Whether it is an array of a frame: dtype, shape, bytes."""
    return isinstance(node, list) and [type(part) for part in node] == [str, list, bytes]


def _mutated_array(draw: DrawFn, dtype: str, shape: list[Any], data: bytes) -> Any:
    """It mostly stays an array: of another shape or dtype, a column more or less, no item, or another item."""
    sizes = [size for size in shape if type(size) is int and 0 < size < 1000]
    match draw(st.integers(0, 4)):
        case 0:
            flat = prod(sizes)
            return [dtype, pick(draw, ([flat], [1, flat], [flat, 1], [0, flat], shape[::-1])), data]
        case 1 if sizes and sizes == shape and len(data) >= prod(sizes):
            width = len(data) // prod(sizes[:-1])
            item, rows = width // sizes[-1], [data[at : at + width] for at in range(0, len(data), width)]
            if draw(st.booleans()):
                return [dtype, [*shape[:-1], shape[-1] + 1], b"".join(row + row[:item] for row in rows)]
            return [dtype, [*shape[:-1], shape[-1] - 1], b"".join(row[item:] for row in rows)]
        case 2:
            return [pick(draw, ("<f8", "<i8", "<u8", "|b1", "|u1", "<f4", ">i8", "O", "")), shape, data]
        case 3:
            return [dtype, pick(draw, ([*shape[:-1], 0], [0])), b""]
        case _:
            return [dtype, shape, _mutated_items(draw, data)]


def _mutated_items(draw: DrawFn, data: bytes) -> bytes:
    """Eight bytes become another number, or the length changes."""
    if len(data) < 8 or one_in(draw, 5):
        return pick(draw, (data[:-1], data + b"\x00", data[: draw(st.integers(0, len(data)))], data[::-1]))
    at = 8 * draw(st.integers(0, len(data) // 8 - 1))
    number = pick(draw, pick(draw, (INTEGERS, FLOATS)))
    item = struct.pack("<d", number) if isinstance(number, float) else (number % 2**64).to_bytes(8, "little")
    return data[:at] + item + data[at + 8 :]
