"""What is asked of an execution: seeds, which mean the same wherever they are asked for; runners and pace."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.config import MAX_ARENAS, choose_seeds, real_time_factor, runner_count, seed_list
from swarmwire.world.scenario_file import scenario_from
from tests.support.world.scenes import changed

SCENARIO = scenario_from(changed("seed", 5), "mine.toml")


def test_seeds_are_how_many_a_range_without_its_end_or_a_list():
    assert seed_list("3") == seed_list(3) == seed_list(" 3 ") == (1, 2, 3)
    assert seed_list("4:7") == (4, 5, 6)
    assert seed_list("7,1,5") == seed_list([7, 1, 5]) == (7, 1, 5)
    assert seed_list("9,") == seed_list("9:10") == seed_list([9]) == (9,)


@given(st.lists(st.integers(0, 2**63 - 1), min_size=1, max_size=9, unique=True))
def test_any_seeds_can_be_written_as_a_list(seeds):
    assert seed_list(",".join(map(str, seeds)) + ",") == seed_list(seeds) == tuple(seeds)


@pytest.mark.parametrize(
    "of",
    ["0", "", "x", "0.5", "5:5", "9:1", "1,1", "-1,2", "1:99999999999999999999", "9" * 30, [], [1.5], [-1], [2**63]],
)
def test_what_gives_no_seeds_is_refused_by_its_name(of):
    with pytest.raises(BadInput) as told:
        seed_list(of, "--record-seeds")
    assert told.value.where == "--record-seeds"


@pytest.mark.parametrize(
    ("seed", "seeds", "chosen"),
    [(None, None, (5,)), (0, None, (0,)), (7, None, (7,)), (None, [3, 0], (3, 0)), (None, "3", (1, 2, 3))],
)
def test_the_seeds_are_those_asked_for_or_the_scenarios_own(seed, seeds, chosen):
    assert choose_seeds(SCENARIO, seed, seeds) == chosen


@pytest.mark.parametrize(("seed", "seeds", "where"), [(1, "2", "--seed"), (-1, None, "--seed"), (None, [], "--seeds")])
def test_seeds_that_are_no_good_are_refused_by_their_option(seed, seeds, where):
    with pytest.raises(BadInput) as told:
        choose_seeds(SCENARIO, seed, seeds)
    assert told.value.where == where


def test_so_many_arenas_as_no_machine_has_room_for_are_refused():
    assert len(choose_seeds(SCENARIO, None, MAX_ARENAS)) == MAX_ARENAS
    with pytest.raises(BadInput, match="sweep takes more"):
        choose_seeds(SCENARIO, None, MAX_ARENAS + 1)


@pytest.mark.parametrize(
    ("runners", "count"), [(None, 0), ("none", 0), ("per-robot", 6), (1, 1), (6, 6), ("1", 1), ("6", 6)]
)
def test_runners_are_a_number_or_a_word(runners, count):
    assert runner_count(runners, 6) == count


@pytest.mark.parametrize(("asked", "factor"), [(None, None), (1, 1.0), ("0.5", 0.5), (1e6, 1e6), ("1e-3", 0.001)])
def test_a_pace_may_be_written_as_text(asked, factor):
    assert real_time_factor(asked) == factor
