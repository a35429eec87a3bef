"""What a robot learns of the air that it joins; whatever else comes in its place is refused."""

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.air_terms import AirTerms

TERMS = AirTerms(4, ("flock-0", "flock-1"), 10, 100, ("range_m",), ("radio.range", "radio.outcomes"))
GOOD = msgpack.unpackb(TERMS.encode())


def fault_of(data: bytes) -> str:
    with pytest.raises(BadFrame) as caught:
        AirTerms.decode(data)
    return caught.value.fault


def test_what_was_told_is_what_is_learned():
    assert AirTerms.decode(TERMS.encode()) == TERMS


@pytest.mark.parametrize(
    "changed",
    [
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
    assert fault_of(msgpack.packb({**GOOD, **changed})) == "malformed"


@pytest.mark.parametrize("version", [0, 2, "1", True, None])
def test_another_version_is_named(version):
    assert fault_of(msgpack.packb({**GOOD, "v": version})) == "version"


@pytest.mark.parametrize("name", sorted(GOOD))
def test_nothing_may_be_missing(name):
    given = {key: value for key, value in GOOD.items() if key != name}
    assert fault_of(msgpack.packb(given)) == ("version" if name == "v" else "malformed")


@given(st.binary(max_size=60))
def test_garbage_is_refused(data):
    assert fault_of(data) in ("malformed", "version")  # an empty map names no version


@pytest.mark.parametrize("value", [None, 3, [], ["v"], {1: 2}])
def test_what_is_no_map_of_terms_is_refused(value):
    assert fault_of(msgpack.packb(value)) == "malformed"
