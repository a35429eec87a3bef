"""What a robot learns of the air that it joins; whatever else comes in its place is refused."""

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.air_terms import AirTerms

TERMS = AirTerms(4, ("flock-0", "flock-1"), 10, 100, ("range_m",), ("radio.range", "radio.outcomes"))
GOOD = msgpack.unpackb(TERMS.encode())


def refused(data: bytes) -> bool:
    with pytest.raises(BadFrame) as caught:
        AirTerms.decode(data)
    return caught.value.fault == "malformed"


def test_what_was_told_is_what_is_learned():
    assert AirTerms.decode(TERMS.encode()) == TERMS


@pytest.mark.parametrize(
    "changed",
    [
        {"v": 3},
        {"v": "2"},
        {"row": -1},
        {"row": "4"},
        {"row": True},
        {"rate_hz": 0},
        {"max_payload_bytes": 1.5},
        {"robots": "flock-0"},
        {"robots": [1]},
        {"gives": None},
        {"needs": {}},
        {"more": 1},
    ],
)
def test_what_is_of_another_kind_is_refused(changed):
    assert refused(msgpack.packb({**GOOD, **changed}))


@pytest.mark.parametrize("name", sorted(GOOD))
def test_nothing_may_be_missing(name):
    assert refused(msgpack.packb({key: value for key, value in GOOD.items() if key != name}))


@given(st.binary(max_size=60))
def test_garbage_is_refused(data):
    assert refused(data)


@pytest.mark.parametrize("value", [None, 3, [], ["v"], {1: 2}])
def test_what_is_no_map_of_terms_is_refused(value):
    assert refused(msgpack.packb(value))
