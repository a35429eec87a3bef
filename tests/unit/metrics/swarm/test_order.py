import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.metrics.truths import measured, poses, static, truth

headings = st.lists(st.floats(-np.pi, np.pi), min_size=1, max_size=20)


def order(heading_rad, **given_fields):
    of = static(len(heading_rad))
    return measured("order", of, truth(of, pose=poses(heading_rad), **given_fields))[0]


def test_aligned_headings_have_order_one():
    assert order([0.7] * 9) == pytest.approx(1.0, abs=1e-15)


def test_opposite_headings_cancel():
    assert order([0.3, 0.3 + np.pi, -1.0, -1.0 - np.pi]) == pytest.approx(0.0, abs=1e-15)


def test_two_headings_at_a_right_angle_give_half_the_square_root_of_two():
    assert order([0.0, np.pi / 2]) == pytest.approx(np.sqrt(0.5))


def test_dead_robots_do_not_count():
    assert order([0.0, 0.0, np.pi], alive=np.array([True, True, False])) == pytest.approx(1.0)


def test_without_a_robot_alive_there_is_no_order():
    assert np.isnan(order([0.0, 0.0], alive=np.zeros(2, np.bool_)))


@given(headings)
def test_order_is_within_zero_and_one(heading_rad):
    assert 0.0 <= order(heading_rad) <= 1.0


@given(headings, st.floats(-np.pi, np.pi))
def test_turning_all_robots_alike_changes_nothing(heading_rad, turn_rad):
    assert order([h + turn_rad for h in heading_rad]) == pytest.approx(order(heading_rad), abs=1e-12)


@given(st.lists(st.tuples(*[st.floats(-np.pi, np.pi)] * 7), min_size=1, max_size=5))
def test_an_arena_alone_has_the_order_it_has_beside_others_to_the_last_bit(arenas):
    of = static(7, arenas=len(arenas))
    together = measured("order", of, truth(of, pose=poses([h for arena in arenas for h in arena])))
    assert together == [order(list(arena)) for arena in arenas]


@pytest.mark.parametrize(("robots", "exact"), [(5, 0.402), (10, 0.282), (40, 0.1404), (100, 0.0887), (400, 0.0445)])
def test_headings_at_random_have_the_known_mean_order(robots, exact):
    """E[order^2] = 1/N gives a variance below 0.22/N; 5 standard errors of 2000 samples: false alarm 6e-7."""
    samples = 2000
    of = static(robots, arenas=samples)
    heading_rad = np.random.default_rng(1).uniform(-np.pi, np.pi, samples * robots)
    found = np.array(measured("order", of, truth(of, pose=poses(heading_rad))))
    tolerance = 5 * np.sqrt(0.22 / robots / samples) + 0.0005  # and the rounding of the table
    assert found.mean() == pytest.approx(exact, abs=tolerance)
    assert np.square(found).mean() == pytest.approx(1 / robots, rel=5 / np.sqrt(samples))
