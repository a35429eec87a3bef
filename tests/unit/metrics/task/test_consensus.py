"""Consensus error and bias: by hand, against numpy's deviation, and the decay that a Laplacian's eigenvalue gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.metrics import Metrics
from tests.support.metrics.truths import static, truth

NAMES = ("consensus_error", "consensus_bias")
numbers = st.floats(-1e6, 1e6) | st.just(np.nan)


def told(of, values, alive=None):
    """Both metrics in each tick, (ticks, 2, arenas)."""
    metrics, found = Metrics(NAMES), []
    metrics.begin(of)
    for tick, value in enumerate(values):
        given_alive = {} if alive is None else {"alive": np.array(alive[tick])}
        metrics.see(truth(of, tick, value=None if value is None else np.array(value, np.float64), **given_alive))
        found.append([metrics.latest[name] for name in NAMES])
    return np.array(found)


def test_the_error_is_the_deviation_of_those_that_live_and_told_a_number():
    nan = np.nan
    alive = [[True, True, True, False]] * 3
    found = told(static(4), [None, [1.0, nan, nan, 9.0], [1.0, nan, 5.0, 9.0]], alive)
    assert found[:, 0, 0].tolist() == pytest.approx([nan, 0.0, 2.0], nan_ok=True)


def test_the_bias_is_how_far_the_mean_has_gone_from_that_of_the_first_values():
    nan = np.nan
    values = [[0.0, 4.0, nan], [1.0, 4.0, 8.0], [4.0, 4.0, 4.0], [4.0, 4.0, 4.0]]
    alive = [[True] * 3] * 3 + [[False] * 3]
    assert told(static(3), values, alive)[:, 1, 0].tolist() == pytest.approx([0.0, 13 / 3 - 4, 0.0, nan], nan_ok=True)


@given(st.integers(1, 3), st.integers(1, 6), st.data())
def test_they_are_numpys_deviation_and_means(arenas, robots, data):
    rows = arenas * robots
    ticks = data.draw(st.lists(st.lists(numbers, min_size=rows, max_size=rows), min_size=1, max_size=4))
    alive = [data.draw(st.lists(st.booleans() | st.just(True), min_size=rows, max_size=rows)) for _ in ticks]
    found, first = told(static(robots, arenas), ticks, alive), {}
    for tick, values in enumerate(ticks):
        first = {row: value for row, value in enumerate(values) if not np.isnan(value)} | first
        for arena in range(arenas):
            own = range(arena * robots, (arena + 1) * robots)
            living = [values[row] for row in own if alive[tick][row] and not np.isnan(values[row])]
            began = [first[row] for row in own if row in first]
            expected = [np.std(living), np.mean(living) - np.mean(began)] if living else [np.nan, np.nan]
            assert found[tick, :, arena].tolist() == pytest.approx(expected, rel=1e-9, abs=1e-8, nan_ok=True)


def test_disagreement_along_the_second_eigenvector_dies_out_at_the_rate_of_its_eigenvalue():
    """On a ring of n, x' = (I - eps L) x shrinks a wave once around it by 1 - eps 2 (1 - cos 2 pi / n) a step."""
    n, eps = 12, 0.2
    wave = np.cos(2 * np.pi * np.arange(n) / n)
    steps = [5.0 + wave]
    for _ in range(20):
        x = steps[-1]
        steps.append(x + eps * (np.roll(x, 1) + np.roll(x, -1) - 2 * x))
    error, bias = told(static(n), steps)[:, :, 0].T
    rate = 1 - eps * 2 * (1 - np.cos(2 * np.pi / n))
    np.testing.assert_allclose(error, np.sqrt(0.5) * rate ** np.arange(21), rtol=1e-9)
    np.testing.assert_allclose(bias, 0.0, atol=1e-12)
