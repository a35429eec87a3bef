import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.swarm.oscillation import Oscillation
from tests.support.metrics.swarm.swarms import told
from tests.support.metrics.truths import static, truth

PER_MIN = 60 * 10  # ticks


def after(turn_radps, alive=None, arenas=1, **parameters):
    """What is told at the last of ticks with these turning commands, (ticks, rows)."""
    turn = np.asarray(turn_radps, float)
    alive = np.ones(turn.shape, np.bool_) if alive is None else alive
    of = static(turn.shape[1] // arenas, arenas=arenas)
    command = np.stack([0 * turn, turn, 0 * turn], axis=-1)
    ticks = [truth(of, tick, command=command[tick], alive=alive[tick]) for tick in range(len(turn))]
    return told(Oscillation(**parameters), *ticks, of=of)


def test_a_robot_that_dithers_changes_sides_in_every_tick():
    assert after([[1.0], [-1.0], [1.0], [-1.0]]) == [pytest.approx(3 / 4 * PER_MIN)]


def test_turning_one_way_going_straight_and_turning_little_are_no_changes():
    assert after([[1.0], [0.0], [1.0], [-0.04], [0.3]]) == [0.0]


def test_going_straight_in_between_does_not_hide_a_change():
    assert after([[1.0], [0.0], [0.0], [-1.0]]) == [pytest.approx(1 / 4 * PER_MIN)]


def test_the_dead_band_is_a_parameter():
    assert after([[0.2], [-0.2]], dead_band_radps=0.2) == [0.0]
    assert after([[0.2], [-0.2]], dead_band_radps=0.1) == [pytest.approx(1 / 2 * PER_MIN)]


def test_the_dead_neither_count_nor_remember():
    alive = np.array([[True, True], [True, False], [True, True]])
    assert after([[0, 1], [0, -1], [0, -1]], alive=alive) == [0.0]
    assert np.isnan(after([[1.0], [-1.0]], alive=np.zeros((2, 1), np.bool_))).all()


@given(st.integers(0, 1000), st.integers(1, 25))
def test_it_is_that_of_the_definition(seed, ticks):
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
    assert after(turn, alive=alive, arenas=2) == pytest.approx(values, nan_ok=True)
