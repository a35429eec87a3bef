"""Poses of a motion trace over the time of a run."""

from math import nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.world.motion.traces.trace import MotionTrace, TracePoses, trace_from, trace_of_columns
from tests.support.world.traces import traces

# A square's three sides with rests: east for a second, north for a second, then west from 5 s to 6 s.
SQUARE = [[1, 0, 0, 2], [2, 4, 0, 2], [3, 4, 4, 4], [5, 4, 4, 4], [6, 0, 4, 0]]
times = st.lists(st.integers(-20, 400).map(lambda tenths: tenths / 10.0 + 1 / 64), min_size=1, max_size=12)


def poses(trace: MotionTrace, time_s: float, robot: int = 0, start_s: float = 0.0) -> list[float]:
    return TracePoses(trace, [robot], start_s).at(time_s)[0].tolist()


@pytest.mark.parametrize(
    ("time_s", "pose"),
    [
        (-3.0, [0, 0, 2, 0]),
        (1.0, [0, 0, 2, 0]),
        (1.25, [1, 0, 2, 0]),
        (2.0, [4, 0, 2, pi / 2]),
        (2.5, [4, 2, 3, pi / 2]),
        (4.0, [4, 4, 4, pi / 2]),
        (5.75, [1, 4, 1, pi]),
        (6.0, [0, 4, 0, pi]),
        (100.0, [0, 4, 0, pi]),
    ],
)
def test_trace_pose_is_on_the_way_and_heads_along_the_motion(time_s: float, pose: list[float]) -> None:
    assert poses(trace_from(["a"], [SQUARE]), time_s) == pose


def test_trace_positions_equal_linear_interpolation() -> None:
    draws = np.random.default_rng(5)
    samples = []
    for count in (1, 2, 40):
        t_s = np.sort(draws.uniform(0.0, 30.0, count))
        samples.append(np.column_stack((t_s, draws.uniform(-50.0, 50.0, (count, 3)))))
    followed = TracePoses(trace_from(["a", "b", "c"], samples), [0, 1, 2], 0.0)
    for time_s in np.arange(-1.0, 32.0, 0.07).tolist():
        at = followed.at(time_s)
        for row, robot in enumerate(samples):
            expected = [np.interp(time_s, robot[:, 0], robot[:, axis]) for axis in (1, 2, 3)]
            np.testing.assert_allclose(at[row, :3], expected, rtol=0.0, atol=1e-12)


def test_trace_headings_turn_the_short_way() -> None:
    trace = trace_of_columns(
        ("a",),
        np.array([0, 3]),
        np.array([0.0, 1.0, 2.0]),
        *(np.zeros(3) for _ in range(3)),
        np.array([3.0, -3.0, 0.0]),
    )
    across = 2.0 * pi - 6.0  # from 3 rad by way of pi to -3 rad
    headings = [poses(trace, time_s)[3] for time_s in (-1.0, 0.0, 0.25, 0.75, 1.5, 2.0, 9.0)]
    expected = [3.0, 3.0, 3.0 + 0.25 * across, -3.0 - 0.25 * across, -1.5, 0.0, 0.0]
    assert headings == pytest.approx(expected, abs=1e-12)


def test_trace_without_some_headings_heads_along_the_motion_there() -> None:
    at = np.array([0.0, 1.0, 2.0, 3.0])
    trace = trace_of_columns(("a",), np.array([0, 4]), at, at, at, np.zeros(4), np.array([nan, 2.0, 2.0, nan]))
    headings = [poses(trace, time_s)[3] for time_s in (-1.0, 0.5, 1.0, 1.5, 2.5, 3.0)]
    assert headings == pytest.approx([0.0, pi / 4, 2.0, 2.0, pi / 4, pi / 4])


def test_trace_robot_jumps_between_samples_of_one_time_and_keeps_its_direction() -> None:
    trace = trace_from(["a"], [[[0, 0, 0, 0], [1, 0, 2, 0], [1, 8, 8, 8], [2, 8, 8, 8]]])
    assert poses(trace, 0.75) == [0.0, 1.5, 0.0, pi / 2]
    assert poses(trace, 1.0) == poses(trace, 3.0) == [8.0, 8.0, 8.0, pi / 2]


def test_trace_of_chosen_robots_is_in_their_order_and_starts_at_a_time_of_the_file() -> None:
    trace = trace_from(["a", "b", "c"], [[[0, robot, 0, 0], [10, robot, 10, 0]] for robot in range(3)])
    followed = TracePoses(trace, [2, 0], start_s=4.0)
    assert followed.at(1.0)[:, :3].tolist() == [[2.0, 5.0, 0.0], [0.0, 5.0, 0.0]]


def test_trace_shifted_moves_all_positions() -> None:
    moved = trace_from(["a"], [SQUARE]).shifted(-2.0, 0.5)
    assert poses(moved, 2.5) == [2.0, 2.5, 3.0, pi / 2]


@given(traces(), times)
def test_trace_pose_depends_on_the_time_alone(trace: MotionTrace, asked_s: list[float]) -> None:
    order = range(len(trace.names))
    followed = TracePoses(trace, order, 0.0)
    for time_s in asked_s:
        assert np.array_equal(followed.at(time_s), TracePoses(trace, order, 0.0).at(time_s))
