"""Thrift's compact protocol, in which the footer of a Parquet file is written.

A struct is read as {field: (kind, value)}, a list as (kind of its items, items), whole numbers of any size as int.
Doubles, sets and maps do not occur in footers and are refused, nor do lists of truth values.
https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from typing import Any

Struct = dict[int, tuple[int, Any]]

TRUE, FALSE, I16, I32, I64, BINARY, LIST, STRUCT = 1, 2, 4, 5, 6, 8, 9, 12
NIBBLE = 15  # the most that four bits hold: a longer list has its length after them


def read_struct(data: bytes, at: int = 0) -> tuple[Struct, int]:
    """The struct that begins at this byte, and where it ends; ValueError or IndexError if there is none."""
    fields: Struct = {}
    field = 0
    while head := data[at]:
        field, at = (field + (head >> 4), at + 1) if head >> 4 else _read_number(data, at + 1)
        value, at = _read(data, at, head & NIBBLE)
        fields[field] = (head & NIBBLE, value)
    return fields, at + 1


def written_struct(fields: Struct) -> bytes:
    """The bytes of a struct, as `read_struct` reads it."""
    parts: list[bytes] = []
    before = 0
    for field, (kind, value) in sorted(fields.items()):
        step = field - before
        parts.append(bytes([step << 4 | kind]) if step <= NIBBLE else bytes([kind]) + _number(field))
        parts.append(_written(kind, value))
        before = field
    return b"".join([*parts, b"\0"])


def _read(data: bytes, at: int, kind: int) -> tuple[Any, int]:
    if kind in (I16, I32, I64):
        return _read_number(data, at)
    if kind == BINARY:
        length, at = _read_varint(data, at)
        return data[at : at + length], at + length
    if kind == STRUCT:
        return read_struct(data, at)
    if kind in (TRUE, FALSE):
        return None, at  # of a field, the kind says which
    if kind != LIST:
        raise ValueError(f"no kind of value that a footer has: {kind}")
    length, item, at = data[at] >> 4, data[at] & NIBBLE, at + 1
    if length == NIBBLE:
        length, at = _read_varint(data, at)
    items: list[Any] = []
    for _ in range(length):
        value, at = _read(data, at, item)
        items.append(value)
    return (item, items), at


def _written(kind: int, value: Any) -> bytes:
    if kind in (I16, I32, I64):
        return _number(value)
    if kind == BINARY:
        return _varint(len(value)) + value
    if kind == STRUCT:
        return written_struct(value)
    if kind in (TRUE, FALSE):
        return b""
    item, items = value
    length = len(items)
    head = bytes([length << 4 | item]) if length < NIBBLE else bytes([NIBBLE << 4 | item]) + _varint(length)
    return head + b"".join(_written(item, one) for one in items)


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    number = shift = 0
    while (byte := data[at]) > 127:
        number |= (byte & 127) << shift
        shift, at = shift + 7, at + 1
    return number | byte << shift, at + 1


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    found.append(number)
    return bytes(found)


def _read_number(data: bytes, at: int) -> tuple[int, int]:
    """A signed number: 0, -1, 1, -2 are written as 0, 1, 2, 3."""
    number, at = _read_varint(data, at)
    return number >> 1 ^ -(number & 1), at


def _number(number: int) -> bytes:
    return _varint(number << 1 if number >= 0 else (-number << 1) - 1)
