"""What --search says, and what a goal makes of the runs of a trial: also of times that were not reached."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from swarmwire.deploy.campaigns.store import StorageFailed
from swarmwire.deploy.campaigns.tuning.spec import Search, fresh_seeds, goal_of, sample_of, search_from, search_of
from swarmwire.deploy.campaigns.tuning.study import StudyFile
from swarmwire.metrics.records.campaign.campaign_json import Response
from tests.support.refusals import refused_input


def search(text, integer=False):
    return search_from(search_of(text), lambda _: integer)


def test_search_range_has_integers_for_integer_keys():
    assert search("radio.loss=0:0.8") == Search("radio.loss", 0.0, 0.8)
    assert search("a.b=1:100:log") == Search("a.b", 1.0, 100.0, log=True)
    assert search("a=2:9.6", integer=True) == Search("a", 2.0, 10.0, whole=True)
    assert search("a=2:9", integer=True).trials == (2, 9)
    assert search("a=0.02:0.2").override(0.1) == "a=0.1"


@pytest.mark.parametrize(
    ("text", "value", "end"),
    [
        ("a=0:1", 0.995, 1.0),
        ("a=0:1", 0.005, 0.0),
        ("a=0:1", 0.5, None),
        ("a=1:10000:log", 1.05, 1.0),
        ("a=1:10000:log", 150.0, None),
        ("a=discs,pymunk", "discs", None),
    ],
)
def test_value_at_the_end_of_its_range_is_recognised(text, value, end):
    assert search(text).end_at(value) == end


def test_choices_are_toml_values_known_by_their_texts():
    variation = search("a=[4.0, 4.0],[8.0, 8.0]")
    assert variation.names == ("[4.0, 4.0]", "[8.0, 8.0]")
    assert variation.value("[8.0, 8.0]") == [8.0, 8.0]
    assert search("a=discs,pymunk").value("pymunk") == "pymunk"
    assert search("a=0.5,2,true").choices == (0.5, 2, True)


@pytest.mark.parametrize(
    "text",
    ["radio.loss", "=1", "a=", "a=0:1:5", "a=0:1:5:log", "a=0:", "a=1:1", "a=2:1", "a=0:1:log", "a=1,1", "a='1',1"],
)
def test_search_text_that_is_no_range_is_refused(text):
    with refused_input(f"--search {text}", match="^((?!COUNT).)*$"):
        search(text)


@pytest.mark.parametrize("text", ["a=1.1:1.2", "a=0.2:3:log"])
def test_search_range_without_integers_for_an_integer_key_is_refused(text):
    with refused_input(f"--search {text}", match="expected LOW"):
        search(text, integer=True)


def test_fresh_seeds_are_none_of_those_used():
    assert fresh_seeds("3", (1, 2, 5)) == (6, 7, 8)
    assert fresh_seeds("10:12", (1, 2, 5)) == (10, 11)
    assert fresh_seeds("3,4", (1, 2, 5)) == (3, 4)
    for text, used in (("5:9", (1, 2, 5)), ("0", (1, 2, 5)), ("x", (1, 2, 5)), ("2", (2**63 - 1,))):
        with refused_input("--check-seeds"):
            fresh_seeds(text, used)


ORDER = Response("order.final", "", "number", "")
TIME = Response("aggregation_time_s", "s", "time", "")
LIMIT_S = 60.0


def reached(goal, values, end_s=LIMIT_S):
    parsed = goal_of(goal, (ORDER, TIME), LIMIT_S)
    rows = [{"seed": seed, "sim_time_s": end_s, parsed.response.column: value} for seed, value in enumerate(values)]
    return parsed.reached(sample_of(rows, parsed.response))


@pytest.mark.parametrize(
    ("goal", "value"),
    [("max order", 3.0), ("max order.final.q25", 2.0), ("min order.final.q75", 4.0), ("max order.final.mean", 4.0)],
)
def test_goal_over_numbers_is_their_statistic(goal, value):
    assert reached(goal, [1.0, 2.0, 3.0, 4.0, 10.0]) == (value, value, 0.0, 0)


def test_goal_over_times_is_kaplan_meier_with_mean_up_to_the_limit():
    times = [10.0, 20.0, 30.0, 40.0, None]
    assert reached("min aggregation_time_s", times).value == 30.0
    assert reached("min aggregation_time_s.q25", times).value == 20.0
    assert reached("min aggregation_time_s.mean", times).value == pytest.approx((10 + 20 + 30 + 40 + 60) / 5)
    assert reached("min aggregation_time_s.censored", times).value == pytest.approx(0.2)


def test_goal_quantile_not_reached_grows_with_censored_runs():
    values = []
    for missing in range(6):
        value = reached("min aggregation_time_s.q50", [59.0] * (5 - missing) + [None] * missing)
        assert math.isnan(value.statistic) == (missing >= 3)
        assert value.censored == pytest.approx(missing / 5)
        values.append(value.value)
    assert values == pytest.approx([59.0, 59.0, 59.0, 96.0, 108.0, 120.0])


def test_runs_that_ended_early_are_no_better_than_those_that_did_not():
    early = reached("min aggregation_time_s", [None, None, None], end_s=5.0)
    assert early.value == 120.0
    assert reached("min aggregation_time_s.mean", [None, None, None], end_s=5.0).value == LIMIT_S


def test_goal_counts_undefined_values_and_is_nan_without_any():
    assert reached("max order", [1.0, None, 3.0]) == (2.0, 2.0, 0.0, 1)
    assert np.isnan(reached("max order", [None, math.nan]).value)


def test_goal_direction_decides_which_value_is_better():
    least, most = (goal_of(f"{way} order", (ORDER,), LIMIT_S) for way in ("min", "max"))
    assert least.better(1.0, 2.0)
    assert most.better(2.0, 1.0)
    assert not least.better(1.0, 1.0)
    assert (least.text, most.text) == ("min order.final.q50", "max order.final.q50")


@pytest.mark.parametrize("text", ["order", "least order", "min", "min ordr.final", "min order.final.censored"])
def test_another_goal_is_refused(text):
    with refused_input("--goal"):
        goal_of(text, (ORDER, TIME), LIMIT_S)


def test_linked_journal_of_a_tuning_is_refused(tmp_path):
    mine, folder = tmp_path / "mine", tmp_path / "tuning"
    mine.write_text("mine, without an end of line")
    folder.mkdir()
    (folder / "study.journal").symlink_to(mine)
    with pytest.raises(StorageFailed):
        StudyFile(folder, SimpleNamespace(searches=()))
    assert mine.read_text() == "mine, without an end of line"
