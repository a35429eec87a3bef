"""What arrives becomes no more than its bytes allow for: short messages that say much are malformed."""

import tracemalloc

import msgpack
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.unpacking import MOST_ITEMS, UNCOUNTED_BYTES, unpacked

LARGE = 4 * 1024 * 1024


def a_list(item: bytes) -> bytes:
    count = LARGE // len(item)
    return b"\xdd" + count.to_bytes(4, "big") + item * count


def nested(item: bytes) -> bytes:
    """The same in lists of 1000."""
    part = b"\xdc\x03\xe8" + item * 1000
    return b"\xdd" + (LARGE // len(part)).to_bytes(4, "big") + part * (LARGE // len(part))


@pytest.mark.parametrize("shape", [a_list, nested])
@pytest.mark.parametrize("item", [b"\x90", b"\x80", b"\xc0", b"\xa2xy"], ids=["list", "map", "none", "text"])
def test_many_small_things_are_malformed_before_they_take_much_memory(shape, item) -> None:
    data = shape(item)
    tracemalloc.start()
    try:
        with pytest.raises(BadFrame, match="malformed: no msgpack"):
            unpacked(data, LARGE * 2)
        assert tracemalloc.get_traced_memory()[1] < 100_000_000
    finally:
        tracemalloc.stop()


def test_a_map_of_many_keys_is_malformed() -> None:
    with pytest.raises(BadFrame, match="malformed"):
        unpacked(msgpack.packb({str(key): None for key in range(MOST_ITEMS + 1)}), 2 * LARGE)


def test_large_messages_of_few_things_and_all_small_ones_come_through() -> None:
    large = {"names": [f"flock-{at}" for at in range(100_000)], "data": bytes(LARGE), "more": {"a": [1, {"b": 2}]}}
    assert unpacked(msgpack.packb(large), 2 * LARGE) == large
    small = [[]] * (UNCOUNTED_BYTES // 2)
    assert unpacked(msgpack.packb(small), LARGE) == small


def test_half_a_million_things_come_through_and_not_one_more() -> None:
    """The list itself counts, too."""
    assert len(unpacked(msgpack.packb([None] * 499_999), LARGE)) == 499_999
    with pytest.raises(BadFrame, match="more than 500000 items"):
        unpacked(msgpack.packb([None] * 500_000), LARGE)
