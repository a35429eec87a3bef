"""Robots that walk: random walks, covering, and the states of aggregation."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import Aggregation, Coverage, RandomWalk
from swarmwire.agent.behaviours.aggregation import APPROACH, REPEL, WAIT, Beacon
from swarmwire.agent.behaviours.random_walk import Present
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.deploy import run
from tests.support.agent.behaviours.walker import Walker

SCENARIO = Path("scenarios/behaviours/random_walk.toml")
MANY = 4000


@pytest.mark.parametrize("kind", [RandomWalk, Coverage, Aggregation])
def test_rows_do_not_depend_on_one_another(kind):
    assert_rows_independent(kind, Trial(ticks=30))


@pytest.mark.parametrize("persistence", [0.0, 0.3, 0.8])
def test_persistence_is_the_mean_cosine_of_the_turns(persistence):
    turned = Walker(RandomWalk, n=MANY, persistence=persistence).first_turns_rad()
    assert np.mean(np.cos(turned)) == pytest.approx(persistence, abs=4.0 / MANY**0.5)
    assert np.mean(np.sin(turned)) == pytest.approx(0.0, abs=4.0 / MANY**0.5)


def test_who_persists_wholly_never_turns():
    walker = Walker(RandomWalk, n=20, persistence=1.0, spell_m=0.1)
    for _ in range(50):
        assert np.abs(walker.step().angular_radps).max() < 1e-12


def test_spells_are_exponential_or_all_the_same():
    random, fixed = (Walker(RandomWalk, n=MANY, spell_m=0.5, exponential=on) for on in (True, False))
    random.step()
    fixed.step()
    lengths = random.memory.left_m
    assert lengths.mean() == pytest.approx(0.5, rel=0.06)
    assert np.median(lengths) == pytest.approx(0.5 * np.log(2.0), rel=0.08)
    assert np.ptp(fixed.memory.left_m) <= 0.01 + 1e-12, "but for who has driven a step"


def test_a_spell_of_so_many_metres_takes_so_long():
    walker = Walker(RandomWalk, spell_m=0.5, exponential=False, persistence=1.0)
    left = [walker.step() and float(walker.memory.left_m[0]) for _ in range(49)]
    assert left[0] == pytest.approx(0.49)
    assert left[-1] == pytest.approx(0.01)


@pytest.mark.parametrize("near_rad", [0.0, 0.9, -0.9])
def test_the_next_heading_is_on_the_half_circle_away_from_what_is_near_ahead(near_rad):
    turned = Walker(RandomWalk, n=500, persistence=1.0).first_turns_rad(near_rad=near_rad)
    away = np.cos(turned - near_rad)
    assert away.max() < 0.35, "rays stand up to 40 degrees apart, so that their sum does not show quite where"
    assert away.min() < -0.95


def test_what_is_behind_is_in_nobodys_way():
    walker = Walker(RandomWalk, n=20, persistence=1.0)
    assert (walker.step(near_rad=np.pi).linear_mps == 0.1).all()


def test_who_tumbles_all_the_time_covers_less():
    few = ["standard_metrics=false", "duration_s=20"]
    far, tumbling = (
        run(SCENARIO, seeds=range(1, 4), overrides=[*few, f"robots.walkers.params={{ spell_m = {spell_m} }}"])
        for spell_m in (2.0, 0.05)
    )
    least = min(arena.metrics["coverage"].final for arena in far.arenas)
    assert least > max(arena.metrics["coverage"].final for arena in tumbling.arenas)


COVERAGE_SCENARIO = Path("scenarios/behaviours/coverage.toml")


def turns(*neighbours: tuple[float, float], **params: float) -> np.ndarray:
    return Walker(Coverage, Present, n=400, **params).first_turns_rad(*neighbours)


def covered(*overrides: str) -> np.ndarray:
    given = ["standard_metrics=false", "duration_s=15", *overrides]
    result = run(COVERAGE_SCENARIO, seeds=range(1, 5), overrides=given)
    return np.array([arena.metrics["coverage"].final for arena in result.arenas])


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
    assert np.count_nonzero(hearing > deaf) >= 3
    assert hearing.mean() > deaf.mean()


AGGREGATION_SCENARIO = Path("scenarios/behaviours/aggregation.toml")
NEAR, FAR = (0.1, 0.4), (0.8, 0.4)


def gatherers(n: int = 1, **params: float) -> Walker:
    return Walker(Aggregation, Beacon, n=n, **params)


@pytest.mark.parametrize("bearing_rad", [0.5, -2.0])
def test_a_robot_approaches_whom_it_hears_and_waits_when_near(bearing_rad):
    one = gatherers()
    assert one.first_turns_rad((0.8, bearing_rad)) == pytest.approx([bearing_rad])
    assert (one.memory.at == APPROACH).all()
    actions = one.step((0.1, bearing_rad))
    assert (one.memory.at == WAIT).all()
    assert (actions.linear_mps[0], actions.angular_radps[0]) == (0.0, 0.0)


def test_it_goes_where_most_are_however_far():
    turned = gatherers().first_turns_rad((0.3, -1.0), (2.0, 1.0), (2.0, 1.0))
    assert 0.0 < turned[0] < 1.0


@pytest.mark.parametrize(("neighbours", "held"), [([], 1.0), ([NEAR], 4.0), ([NEAR, NEAR, NEAR], 16.0), ([FAR], 1.0)])
def test_it_leaves_the_less_the_more_are_near(neighbours, held):
    many = gatherers(MANY, leave_per_s=5.0, return_per_s=0.0)
    many.step(NEAR)
    many.step(*neighbours)
    left = np.mean(many.memory.at == REPEL)
    assert left == pytest.approx(1.0 - np.exp(-0.5 / held), abs=4.0 * (0.25 / MANY) ** 0.5)


def test_as_in_the_source_the_number_near_need_not_count():
    many = gatherers(MANY, leave_per_s=5.0, return_per_s=0.0, crowding=0.0)
    many.step(NEAR)
    many.step(NEAR, NEAR, NEAR)
    assert np.mean(many.memory.at == REPEL) == pytest.approx(1.0 - np.exp(-0.5), abs=0.04)


def test_who_leaves_turns_its_back_and_approaches_again_after_a_while():
    one = gatherers(leave_per_s=1e9, crowding=0.0, return_per_s=0.0)
    one.step(NEAR)
    one.step(NEAR)
    assert (one.memory.at == REPEL).all()
    back = float(one.memory.turn_rad[0]) + 0.1 * 2.0 * np.sign(one.memory.turn_rad[0])  # with what it has turned by now
    assert np.cos(back - 0.4) == pytest.approx(-1.0)
    many = gatherers(MANY, leave_per_s=1e9, return_per_s=2.0)
    many.step(NEAR)
    many.step(NEAR)
    many.step(FAR)
    assert np.mean(many.memory.at == APPROACH) == pytest.approx(1.0 - np.exp(-0.2), abs=0.03)


def test_robots_gather_by_radio_and_not_without():
    few = ["standard_metrics=false", "duration_s=15", "metrics.0.metric=aggregation"]
    hearing, deaf = (
        run(AGGREGATION_SCENARIO, seeds=[1], overrides=o).arenas[0].metrics["aggregation"].final or 0.0
        for o in (few, [*few, "radio.loss=1.0"])
    )
    assert hearing > deaf > 0.0
