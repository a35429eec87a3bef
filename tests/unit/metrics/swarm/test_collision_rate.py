import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.metrics.swarm.swarms import told
from tests.support.metrics.truths import static, truth


def rate_per_h(of, onsets, alive):
    """`onsets` (ticks, arenas), `alive` (ticks, rows)."""
    ticks = [
        truth(of, tick, contact_onsets=np.column_stack([now, 7 + 0 * now]), alive=living)
        for tick, (now, living) in enumerate(zip(onsets, alive, strict=True))
    ]
    return told("collision_rate", *ticks, of=of)


def test_an_onset_counts_for_both_robots_and_walls_do_not_count():
    alive = np.ones((600, 4), np.bool_)  # a minute of four robots
    onsets = np.zeros((600, 1), np.int64)
    onsets[100] = 1
    assert rate_per_h(static(4), onsets, alive) == [pytest.approx(2 / (4 / 60))]


@given(st.integers(0, 1000), st.integers(1, 20), st.sampled_from([0.0, 0.1, 0.9]))
def test_it_is_onsets_over_the_time_of_the_robots_alive(seed, ticks, dead):
    rng, of = np.random.default_rng(seed), static(3, arenas=2)
    onsets, alive = rng.integers(0, 3, (ticks, 2)), rng.random((ticks, 6)) >= dead
    alive[:, 3:] &= rng.random() < 0.8
    values = []
    for arena in range(2):
        robot_h = sum(np.count_nonzero(tick[3 * arena : 3 * arena + 3]) / of.rate_hz / 3600 for tick in alive)
        values.append(2 * sum(tick[arena] for tick in onsets) / robot_h if robot_h else np.nan)
    assert rate_per_h(of, onsets, alive) == pytest.approx(values, nan_ok=True)


def test_robots_that_heed_nobody_collide_at_the_rate_of_the_kinetic_theory():
    """(8 / pi) n D v (N - 1) / N. Onsets are nearly Poisson: 5 standard errors, false alarm 6e-7.

    Straight paths on a torus; a chord shorter than a tick's way is missed, and takes less than 1 % away.
    """
    robots, arenas, ticks, side_m, diameter_m, speed_mps = 60, 6, 400, 4.0, 0.07, 0.1
    rng, of = np.random.default_rng(1), static(robots, arenas=arenas)
    place = rng.uniform(0.0, side_m, (arenas, robots, 2))
    heading = rng.uniform(-np.pi, np.pi, (arenas, robots))
    step = speed_mps / of.rate_hz * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    i, j = np.triu_indices(robots, 1)
    away, closing = place[:, i] - place[:, j], step[:, i] - step[:, j]
    touching, onsets = [], []
    for tick in range(ticks + 1):
        now = away + tick * closing
        now -= side_m * np.round(now / side_m)
        touching.append((now**2).sum(axis=-1) < diameter_m**2)
        onsets.append(np.count_nonzero(touching[-1] & ~touching[-2], axis=1) if tick else None)
    found = np.array(rate_per_h(of, onsets[1:], np.ones((ticks, arenas * robots), np.bool_)))
    exact = 8 / np.pi * robots / side_m**2 * diameter_m * speed_mps * (robots - 1) / robots * 3600
    assert exact == pytest.approx(237, abs=1)
    expected_onsets = exact * arenas * robots * ticks / of.rate_hz / 3600 / 2
    assert found.mean() == pytest.approx(exact, rel=5 / np.sqrt(expected_onsets))
