"""Covering robots turn away from those whom they hear, and so cover more than walkers that do not."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import Coverage
from swarmwire.agent.behaviours.coverage import Present
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.deploy import run
from tests.support.agent.behaviours.walker import Walker

SCENARIO = Path("scenarios/behaviours/coverage.toml")
SEEDS = range(1, 9)


def turns(*neighbours: tuple[float, float], **params: float) -> np.ndarray:
    return Walker(Coverage, Present, n=400, **params).first_turns_rad(*neighbours)


def covered(*overrides: str) -> np.ndarray:
    result = run(SCENARIO, seeds=SEEDS, overrides=["standard_metrics=false", "duration_s=40", *overrides])
    return np.array([arena.metrics["coverage"].final for arena in result.arenas])


def test_rows_do_not_depend_on_one_another():
    assert_rows_independent(Coverage, Trial())


@pytest.mark.parametrize("bearing_rad", [0.0, 1.3, -2.0])
def test_nobody_turns_towards_a_neighbour_that_is_nearer_than_the_root_of_the_repulsion(bearing_rad):
    assert np.cos(turns((0.9, bearing_rad)) - bearing_rad).max() < 0.0
    assert np.cos(turns((0.2, bearing_rad)) - bearing_rad).max() < -0.99
    assert np.cos(turns((2.0, bearing_rad)) - bearing_rad).max() > 0.9, "from farther chance has its say"


def test_the_push_falls_with_the_square_of_the_distance_and_adds_up():
    one = np.cos(turns((1.0, 0.0))).mean()
    assert np.cos(turns((2.0, 0.0))).mean() > one
    assert np.cos(turns(*[(2.0, 0.0)] * 4)).mean() == pytest.approx(one)
    assert np.cos(turns((2.0, 0.0), repulsion_m2=4.0)).mean() == pytest.approx(one)


def test_those_on_opposite_sides_push_nowhere_and_who_hears_nobody_walks_at_random():
    for turned in (turns((1.0, 0.7), (1.0, 0.7 - np.pi)), turns()):
        assert abs(np.cos(turned).mean()) < 0.15
        assert abs(np.sin(turned).mean()) < 0.15


def test_everybody_says_in_every_step_that_it_is_there():
    walker = Walker(Coverage, Present, n=3)
    assert [len(walker.step().sent) for _ in range(3)] == [3, 3, 3]


def test_robots_that_hear_one_another_cover_more_than_those_that_lose_every_packet():
    hearing, deaf = covered(), covered("radio.loss=1.0")
    assert np.count_nonzero(hearing > deaf) >= 7
    assert hearing.mean() > 1.1 * deaf.mean()
