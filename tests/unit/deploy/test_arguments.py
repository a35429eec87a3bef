"""What is asked of an execution: seeds as they were given, also 0; runners and pace by number or by word."""

import pytest

from swarmwire.deploy.arguments import choose_seeds, real_time_factor, runner_count
from swarmwire.world.scenario.scenario_file import scenario_from
from tests.support.world.samples import changed

SCENARIO = scenario_from(changed("seed", 5), "mine.toml")


@pytest.mark.parametrize(
    ("seed", "seeds", "chosen"), [(None, None, (5,)), (0, None, (0,)), (7, None, (7,)), (None, [3, 0], (3, 0))]
)
def test_the_seeds_are_those_asked_for_or_the_scenarios_own(seed, seeds, chosen):
    assert choose_seeds(SCENARIO, seed, seeds) == chosen


@pytest.mark.parametrize(
    ("runners", "count"), [(None, 0), ("none", 0), ("per-robot", 6), (1, 1), (6, 6), ("1", 1), ("6", 6)]
)
def test_runners_are_a_number_or_a_word(runners, count):
    assert runner_count(runners, 6) == count


@pytest.mark.parametrize(("asked", "factor"), [(None, None), (1, 1.0), ("0.5", 0.5), (1e6, 1e6), ("1e-3", 0.001)])
def test_a_pace_may_be_written_as_text(asked, factor):
    assert real_time_factor(asked) == factor
