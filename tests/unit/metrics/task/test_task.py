"""Metrics of a task: consensus on a number, finding a light, and the distance to it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.truth import Light
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.task.target import FindTime
from tests.support.metrics.truths import in_each_tick, measured, static, truth

numbers = st.floats(-1e6, 1e6) | st.just(np.nan)


def both(of, values, alive=None):
    """Both metrics in each tick, (ticks, 2, arenas)."""
    seen = []
    for tick, value in enumerate(values):
        given_alive = {} if alive is None else {"alive": np.array(alive[tick])}
        seen.append(truth(of, tick, value=None if value is None else np.array(value, np.float64), **given_alive))
    return in_each_tick(of, seen, "consensus_error", "consensus_bias")


def test_the_error_is_the_deviation_of_those_that_live_and_told_a_number():
    nan = np.nan
    alive = [[True, True, True, False]] * 3
    found = both(static(4), [None, [1.0, nan, nan, 9.0], [1.0, nan, 5.0, 9.0]], alive)
    assert found[:, 0, 0].tolist() == pytest.approx([nan, 0.0, 2.0], nan_ok=True)


def test_the_bias_is_how_far_the_mean_has_gone_from_that_of_the_first_values():
    nan = np.nan
    values = [[0.0, 4.0, nan], [1.0, 4.0, 8.0], [4.0, 4.0, 4.0], [4.0, 4.0, 4.0]]
    alive = [[True] * 3] * 3 + [[False] * 3]
    assert both(static(3), values, alive)[:, 1, 0].tolist() == pytest.approx([0.0, 13 / 3 - 4, 0.0, nan], nan_ok=True)


@given(st.integers(1, 3), st.integers(1, 6), st.data())
def test_they_are_numpys_deviation_and_means(arenas, robots, data):
    rows = arenas * robots
    ticks = data.draw(st.lists(st.lists(numbers, min_size=rows, max_size=rows), min_size=1, max_size=4))
    alive = [data.draw(st.lists(st.booleans() | st.just(True), min_size=rows, max_size=rows)) for _ in ticks]
    found, first = both(static(robots, arenas), ticks, alive), {}
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
    error, bias = both(static(n), steps)[:, :, 0].T
    rate = 1 - eps * 2 * (1 - np.cos(2 * np.pi / n))
    np.testing.assert_allclose(error, np.sqrt(0.5) * rate ** np.arange(21), rtol=1e-9)
    np.testing.assert_allclose(bias, 0.0, atol=1e-12)


LIGHTS_OF_ARENAS = [[Light(2.0, 0.0, 1.0), Light(-3.0, 0.0, 1.0)], [Light(0.0, 0.0, 1.0)], []]


def found(x_m, alive=None, within_m=0.5, lights=LIGHTS_OF_ARENAS, share=0.0, robots=2):
    """The metric in each tick, of robots at x (ticks, rows) in arenas of so many."""
    of = static(robots, arenas=len(x_m[0]) // robots, lights=lights)
    metrics, told = Metrics([FindTime(within_m=within_m, share=share)]), []
    metrics.begin(of)
    for tick, at in enumerate(x_m):
        pose = np.zeros((len(at), 3))
        pose[:, 0] = at
        living = np.ones(len(at), np.bool_) if alive is None else np.array(alive[tick])
        metrics.see(truth(of, tick, pose=pose, alive=living))
        told.append(metrics.latest["find_time_s"].tolist())
    return told, metrics.end(None)["metrics"]


def test_it_is_when_the_first_robot_came_near_a_light_and_stays():
    told, summary = found(
        [[0, 0, 4, 1, 0, 0], [1, 1.5, 4, 4, 0, 0], [1, 0, 0.51, 4, 0, 0], [2, -3, 0.49, 4, 0, 0]],
    )
    nan = np.nan
    expected = [[nan, nan, nan], [0.1, nan, nan], [0.1, nan, nan], [0.1, 0.3, nan]]
    np.testing.assert_allclose(told, expected)
    assert [arena["find_time_s"]["final"] for arena in summary] == [0.1, 0.3, None]


def test_the_dead_find_nothing_and_what_was_found_stays_found():
    alive = [[False, True], [True, True], [False, False]]
    told, _ = found([[2, 0], [2, 0], [0, 0]], alive, lights=LIGHTS_OF_ARENAS[:1])
    assert told == [[pytest.approx(np.nan, nan_ok=True)], [0.1], [0.1]]


def test_the_distance_is_a_parameter():
    assert found([[0.9, 0], [1.0, 0]], within_m=1.0, lights=LIGHTS_OF_ARENAS[:1])[0] == [
        [pytest.approx(np.nan, nan_ok=True)],
        [0.1],
    ]


def test_of_a_share_of_the_robots_alive_as_many_must_be_there_at_once():
    x_m = [[2, 0, 0, 0, 0], [0, 2, 2, 0, 0], [2, 2, 2, 0, 0]]
    ticks = [found(x_m, lights=LIGHTS_OF_ARENAS[:1], share=share, robots=5)[0] for share in (0.2, 0.4, 0.6)]
    assert [told[-1] for told in ticks] == [[0.0], [0.1], [0.2]]
    three_alive = [[True, True, False, True, False]] * 3
    assert found(x_m, three_alive, lights=LIGHTS_OF_ARENAS[:1], share=0.6, robots=5)[0][-1] == [0.2]


LIGHTS = [Light(0.0, 0.0, 1.0), Light(3.0, 0.0, 1.0)]


def targets(lights, *at, arenas=1):
    of = static(len(at) // arenas, arenas=arenas, lights=lights)
    pose = np.zeros((len(at), 3))
    pose[:, :2] = at
    seen = truth(of, pose=pose)
    return measured("target_best", of, seen), measured("target_mean", of, seen)


def test_each_robot_counts_to_the_light_nearest_to_it():
    assert targets([LIGHTS], (0.3, 0.4), (3.0, 1.0), (5.0, 0.0)) == ([0.5], [pytest.approx(3.5 / 3)])


@pytest.mark.parametrize(("lights", "exact"), [([LIGHTS, [], LIGHTS[1:]], [1.0, np.nan, 2.0]), ([], [np.nan] * 3)])
def test_arenas_have_lights_of_their_own_or_none(lights, exact):
    for found in targets(lights, (1.0, 0.0), (1.0, 0.0), (1.0, 0.0), arenas=3):
        assert found == pytest.approx(exact, nan_ok=True)
