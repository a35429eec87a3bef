"""Frames: what is packed comes back; whatever else arrives is a BadFrame, and takes no more memory than its bytes."""

import tracemalloc
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import DTYPES, MAX_ITEMS, UNCOUNTED_BYTES, unpacked
from tests.support.comms.equality import equal

shapes = npst.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=4)
arrays = st.sampled_from(sorted(DTYPES)).flatmap(lambda code: npst.arrays(DTYPES[code], shapes))
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
ticks = st.integers(-1, 2**62)
names = st.text(max_size=8)


def frame_with(**changes: Any) -> bytes:
    """A frame of one array of two numbers, with parts of its map replaced."""
    item = ("<f8", [2], bytes(16))
    return msgpack.packb(
        {"v": frames.VERSION, "kind": "tick", "tick": 3, "arrays": {"a": item}, "values": {}, **changes}
    )


def fault(data: bytes, **limits: int) -> str:
    with pytest.raises(BadFrame) as caught:
        frames.decode(data, **limits)
    return caught.value.fault


@given(
    st.text(max_size=8), ticks, st.dictionaries(names, arrays, max_size=4), st.dictionaries(names, plain, max_size=3)
)
def test_frame_survives_encoding(kind: str, tick: int, given_arrays: dict[str, AnyArray], values: Any) -> None:
    frame = frames.decode(frames.encode(kind, tick, given_arrays, values))
    assert (frame.kind, frame.tick, frame.values) == (kind, tick, values)
    assert list(frame.arrays) == list(given_arrays)
    assert equal(dict(frame.arrays), given_arrays)


def test_frame_layout_is_fixed_in_msgpack() -> None:
    """Written out, so that the two sides cannot change together without a new version."""
    data = frames.encode("tick", 3, {"a": np.array([[0.5], [1.0]])}, {"b": 1})
    array = ["<f8", [2, 1], b"\0\0\0\0\0\0\xe0\x3f\0\0\0\0\0\0\xf0\x3f"]
    assert msgpack.unpackb(data) == {"v": 1, "kind": "tick", "tick": 3, "arrays": {"a": array}, "values": {"b": 1}}


def test_frame_is_limited_to_64_megabytes() -> None:
    assert fault(bytes(2**26)) == "malformed"
    assert fault(bytes(2**26 + 1)) == "oversized"


def test_frame_packs_noncontiguous_arrays() -> None:
    array = np.arange(12.0).reshape(3, 4).T[::2]
    assert np.array_equal(frames.decode(frames.encode("k", 0, {"a": array})).arrays["a"], array)


@pytest.mark.parametrize("code", sorted(DTYPES))
def test_frame_and_its_arrays_are_read_only(code: str) -> None:
    frame = frames.decode(frames.encode("k", 0, {"a": np.zeros(3, code)}))
    assert not frame.arrays["a"].flags.writeable
    with pytest.raises(AttributeError):
        frame.tick = 4  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    "changes",
    [
        *({"v": value} for value in (2, 0, True, 1.0, "1")),
        *({"kind": value} for value in (b"tick", 3)),
        *({"tick": value} for value in ("3", 3.0, True, None)),
        *({"arrays": value} for value in ([], None, {b"a": ("<f8", [2], bytes(16))})),
        *({"values": value} for value in ([], {b"a": 1})),
        {"more": 1},
    ],
    ids=repr,
)
def test_frame_with_other_keys_or_types_is_malformed(changes: dict[str, Any]) -> None:
    assert fault(frame_with(**changes)) == "malformed"


@pytest.mark.parametrize("key", ["v", "kind", "tick", "arrays", "values"])
def test_frame_with_a_missing_key_is_malformed(key: str) -> None:
    body = msgpack.unpackb(frame_with())
    del body[key]
    assert fault(msgpack.packb(body)) == "malformed"


@pytest.mark.parametrize(
    "item",
    [
        *((dtype, [2], bytes(16)) for dtype in (">f8", "|O", ["<f8"], b"<f8")),
        *(("<f8", shape, bytes(16)) for shape in (2, [3], [1], [], [-1], [2.0], ["2"], [1, 1, 2], [1, 1], [0, 2])),
        *(("<f8", shape, bytes(16)) for shape in ([2, True], [-1, -2], [2**63])),
        ("<f8", [2**61 + 2], bytes(16)),  # 8 x this is 16, modulo 2^64
        *(("<f8", shape, bytes(15)) for shape in ([2], [1, 2])),
        ("<f8", [], bytes(8)),
        *(("<f8", shape, b"") for shape in ([None], [-2, 0], [2**61], [2**32, 2**32], [0, 2**63], [2**63, 0])),
        *(("|b1", *item) for item in (([False], b""), ([2], b"\x01\x02"), ([1], b"\xff"), ([1, 2], b"\x01\x02"))),
        *(("<f4", [4], bytes(16)), ("<f8,<f8", [1], bytes(16)), ("|u1", [True], bytes(1))),
        *(("<f8", [2], "0123456789abcdef"), ("<f8", [2], None), ("<f8", [2]), ("<f8", [2], bytes(16), 1)),
        {"dtype": "<f8"},
        7,
        None,
    ],
    ids=repr,
)
def test_frame_array_that_does_not_fit_its_bytes_is_malformed(item: Any) -> None:
    assert fault(frame_with(arrays={"a": item})) == "malformed"


@pytest.mark.parametrize("shape", [[0], [0, 5], [5, 0], [2**26, 0]])
def test_frame_array_without_items_keeps_its_shape(shape: list[int]) -> None:
    assert frames.decode(frame_with(arrays={"a": ("<f8", shape, b"")})).arrays["a"].shape == tuple(shape)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b"\xc0",
        b"\x80",
        b"\x90",
        b"\xa1\xff",  # no UTF-8
        b"\xdf\xff\xff\xff\xff",  # a map of 2^32 - 1
        b"\xdd\xff\xff\xff\xff",  # an array of as many
        b"\xc6\xff\xff\xff\xff",  # bytes of as many
        b"\x81\x91\x01\x01",  # a list as a key
        b"\x81\x01\x01",  # a number as a key
        b"\x81\xd6\xff\xff\xff\xff\xff\x01",  # a time as a key
        b"\xc7\x0c\xff" + b"\xff" * 12,  # a time out of bounds
        b"\xc7\x03\xffabc",  # a time of three bytes
        b"\x91" * 100_000,  # lists in lists
        b"\x81\xa1a" * 100_000,
        frame_with() + b"\x00",
    ],
    ids=lambda data: data[:8].hex(),
)
def test_frame_of_other_bytes_is_malformed(data: bytes) -> None:
    assert fault(data) == "malformed"


def test_frame_beyond_the_limit_is_oversized() -> None:
    data = frame_with()
    assert fault(data, max_bytes=len(data) - 1) == "oversized"
    assert fault(b"\xc1" * 10, max_bytes=9) == "oversized"
    assert frames.decode(data, max_bytes=len(data)).tick == 3


def test_frame_cut_anywhere_is_malformed() -> None:
    data = frames.encode("tick", 7, {"a": np.arange(5), "b": np.ones((2, 3))}, {"x": [1, "two"]})
    assert {fault(data[:end]) for end in range(len(data))} == {"malformed"}


def test_frame_with_flipped_bits_decodes_or_is_refused() -> None:
    data = frames.encode("tick", 7, {"a": np.arange(5), "m": np.ones(3, np.bool_)}, {"x": [1, {"y": None}]})
    generator = np.random.default_rng(1)
    refused = 0
    for _ in range(3000):
        spoiled = bytearray(data)
        for at in generator.integers(0, len(data), generator.integers(1, 4)):
            spoiled[at] ^= 1 << int(generator.integers(8))
        try:
            frames.decode(bytes(spoiled))
        except BadFrame:
            refused += 1
    assert refused > 500


@given(plain)
def test_frame_of_any_other_message_is_malformed(junk: Any) -> None:
    assert fault(msgpack.packb(junk)) == "malformed"
    assert fault(frame_with(arrays={"a": junk})) == "malformed"


LARGE = 4 * 1024 * 1024


def a_list(item: bytes) -> bytes:
    count = LARGE // 2 // len(item)
    return b"\xdd" + count.to_bytes(4, "big") + item * count


def nested(item: bytes) -> bytes:
    """The same in lists of 1000."""
    part = b"\xdc\x03\xe8" + item * 1000
    return b"\xdd" + (LARGE // 2 // len(part)).to_bytes(4, "big") + part * (LARGE // 2 // len(part))


@pytest.mark.parametrize("shape", [a_list, nested])
@pytest.mark.parametrize("item", [b"\x90", b"\x80", b"\xc0", b"\xa2xy"], ids=["list", "map", "none", "text"])
def test_msgpack_of_many_small_items_is_refused_within_100_mb(shape, item) -> None:
    data = shape(item)
    tracemalloc.start()
    try:
        with pytest.raises(BadFrame, match="malformed: no msgpack"):
            unpacked(data, LARGE * 2)
        assert tracemalloc.get_traced_memory()[1] < 100_000_000
    finally:
        tracemalloc.stop()


def test_msgpack_map_of_too_many_keys_is_malformed() -> None:
    with pytest.raises(BadFrame, match="malformed"):
        unpacked(msgpack.packb({str(key): None for key in range(MAX_ITEMS + 1)}), 2 * LARGE)


def test_msgpack_of_few_large_or_small_items_is_accepted() -> None:
    large = {"names": [f"flock-{at}" for at in range(100_000)], "data": bytes(LARGE), "more": {"a": [1, {"b": 2}]}}
    assert unpacked(msgpack.packb(large), 2 * LARGE) == large
    small = [[]] * (UNCOUNTED_BYTES // 2)
    assert unpacked(msgpack.packb(small), LARGE) == small


def test_msgpack_is_limited_to_half_a_million_items() -> None:
    """The list itself counts, too."""
    assert len(unpacked(msgpack.packb([None] * 499_999), LARGE)) == 499_999
    with pytest.raises(BadFrame, match="more than 500000 items"):
        unpacked(msgpack.packb([None] * 500_000), LARGE)
