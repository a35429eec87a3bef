"""Wrapped angles point where they did, lie in their interval, and are the same bits by every form of one formula."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.angles import wrap_angle, wrap_angles, wrap_by_atan2, wrap_by_modulo
from swarmwire.comms.kernels import njit

compiled = njit()(wrap_angle)
ANGLES = st.floats(-50.0, 50.0) | st.integers(-9, 9).map(lambda half_turns: half_turns * math.pi)


@given(ANGLES)
def test_the_forms_for_one_angle_for_arrays_and_for_kernels_agree_bit_for_bit(angle: float):
    assert wrap_angle(angle) == wrap_angles(np.array([angle]))[0] == compiled(angle)


@given(ANGLES)
def test_angles_lie_in_the_interval_and_point_where_they_did(angle: float):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert abs(math.remainder(wrapped - angle, math.tau)) < 1e-13
    for other in (wrap_by_atan2, wrap_by_modulo):
        assert -math.pi <= other(np.array(angle)) <= math.pi
        assert abs(math.remainder(float(other(np.array(angle))) - wrapped, math.tau)) < 1e-13


@given(st.floats(-math.pi, math.pi, exclude_min=True))
def test_an_angle_in_the_interval_keeps_its_bits(angle: float):
    assert wrap_angle(angle) == angle


@given(st.floats(-3.0 * math.pi, 3.0 * math.pi))
def test_up_to_three_half_turns_it_is_the_exact_remainder(angle: float):
    exact = math.remainder(angle, math.tau)
    assert wrap_angle(angle) == (exact if exact > -math.pi else math.pi) or abs(exact) == math.pi


def test_a_half_turn_is_to_the_left_or_by_modulo_to_the_right():
    ends = np.array([math.pi, -math.pi])
    assert wrap_angles(ends).tolist() == [math.pi, math.pi]
    assert wrap_by_modulo(ends).tolist() == [-math.pi, -math.pi]


def test_what_is_unknown_stays_unknown():
    assert math.isnan(wrap_angle(math.nan))
    assert np.isnan(wrap_angles(np.array([math.nan]))).all()
    assert wrap_angles(np.array([4.0, 7.0])) == pytest.approx([4.0 - math.tau, 7.0 - math.tau])
