"""Messages: exact bytes on air, and nothing quietly cut to fit."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.robot.messages import (
    DICT_TAG,
    Message,
    decode_alike,
    decode_dict,
    decode_rows,
    encode_dict,
    encode_rows,
    f4,
    f8,
    i1,
    i2,
    i4,
    message_class,
    message_classes,
    u1,
    u2,
    u4,
)
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads


class Everything(Message):
    single: f4
    double: f8
    a: i1
    b: i2
    c: i4
    d: u1
    e: u2
    f: u4


class Beacon(Message):
    heading_rad: f4


class Empty(Message):
    pass


class Numbered(Beacon):
    number: u2


def integers(bits: int, signed: bool) -> st.SearchStrategy[float]:
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return st.integers(low, high).map(float)


everything = st.builds(
    Everything,
    single=st.floats(width=32, allow_nan=False),
    double=st.floats(allow_nan=False),
    a=integers(8, True),
    b=integers(16, True),
    c=integers(32, True),
    d=integers(8, False),
    e=integers(16, False),
    f=integers(32, False),
)


@given(everything)
def test_message_survives_encoding_in_plain_floats(message: Everything) -> None:
    decoded = Everything.decode(message.encode())
    assert decoded == message
    assert all(type(value) is float for value in vars(decoded).values())


@given(st.floats(-1e30, 1e30))
def test_narrow_field_carries_the_nearest_number(value: float) -> None:
    assert Beacon.decode(Beacon(heading_rad=value).encode()).heading_rad == float(np.float32(value))


def test_message_is_its_tag_and_fields_in_little_endian_without_padding() -> None:
    assert Everything.size_bytes == TAG_BYTES + 4 + 8 + 1 + 2 + 4 + 1 + 2 + 4
    assert Empty.size_bytes == TAG_BYTES
    for message in (Empty(), Beacon(heading_rad=1.0), Numbered(heading_rad=1.0, number=2)):
        assert len(message.encode()) == type(message).size_bytes
        assert int.from_bytes(message.encode()[:TAG_BYTES], "little") == message.tag
    assert Numbered(heading_rad=1.0, number=0x0102).encode()[TAG_BYTES:] == bytes.fromhex("0000803f 0201")


def test_tag_depends_on_class_name_and_fields() -> None:
    def tag_of(name: str, **fields: Any) -> int:
        return type(name, (Message,), {"__annotations__": fields}).tag

    named = [
        ("A", {"x": f4}),
        ("B", {"x": f4}),
        ("A", {"y": f4}),
        ("A", {"x": f8}),
        ("A", {"x": f4, "y": f4}),
        ("A", {}),
    ]
    tags = [tag_of(name, **fields) for name, fields in named]
    assert len(set(tags)) == len(tags)
    assert tags == [tag_of(name, **fields) for name, fields in named]
    assert all(DICT_TAG < tag < 2**16 for tag in tags)


def test_decode_alike_accepts_one_class_only() -> None:
    payloads = [Beacon(heading_rad=0.5).encode(), Beacon(heading_rad=1.5).encode()]
    index, table = np.array([1, 0, 1]), Payloads.from_rows(payloads)
    alike = decode_alike(Beacon, table, index)
    assert alike is not None
    assert alike["heading_rad"].tolist() == decode_rows(Beacon, table, index)["heading_rad"].tolist()
    assert decode_alike(Beacon, Payloads.from_rows([*payloads, Empty().encode()]), index) is None


def test_message_is_frozen() -> None:
    beacon = Beacon(heading_rad=1.0)
    with pytest.raises(AttributeError, match=r"frozen: Beacon\.heading_rad"):
        beacon.heading_rad = 2.0
    assert beacon.heading_rad == 1.0


def test_equal_messages_hash_alike() -> None:
    assert Beacon(heading_rad=1.0) == Beacon(heading_rad=1)
    assert hash(Beacon(heading_rad=1.0)) == hash(Beacon(heading_rad=1))
    assert Beacon(heading_rad=1.0) != Beacon(heading_rad=2.0)
    assert Beacon(heading_rad=1.0) != Empty()


@pytest.mark.parametrize("fields", [{}, {"heading_rad": 1.0, "speed_mps": 2.0}, {"heading": 1.0}])
def test_field_that_is_missing_or_unknown_is_refused(fields: dict[str, float]) -> None:
    with pytest.raises(TypeError, match="Beacon has the fields heading_rad"):
        Beacon(**fields)
    with pytest.raises(TypeError, match="Beacon has the fields heading_rad"):
        encode_rows(Beacon, 1, fields)


@pytest.mark.parametrize(
    ("name", "hint", "values", "fault"),
    [
        *(("x", hint, {}, "expected one of f4") for hint in (float, int, str, "list[float]")),
        ("x", f4, {"x": 1.0}, "a field has no default"),
        *((name, f4, {}, ".*taken") for name in ("encode", "on_air", "rows", "size_bytes", "tag", "to")),
    ],
)
def test_field_that_is_impossible_is_refused_at_class_creation(
    name: str, hint: object, values: dict[str, Any], fault: str
) -> None:
    with pytest.raises(TypeError, match=rf"Odd\.{name}: {fault}"):
        type("Odd", (Message,), {"__annotations__": {name: hint}, **values})


@pytest.mark.parametrize("other", [Message, dict, "Beacon", None, Empty()])
def test_message_class_refuses_anything_else(other: object) -> None:
    assert message_class(Beacon) is Beacon
    with pytest.raises(TypeError, match="expected a class of messages, got"):
        message_class(other)


def test_message_classes_include_subclasses() -> None:
    class Further(Beacon): ...

    assert {Beacon, Further, Everything} <= set(message_classes())


@pytest.mark.parametrize("value", [None, "fast", [1.0, 2.0], np.zeros(2)])
def test_field_value_that_is_no_number_is_refused(value: Any) -> None:
    with pytest.raises(TypeError, match=r"Beacon\.heading_rad: expected a number, got"):
        Beacon(heading_rad=value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("a", 128), ("a", -129), ("d", -1), ("d", 256), ("e", 65536), ("f", -1)),
        *(("e", float("nan")), ("e", float("inf")), ("single", 1e39), ("single", -1e39)),
    ],
)
def test_field_refuses_numbers_out_of_its_range(name: str, value: float) -> None:
    fields = dict.fromkeys(Everything.ranges, 0.0) | {name: value}
    with pytest.raises(OverflowError, match=rf"Everything\.{name}: "):
        Everything(**fields).encode()


@pytest.mark.parametrize(
    ("value", "nearest"),
    [
        *((1.4, 1.0), (1.6, 2.0), (-1.4, -1.0), (-1.6, -2.0), (127.4, 127.0), (-128.4, -128.0)),
        *((0.5, 0.0), (1.5, 2.0), (2.5, 2.0), (-1.5, -2.0)),  # halves to the even number
    ],
)
def test_integer_field_rounds_fractions_to_nearest(value: float, nearest: float) -> None:
    fields = dict.fromkeys(Everything.ranges, 0.0)
    assert Everything.decode(Everything(**fields | {"a": value}).encode()).a == nearest
    rows = encode_rows(Everything, 2, fields | {"a": np.array([value, -7.0])})
    assert decode_rows(Everything, rows, np.arange(2))["a"].tolist() == [nearest, -7.0]


@pytest.mark.parametrize("payload", [b"", b"\0", Empty().encode(), Beacon(heading_rad=0.0).encode() + b"\0"])
def test_bytes_of_another_class_are_refused(payload: bytes) -> None:
    with pytest.raises(ValueError, match="no Beacon"):
        Beacon.decode(payload)


@given(st.lists(everything, max_size=6))
def test_rows_encode_and_decode_like_single_messages(messages: list[Everything]) -> None:
    columns = {name: np.array([getattr(m, name) for m in messages]) for name in Everything.ranges or ()}
    payloads = encode_rows(Everything, len(messages), columns)
    assert [payloads.row(i) for i in range(len(payloads))] == [message.encode() for message in messages]
    decoded = decode_rows(Everything, payloads, np.arange(len(messages)))
    for name, column in decoded.items():
        assert column.dtype == np.float64
        assert np.array_equal(column, columns[name])


def test_rows_decode_from_among_payloads_of_other_classes() -> None:
    rows = encode_rows(Numbered, 3, {"heading_rad": 0.5, "number": np.arange(3)})  # one number fills all rows
    first, second, third = (rows.row(i) for i in range(3))
    payloads = Payloads.from_rows([b"", first, Empty().encode(), second, third])
    index = np.flatnonzero(payloads.tags() == Numbered.tag)
    decoded = decode_rows(Numbered, payloads, index[::-1])
    assert (decoded["number"].tolist(), decoded["heading_rad"].tolist()) == ([2.0, 1.0, 0.0], [0.5] * 3)


def test_message_without_fields_encodes_as_its_tag() -> None:
    payloads = encode_rows(Empty, 2, {})
    assert payloads.tags().tolist() == [Empty.tag] * 2
    assert Empty.decode(payloads.row(1)) == Empty()
    assert decode_rows(Empty, payloads, np.arange(2)) == {}


plain = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False) | st.text(max_size=5)


@given(st.dictionaries(st.text(max_size=5), plain | st.lists(plain, max_size=3), max_size=4))
def test_dict_survives_encoding(message: dict[str, Any]) -> None:
    payload = encode_dict(message)
    assert Payloads.from_rows([payload]).tags().tolist() == [DICT_TAG]
    assert decode_dict(payload) == message


UNHASHABLE = (b"\0\0\x81\x80\x01", b"\0\0\x81\x90\x01")  # a map with a map or a list as its key


@pytest.mark.parametrize(
    "payload", [b"\0\0", b"\0\0\x01", b"\0\0\x81", b"\0\0\x80\x80", b"\0\0\xc1", b"\0\0\x81\xa1\xff\0", *UNHASHABLE]
)
def test_bytes_without_a_dict_are_refused(payload: bytes) -> None:
    with pytest.raises(ValueError):
        decode_dict(payload)


def test_dict_is_not_decoded_as_a_message_of_its_length() -> None:
    payload = encode_dict({"heading": "x" * 20})
    kind = type("AsLong", (Message,), {"__annotations__": {f"b{i}": u1 for i in range(len(payload) - TAG_BYTES)}})
    assert kind.size_bytes == len(payload)
    assert decode_alike(kind, Payloads.from_rows([payload]), np.array([0])) is None


@pytest.mark.parametrize("message", [{1: "one"}, {None: 1}, {(1, 2): 1}, {"a": {(1, 2): 3}}])
def test_dict_with_other_keys_than_texts_is_refused(message: dict[Any, Any]) -> None:
    with pytest.raises(TypeError, match="a dict message has texts as keys"):
        encode_dict(message)


@pytest.mark.parametrize("column", [np.zeros(2), np.zeros((3, 1)), [[1.0], [2.0], [3.0]]])
def test_column_of_another_length_is_refused(column: Any) -> None:
    with pytest.raises(ValueError, match=r"Numbered.heading_rad: expected one number or an array \(3,\)"):
        encode_rows(Numbered, 3, {"heading_rad": column, "number": 1})
