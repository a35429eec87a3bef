import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.network.latency import LARGEST_NS, RELATIVE_ERROR, LogHistogram

PERCENTS = (0.0, 50.0, 90.0, 99.0, 100.0)


def percentiles_ns(durations_ns):
    histogram = LogHistogram(1)
    values = np.array(durations_ns, np.int64)
    half = len(values) // 2
    for part in (values[:half], values[half:]):
        histogram.add(np.zeros(len(part), np.int64), part)
    return histogram.percentiles_ns(0, PERCENTS)


@given(st.lists(st.one_of(st.integers(0, 20), st.integers(0, LARGEST_NS)), min_size=1, max_size=60))
def test_percentiles_are_numpys_within_the_stated_error(durations_ns):
    exact = np.percentile(durations_ns, PERCENTS, method="inverted_cdf")
    np.testing.assert_allclose(percentiles_ns(durations_ns), exact, rtol=RELATIVE_ERROR * (1 + 1e-9))


def test_percentiles_of_many_latencies_are_numpys_within_the_stated_error():
    durations_ns = np.random.default_rng(3).lognormal(np.log(0.1e9), 1.0, 20_000).astype(np.int64)
    exact = np.percentile(durations_ns, PERCENTS, method="inverted_cdf")
    np.testing.assert_allclose(percentiles_ns(durations_ns), exact, rtol=RELATIVE_ERROR)


def test_nothing_has_no_percentile():
    assert np.isnan(percentiles_ns([])).all()


def test_what_is_longer_than_the_largest_counts_as_the_largest():
    assert percentiles_ns([10 * LARGEST_NS])[1] == pytest.approx(LARGEST_NS, rel=RELATIVE_ERROR)
