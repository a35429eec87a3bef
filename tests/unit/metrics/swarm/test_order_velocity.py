import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.metrics.truths import measured, static, truth

speeds = st.floats(-0.3, 0.3, allow_subnormal=False)


def order(*velocity, **fields):
    of = static(len(velocity))
    table = np.zeros((len(velocity), 3))
    table[:, :2] = velocity
    return measured("order_velocity", of, truth(of, velocity=table, **fields))[0]


def test_robots_that_move_one_way_have_order_one_however_fast():
    assert order((0.1, 0.1), (0.2, 0.2), (0.0, 0.0)) == pytest.approx(1.0)


def test_robots_count_by_their_speed():
    assert order((0.3, 0.0), (-0.1, 0.0)) == pytest.approx(0.5)
    assert order((0.1, 0.0), (0.0, 0.1)) == pytest.approx(np.sqrt(0.5))


def test_a_swarm_that_stands_still_has_no_order():
    assert order((0.0, 0.0), (0.0, 0.0)) == 0.0


def test_only_robots_alive_count():
    assert order((0.1, 0.0), (-0.1, 0.0), alive=np.array([True, False])) == 1.0
    assert np.isnan(order((0.1, 0.0), alive=np.zeros(1, np.bool_)))


@given(st.lists(st.tuples(speeds, speeds), min_size=1, max_size=12))
def test_it_is_within_zero_and_one(velocity):
    assert 0.0 <= order(*velocity) <= 1.0
