"""Whatever goes to JSON or msgpack is plain, or refused with the place where it is not."""

import json
from datetime import date

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.comms.plain_values import check_plain

SINGLE = st.booleans() | st.text() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False, allow_infinity=False)
PLAIN = st.recursive(SINGLE, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=10)


@given(PLAIN)
def test_what_passes_can_be_written_and_read(value):
    check_plain(value, "robot.toml", "params")
    assert json.loads(json.dumps(value)) == value
    assert msgpack.unpackb(msgpack.packb(value)) == value


@pytest.mark.parametrize(
    ("value", "key"),
    [
        ({"at": date(2026, 11, 21)}, "params.at"),
        ({"of": [1, {"x": float("inf")}]}, "params.of[1].x"),
        ([2**64], "params[0]"),
        (None, "params"),
        ({1: 2}, "params.1"),
    ],
)
def test_what_does_not_is_named(value, key):
    with pytest.raises(BadInput) as refused:
        check_plain(value, "robot.toml", "params")
    assert (refused.value.where, refused.value.key) == ("robot.toml", key)
