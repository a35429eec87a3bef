"""How robots move: their speed, how straight they go, and how often they change sides."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.swarm.motion import Oscillation
from tests.support.metrics.swarms import rolled, stand, told
from tests.support.metrics.truths import measured, static, truth


def speed(velocity, **given) -> float:
    of = static(len(velocity))
    return measured("speed", of, truth(of, velocity=np.array(velocity, float), **given))[0]


def test_the_mean_is_over_robots_whichever_way_they_go():
    assert speed([[0.3, 0.4, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 9.0]]) == pytest.approx(0.2)


def efficiency(place, alive=None, boundary="open", arenas=1):
    """What is told at the last of ticks with places (ticks, rows, 2)."""
    swarms = [stand(*tick, boundary=boundary, arenas=arenas) for tick in np.asarray(place, float)]
    alive = np.ones((len(swarms), len(swarms[0].pose)), np.bool_) if alive is None else alive
    ticks = [
        replace(swarm, alive=living).seen(tick) for tick, (swarm, living) in enumerate(zip(swarms, alive, strict=True))
    ]
    return told("path_efficiency", *ticks, of=swarms[0].of)


def test_a_straight_way_is_one_a_way_back_is_zero_and_a_half_circle_two_over_pi():
    straight = np.linspace([0.0, 0.0], [3.0, 4.0], 201)
    angle = np.linspace(0.0, np.pi, 201)
    half = np.column_stack([np.cos(angle), np.sin(angle)])
    assert efficiency(straight[:, None]) == [pytest.approx(1.0)]
    assert efficiency(np.concatenate([straight, straight[::-1]])[:, None]) == [pytest.approx(0.0, abs=1e-12)]
    assert efficiency(half[:, None]) == [pytest.approx(2.0 / np.pi, rel=1e-4)]


def test_who_has_not_moved_is_left_out():
    place = np.zeros((3, 2, 2))
    place[:, 0, 0] = 0.0, 0.1, 0.2
    place[:, 1, 0] = 0.0, 0.001, 0.0
    assert efficiency(place) == [pytest.approx(1.0)]
    assert np.isnan(efficiency(place[:, 1:])).all()


def test_on_a_torus_once_around_is_a_side_away():
    x = np.linspace(0.0, 8.0, 41)
    around = rolled(np.column_stack([x, 0 * x]))[:, None]
    assert efficiency(around, boundary="torus") == [pytest.approx(1.0)]


def test_a_random_walk_has_the_known_mean():
    """sqrt(pi / (4 n)) of n steps, as the order of n headings at random; its variance is below 0.22 / n.

    5 standard errors of 500 walks: false alarm 6e-7.
    """
    walks, steps = 500, 100
    turn = np.random.default_rng(1).uniform(-np.pi, np.pi, (steps, walks))
    place = np.concatenate([np.zeros((1, walks, 2)), np.cumsum(np.stack([np.cos(turn), np.sin(turn)], -1), axis=0)])
    assert efficiency(place) == [pytest.approx(0.0887, abs=5 * np.sqrt(0.22 / steps / walks) + 5e-5)]


@given(st.integers(0, 1000), st.integers(1, 20), st.sampled_from(["open", "torus"]))
def test_path_efficiency_is_that_of_the_formula(seed, ticks, boundary):
    rng = np.random.default_rng(seed)
    unrolled = np.cumsum(rng.normal(0.0, rng.choice([0.5, 0.003]), (ticks, 6, 2)), axis=0)
    alive = rng.random((ticks, 6)) < rng.choice([1.0, 0.6, 0.1])
    values = []
    for own in (slice(0, 3), slice(3, 6)):
        shares = []
        for robot in np.arange(6)[own]:
            length_m = sum(np.hypot(*step) for step in np.diff(unrolled[:, robot], axis=0))
            if alive[-1, robot] and length_m >= 0.01:
                shares.append(np.hypot(*(unrolled[-1, robot] - unrolled[0, robot])) / length_m)
        values.append(np.mean(shares) if shares else np.nan)
    place = rolled(unrolled) if boundary == "torus" else unrolled
    found = efficiency(place, alive, boundary, arenas=2)
    assert found == pytest.approx(values, rel=1e-6, nan_ok=True)
    assert all(np.isnan(value) or 0.0 <= value <= 1.0 for value in found)


PER_MIN = 60 * 10  # ticks


def oscillation(turn_radps, alive=None, arenas=1, **parameters):
    """What is told at the last of ticks with these turning commands, (ticks, rows)."""
    turn = np.asarray(turn_radps, float)
    alive = np.ones(turn.shape, np.bool_) if alive is None else alive
    of = static(turn.shape[1] // arenas, arenas=arenas)
    command = np.stack([0 * turn, turn, 0 * turn], axis=-1)
    ticks = [truth(of, tick, command=command[tick], alive=alive[tick]) for tick in range(len(turn))]
    return told(Oscillation(**parameters), *ticks, of=of)


@pytest.mark.parametrize(
    ("turn_radps", "dead_band_radps", "changes_per_tick"),
    [
        ([1.0, -1.0, 1.0, -1.0], 0.05, 3 / 4),
        ([1.0, 0.0, 1.0, -0.04, 0.3], 0.05, 0.0),
        ([1.0, 0.0, 0.0, -1.0], 0.05, 1 / 4),  # going straight in between does not hide a change
        ([0.2, -0.2], 0.2, 0.0),
        ([0.2, -0.2], 0.1, 1 / 2),
    ],
)
def test_changes_of_side_beyond_the_dead_band_count(turn_radps, dead_band_radps, changes_per_tick):
    found = oscillation([[turn] for turn in turn_radps], dead_band_radps=dead_band_radps)
    assert found == [pytest.approx(changes_per_tick * PER_MIN)]


def test_the_dead_neither_count_nor_remember():
    alive = np.array([[True, True], [True, False], [True, True]])
    assert oscillation([[0, 1], [0, -1], [0, -1]], alive=alive) == [0.0]
    assert np.isnan(oscillation([[1.0], [-1.0]], alive=np.zeros((2, 1), np.bool_))).all()


@given(st.integers(0, 1000), st.integers(1, 25))
def test_oscillation_is_that_of_the_definition(seed, ticks):
    rng = np.random.default_rng(seed)
    turn, alive = rng.normal(0.0, 0.1, (ticks, 6)), rng.random((ticks, 6)) < rng.choice([1.0, 0.8, 0.1])
    values = []
    for own in (slice(0, 3), slice(3, 6)):
        changes = 0
        for robot in np.arange(6)[own]:
            sides = ("0" if abs(w) <= 0.05 else "+" if w > 0 else "-" for w in turn[:, robot])
            lives = "".join(side if alive[k, robot] else " " for k, side in enumerate(sides)).replace("0", "").split()
            changes += sum(life.count("+-") + life.count("-+") for life in lives)
        living = np.count_nonzero(alive[:, own])
        values.append(changes / living * PER_MIN if living else np.nan)
    assert oscillation(turn, alive=alive, arenas=2) == pytest.approx(values, nan_ok=True)
