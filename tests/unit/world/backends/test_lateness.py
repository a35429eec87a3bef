"""Delays are counted in little memory, and percentiles are as good as told."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.world.backends.pacing import LatencyHistogram, LatencySummary

NS_PER_S = 1e9


def delays_of(*parts: list[int]) -> LatencySummary | None:
    lateness = LatencyHistogram()
    for part in parts:
        lateness.add(np.array(part, np.int64))
    return lateness.delays()


def test_of_nothing_there_are_no_delays() -> None:
    assert delays_of([]) is None


def test_what_came_early_was_on_time() -> None:
    assert delays_of([-5_000_000, 0]) == LatencySummary(2, 0.0, 0.0, 0.0)


@given(st.lists(st.lists(st.integers(0, 10**14), max_size=30), min_size=1, max_size=5).filter(any))
def test_percentiles_are_within_half_a_percent_and_never_above_the_worst(parts: list[list[int]]) -> None:
    found = delays_of(*parts)
    late_ns = np.sort([late for part in parts for late in part])
    assert found is not None
    assert (found.count, found.worst_s) == (len(late_ns), late_ns[-1] / NS_PER_S)
    for share, told_s in ((0.5, found.p50_s), (0.99, found.p99_s)):
        exact_s = late_ns[int(np.ceil(share * len(late_ns))) - 1] / NS_PER_S
        assert exact_s - 1e-9 <= told_s <= min(exact_s * 1.0051 + 6e-9, found.worst_s)
