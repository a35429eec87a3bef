"""Robots in each other's way: how often they collide, and who is deadlocked."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.swarm.motion import Deadlocked
from tests.support.metrics.swarms import rolled, stand, told
from tests.support.metrics.truths import static, truth


def rate_per_h(of, onsets, alive):
    """`onsets` (ticks, arenas), `alive` (ticks, rows)."""
    ticks = [
        truth(of, tick, contact_onsets=np.column_stack([now, 7 + 0 * now]), alive=living)
        for tick, (now, living) in enumerate(zip(onsets, alive, strict=True))
    ]
    return told("collision_rate", *ticks, of=of)


@given(st.integers(0, 1000), st.integers(1, 20), st.sampled_from([0.0, 0.1, 0.9]))
def test_the_rate_is_twice_the_onsets_over_the_time_of_the_robots_alive_and_walls_do_not_count(seed, ticks, dead):
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


WINDOW = Deadlocked(window_s=1.0, moved_m=0.05, told_m=0.05)  # of ten ticks


def after(place, command, alive=None, boundary="walls", arenas=1):
    """What is told at the last of ticks with places (ticks, rows, 2) and commands (ticks, rows, 3)."""
    alive = np.ones(np.shape(place)[:2], np.bool_) if alive is None else alive
    swarms = [
        replace(stand(*at, boundary=boundary, arenas=arenas), alive=a) for at, a in zip(place, alive, strict=True)
    ]
    ticks = [swarm.seen(tick, command=command[tick]) for tick, swarm in enumerate(swarms)]
    return told(WINDOW, *ticks, of=swarms[0].of)


def path(step_m, ticks=11, start=(0.0, 0.0)):
    return np.array(start) + np.arange(ticks)[:, None] * np.array(step_m)


def robots(*one):
    """Paths or commands of robots, (ticks, robots, …)."""
    return np.stack(one, axis=1)


AHEAD, TURN, ASIDE = np.tile([0.1, 0, 0], (11, 1)), np.tile([0, 1.0, 0], (11, 1)), np.tile([0, 0, -0.1], (11, 1))


def test_who_was_told_to_go_and_did_not_is_deadlocked():
    still, gone = path((0, 0)), path((0.01, 0))
    assert after(robots(still, gone, still, still), robots(AHEAD, AHEAD, TURN, ASIDE)) == [0.5]


def test_who_goes_to_and_fro_is_deadlocked():
    dither = path((0, 0))
    dither[1::2, 0] = 0.03
    back = AHEAD * np.where(np.arange(11) % 2, -1, 1)[:, None]
    assert after(robots(dither), robots(back)) == [1.0]


def test_before_a_window_has_passed_nobody_knows():
    still = robots(path((0, 0), ticks=10))
    assert np.isnan(after(still, robots(AHEAD[:10]))).all()


def test_the_dead_do_not_count_and_were_told_nothing():
    place, command = robots(path((0, 0)), path((0, 0))), robots(AHEAD, AHEAD)
    alive = np.ones((11, 2), np.bool_)
    alive[-1, 1] = False
    assert after(place, command, alive=alive) == [1.0]
    alive[:] = True
    alive[:7, 1] = False
    assert after(place, command, alive=alive) == [0.5]
    assert np.isnan(after(place, command, alive=np.zeros((11, 2), np.bool_))).all()


def test_who_went_across_the_seam_of_a_torus_by_little_is_deadlocked():
    place = robots(path((0.002, 0), start=(3.99, 0)))
    place = rolled(place)
    assert after(place, robots(AHEAD), boundary="torus") == [1.0]
    assert after(place, robots(AHEAD)) == [0.0]


@settings(max_examples=50)
@given(st.integers(0, 1000), st.integers(2, 30), st.sampled_from(["walls", "torus"]))
def test_the_deadlocked_are_those_of_the_definition(seed, ticks, boundary):
    rng, window = np.random.default_rng(seed), 10
    place = rolled(np.cumsum(rng.normal(0.0, 0.02, (ticks, 6, 2)), axis=0) + rng.uniform(-4, 4, (1, 6, 2)))
    command = rng.normal(0.0, 0.06, (ticks, 6, 3)) * (rng.random((1, 6, 1)) < 0.7)
    alive = rng.random((ticks, 6)) < rng.choice([1.0, 0.8, 0.2])
    values = []
    for own in (slice(0, 3), slice(3, 6)):
        stuck, then = 0, ticks - 1 - window
        for robot in np.arange(6)[own]:
            if then < 0 or not alive[-1, robot]:
                continue
            told_m = sum(np.hypot(*command[k, robot, [0, 2]]) * 0.1 for k in range(then, ticks - 1) if alive[k, robot])
            away = stand((0, 0), boundary=boundary).shortest(place[-1, robot] - place[then, robot])
            stuck += told_m >= 0.05 and np.hypot(*away) < 0.05
        living = np.count_nonzero(alive[-1, own])
        values.append(stuck / living if living and then >= 0 else np.nan)
    found = after(place, command, alive=alive, boundary=boundary, arenas=2)
    assert found == pytest.approx(values, nan_ok=True)
