"""The three states of aggregation, what leads from one to another, and that robots gather by it."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import Aggregation
from swarmwire.agent.behaviours.aggregation import APPROACH, REPEL, WAIT, Beacon
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.deploy import run
from tests.support.agent.behaviours.walker import Walker

SCENARIO = Path("scenarios/behaviours/aggregation.toml")
NEAR, FAR = (0.1, 0.4), (0.8, 0.4)
MANY = 4000


def gatherers(n: int = 1, **params: float) -> Walker:
    return Walker(Aggregation, Beacon, n=n, **params)


def test_rows_do_not_depend_on_one_another():
    assert_rows_independent(Aggregation, Trial(ticks=30))


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
    few = ["standard_metrics=false", "duration_s=60", "metrics.0.metric=aggregation"]
    hearing, deaf = (
        np.array([arena.metrics["aggregation"].final for arena in run(SCENARIO, seeds=range(1, 6), overrides=o).arenas])
        for o in (few, [*few, "radio.loss=1.0"])
    )
    assert hearing.min() > deaf.max()
    assert hearing.mean() > 0.35
