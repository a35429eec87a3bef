"""Poses come over the wire as they are, and nothing else is taken for one."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.poses import POSE_BYTES, Pose, decode_pose, encode_pose

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.builds(Pose, NUMBERS, NUMBERS, NUMBERS), st.integers(-(2**63), 2**63 - 1))
def test_a_pose_comes_back_with_its_time(pose: Pose, utc_ns: int) -> None:
    assert decode_pose(encode_pose(pose, utc_ns)) == (pose, utc_ns)


@given(st.binary(max_size=100).filter(lambda data: len(data) != POSE_BYTES))
def test_bytes_of_another_length_are_none(data: bytes) -> None:
    with pytest.raises(BadFrame):
        decode_pose(data)


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_none(place: int, wrong: float) -> None:
    numbers = [0.0, 0.0, 0.0]
    numbers[place] = wrong
    with pytest.raises(BadFrame):
        decode_pose(encode_pose(Pose(*numbers), 0))
