import csv
import json
import math
from typing import get_args

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.records.campaign.campaign_json import Stat, parse_value, same_value
from swarmwire.metrics.records.campaign.compare import COLUMNS, cells, compare, notes, write_comparison
from swarmwire.metrics.records.campaign.folder import CampaignFolder, select
from swarmwire.metrics.statistics.summary import SKEWED_SAMPLE
from tests.support.metrics.campaigns import NUMBERS, TIMES, order, write_campaign
from tests.support.refusals import refused_input


def rewritten(folder, **changes):
    path = folder / "campaign.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return folder


def test_campaign_that_is_finished_has_every_run_in_order(tmp_path):
    campaign = CampaignFolder(write_campaign(tmp_path / "a", seeds=(7, 3, 5)))
    assert campaign.finished
    assert campaign.missing == ()
    assert campaign.parameters == ("radio.loss",)
    assert [point["radio.loss"] for point in campaign.points] == [0.0, 0.2, 0.4]
    assert campaign.runs["run"].to_list() == list(range(9))
    assert campaign.sample("order", 1).seed.tolist() == [7, 3, 5]


def test_parameter_values_of_a_campaign_may_be_tables(tmp_path):
    params = [{"gain": 1.0, "blocked": True}, {"gain": 2.0, "blocked": False}]
    folder = write_campaign(tmp_path / "a", {"robots.flock.params": params})
    assert [point["robots.flock.params"] for point in CampaignFolder(folder).points] == params
    assert select(f"{folder}@robots.flock.params={{gain = 2.0, blocked = false}}").points == (1,)


@pytest.mark.parametrize("name", ["lab@night", "a@radio.loss=0.4", "@", "a@b@c"])
def test_selected_folder_may_have_an_at_sign_in_its_path(tmp_path, name):
    folder = write_campaign(tmp_path / name)
    write_campaign(tmp_path / "a")
    assert select(str(folder)).points == (0, 1, 2)
    selection = select(f"{folder}@radio.loss=0.4")
    assert (selection.campaign.path, selection.points) == (folder, (2,))


def test_selected_folder_that_is_absent_is_named_with_its_at_sign(tmp_path):
    with refused_input(f"{tmp_path}/lab@night"):
        select(f"{tmp_path}/lab@night@radio.loss=0.4")


@pytest.mark.parametrize(("name", "column"), [("odrer", "order"), ("odrer.final", "order.final")])
def test_misspelt_response_suggests_the_metric(tmp_path, name, column):
    with pytest.raises(BadInput, check=lambda error: f" {column} (did you" in error.expected):
        CampaignFolder(write_campaign(tmp_path / "a")).response(name)


def test_parts_give_the_same_rows_as_the_whole(tmp_path):
    joined = CampaignFolder(write_campaign(tmp_path / "whole"))
    parts = CampaignFolder(write_campaign(tmp_path / "parts", parts=3))
    assert parts.runs.equals(joined.runs)
    assert parts.finished


def test_runs_without_a_row_are_missing_and_no_sample_has_them(tmp_path):
    campaign = CampaignFolder(write_campaign(tmp_path / "a", missing=(0, 12), parts=2))
    assert campaign.missing == (0, 12)
    assert not campaign.finished
    assert [len(campaign.sample("order.final", point)) for point in range(3)] == [9, 9, 10]


def test_before_any_run_has_ended_every_sample_is_empty(tmp_path):
    campaign = CampaignFolder(write_campaign(tmp_path / "a", missing=range(30), parts=0))
    (tmp_path / "a" / "summary.parquet").unlink()
    assert len(campaign.missing) == 30
    assert len(campaign.sample("order", 0)) == 0
    assert np.isnan(campaign.sample("aggregation_time_s", 0).censored)


def test_rows_of_a_campaign_that_was_taken_up_again_replace_those_of_before(tmp_path):
    folder = write_campaign(tmp_path / "a", failed=(4,))
    again = pl.read_parquet(write_campaign(tmp_path / "b") / "summary.parquet").filter(pl.col("run") == 4)
    (folder / "parts").mkdir()
    again.write_parquet(folder / "parts" / "part-000000.parquet")
    assert CampaignFolder(folder).sample("order", 0).failed == 0


def test_file_that_is_still_being_written_is_not_read(tmp_path):
    folder = write_campaign(tmp_path / "a", parts=1)
    (folder / "parts" / ".aside-part-000001.parquet").write_text("half of a file")
    assert CampaignFolder(folder).finished


def test_failed_runs_are_counted_and_have_no_value(tmp_path):
    sample = CampaignFolder(write_campaign(tmp_path / "a", failed=(1, 2))).sample("aggregation_time_s", 0)
    assert (len(sample), sample.failed, sample.seed.tolist()) == (8, 2, [1, *range(4, 11)])


def test_time_that_never_came_is_censored_where_its_run_ended(tmp_path):
    times = {"never_s": lambda *_: None, "soon_s": lambda *_: 3.0}
    campaign = CampaignFolder(write_campaign(tmp_path / "a", times=times, limit_s=40.0))
    never, soon = campaign.sample("never_s", 0), campaign.sample("soon_s", 0)
    assert never.value.tolist() == [40.0] * 10
    assert (never.censored, soon.censored) == (1.0, 0.0)
    assert soon.observed.all()


def test_runs_that_a_stop_condition_ended_before_the_time_are_counted(tmp_path):
    times = {"slow_s": lambda *_: 60.0, "soon_s": lambda *_: 3.0, "stop_time_s": lambda *_: None}
    folder = write_campaign(tmp_path / "a", times=times, stopped={0: 8.5, 2: 20.0})
    slow, soon, stop = (CampaignFolder(folder).sample(name, 0) for name in times)
    assert slow.stopped_first.tolist() == [8.5, 20.0]
    assert not len(soon.stopped_first)
    assert not len(stop.stopped_first)  # of itself it is the end of the run


def test_number_without_a_value_is_undefined_in_a_sample(tmp_path):
    numbers = {"gap_m.final": lambda _, rng: None if rng.random() < 0.5 else 1.0}
    sample = CampaignFolder(write_campaign(tmp_path / "a", numbers=numbers)).sample("gap_m", 0)
    assert 0 < sample.undefined < 10
    assert len(sample) + sample.undefined == 10
    assert sample.censored == 0.0


@pytest.mark.parametrize(
    ("name", "means"),
    [
        ("order", "order.final.q50"),
        ("order.final", "order.final.q50"),
        ("order.mean", "order.mean.q50"),  # a column of this name is meant
        ("order.mean.mean", "order.mean.mean"),
        ("order.q25", "order.final.q25"),
        ("aggregation_time_s", "aggregation_time_s.q50"),
        ("aggregation_time_s.censored", "aggregation_time_s.censored"),
    ],
)
def test_statistics_go_by_column_and_stat(tmp_path, name, means):
    assert CampaignFolder(write_campaign(tmp_path / "a")).statistic(name).name == means


@pytest.mark.parametrize("stat", get_args(Stat))
def test_time_response_has_every_statistic(tmp_path, stat):
    statistic = CampaignFolder(write_campaign(tmp_path / "a")).statistic(f"aggregation_time_s.{stat}")
    assert (statistic.response.kind, statistic.stat) == ("time", stat)


@pytest.mark.parametrize(
    ("name", "hint"),
    [("ordre.final", "order.final (did you"), ("order.q51", ""), ("order.censored", "time"), ("", ""), (".q50", "")],
)
def test_unknown_statistic_is_refused(tmp_path, name, hint):
    campaign = CampaignFolder(write_campaign(tmp_path / "a"))
    with pytest.raises(BadInput, check=lambda error: error.key == name and hint in error.expected):
        campaign.statistic(name)


@pytest.mark.parametrize("point", [-1, 3])
def test_unknown_point_is_refused(tmp_path, point):
    with refused_input(key="point"):
        CampaignFolder(write_campaign(tmp_path / "a")).sample("order", point)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"seeds": [1, 1]}, "seeds"),
        ({"seeds": [True]}, "seeds[0]"),
        ({"seeds": []}, "seeds"),
        ({"points": []}, "points"),
        ({"points": [{"radio.loss": 0.1}, {}]}, "points[1]"),
        ({"points": [3]}, "points[0]"),
        ({"design": "gird"}, "design"),
        ({"duration_s": "1"}, "duration_s"),
        ({"duration_s": True}, "duration_s"),
        ({"responses": [{"column": "x", "unit": "", "kind": "level", "help": ""}]}, "responses[0].kind"),
        ({"responses": [{"column": "x"}]}, "responses[0].unit"),
        ({"files": [3]}, "files[0]"),
        ({"files": [{"what": "a"}]}, "files[0].path"),
        ({"overrides": [3]}, "overrides[0]"),
        ({"modules": []}, "modules"),
        ({"name": None}, "name"),
    ],
)
def test_damaged_campaign_json_is_refused_with_file_and_key(tmp_path, changes, key):
    folder = rewritten(write_campaign(tmp_path / "a"), **changes)
    with refused_input(folder / "campaign.json", key):
        CampaignFolder(folder)


def test_folder_without_a_campaign_is_refused(tmp_path):
    with refused_input(tmp_path / "nothing"):
        CampaignFolder(tmp_path / "nothing")
    with refused_input(tmp_path, "campaign.json"):
        CampaignFolder(tmp_path)
    for text in ("[]", "{"):
        (tmp_path / "campaign.json").write_text(text)
        with refused_input(tmp_path / "campaign.json"):
            CampaignFolder(tmp_path)


def test_damaged_table_of_a_campaign_is_refused_when_it_is_read(tmp_path):
    folder = write_campaign(tmp_path / "a")
    (folder / "summary.parquet").write_text("no table")
    with refused_input(folder / "summary.parquet"):
        _ = CampaignFolder(folder).runs
    pl.DataFrame({"run": [0]}).write_parquet(folder / "summary.parquet")
    with refused_input(key="point"):
        _ = CampaignFolder(folder).runs


def test_hold_of_a_time_response_shortens_its_observation_in_a_sample(tmp_path):
    folder = write_campaign(tmp_path / "a")
    responses = json.loads((folder / "campaign.json").read_text())["responses"]
    held = [row | {"hold_s": 5.0} if row["column"] == "aggregation_time_s" else row for row in responses]
    before = CampaignFolder(folder).sample("aggregation_time_s", 2)
    after = CampaignFolder(rewritten(folder, responses=held)).sample("aggregation_time_s", 2)
    assert not before.observed.all()
    np.testing.assert_array_equal(after.value, before.value - np.where(before.observed, 0.0, 5.0))


TWO = {"radio.loss": [0.0, 0.1], "physics.engine": ["discs", "pymunk"]}


@pytest.fixture
def plain(tmp_path):
    return write_campaign(tmp_path / "plain")


@pytest.fixture
def better(tmp_path):
    """The same, with 0.1 more order, other draws, and one more loss."""
    numbers = NUMBERS | {"order.final": lambda point, rng: order(point, rng) + 0.1}
    return write_campaign(tmp_path / "better", {"radio.loss": [0.1 + 0.3, 0.2, 0.6]}, numbers=numbers, draws=1)


def compared(first, second, *responses):
    return compare(select(str(first)), select(str(second)), responses)


def test_points_that_both_have_meet_whatever_their_order(plain, better):
    comparison = compared(plain, better, "order")
    assert [(row.first_point["radio.loss"], row.second_point["radio.loss"]) for row in comparison.rows] == [
        (0.2, 0.2),
        (0.4, 0.4),
    ]
    assert comparison.paths == ("radio.loss",)
    for row in comparison.rows:
        assert row.difference.pairs == 10
        assert row.difference.median == pytest.approx(0.1, abs=0.06)
        assert row.difference.delta > 0.5
        assert row.second.q50 > row.first.q50


def test_times_and_last_values_are_compared_unless_others_are_named(plain, better):
    columns = [row.response.column for row in compared(f"{plain}@radio.loss=0.2", f"{better}@radio.loss=0.2").rows]
    assert columns == ["order.final", "radio.link_pdr", "aggregation_time_s"]
    assert [row.response.column for row in compared(plain, better, "counts.late_answers").rows] == [
        "counts.late_answers"
    ] * 2


def test_notes_of_a_comparison_count_the_intervals_by_chance_that_the_table_has(tmp_path, plain, better):
    def by_chance(comparison):
        return [line for line in notes(comparison) if "by chance" in line]

    (line,) = by_chance(compared(plain, better, "order"))
    assert line.startswith("Of 2 intervals about 0.1 ")  # 2 x (1 - 0.95)
    lone = [write_campaign(tmp_path / name, seeds=(1,)) for name in "ab"]
    assert by_chance(compared(*lone, "order")) == []


def test_response_without_values_is_compared_only_if_named(tmp_path, plain):
    folders = [
        write_campaign(tmp_path / name, numbers=NUMBERS | {"gap_m.final": lambda *_: None}, seeds=(1, 2))
        for name in "ab"
    ]
    assert "gap_m.final" not in {row.response.column for row in compared(*folders).rows}
    (row, *_) = compared(*folders, "gap_m").rows
    assert (row.first.n, row.first.undefined) == (0, 2)
    none = write_campaign(tmp_path / "none", missing=range(30))
    with refused_input(f"{none}, {none}"):
        compared(none, none)


def test_selected_points_of_one_campaign_are_compared(plain):
    comparison = compared(f"{plain}@radio.loss=0", f"{plain}@radio.loss=0.4", "order.final")
    assert comparison.paths == ()
    (row,) = comparison.rows
    assert (row.first_point["radio.loss"], row.second_point["radio.loss"]) == (0.0, 0.4)
    assert row.difference.median < -0.15
    assert cells(comparison, row)[1] == "A: radio.loss=0; B: radio.loss=0.4"


def test_parameter_that_one_campaign_alone_varies_stands_in_its_label(tmp_path, plain):
    both = write_campaign(tmp_path / "both", TWO)
    comparison = compared(both, f"{plain}@radio.loss=0", "order")
    assert cells(comparison, comparison.rows[0])[1] == "A: radio.loss=0, physics.engine=discs; B: radio.loss=0"
    comparison = compared(both, plain, "order")
    assert [cells(comparison, row)[1] for row in comparison.rows] == [
        "radio.loss=0; A: physics.engine=discs",
        "radio.loss=0; A: physics.engine=pymunk",
    ]
    assert len(compared(f"{both}@physics.engine=discs", plain, "order").rows) == 1


def test_campaigns_that_vary_nothing_have_one_point(tmp_path):
    folders = [write_campaign(tmp_path / name, {}, points=[{}]) for name in "ab"]
    comparison = compared(*folders, "order")
    assert [cells(comparison, row)[1] for row in comparison.rows] == ["all"]


def test_comparison_notes_count_runs_failed_and_missing(tmp_path, plain):
    part = write_campaign(tmp_path / "part", failed=(0, 1), missing=(25,), parts=1)
    comparison = compared(plain, part)
    lines = "\n".join(notes(comparison))
    assert all(text in lines for text in (f"A: {plain} (30 ", f"B: {part} (", "29 of 30", "2 failed", "95 %"))
    assert [len(cells(comparison, row)) for row in comparison.rows] == [len(COLUMNS)] * 9
    assert cells(comparison, comparison.rows[0])[-1] == "8"


def test_times_of_runs_that_a_stop_condition_ended_are_warned_of(tmp_path, plain):
    times = {"slow_s": lambda *_: 60.0}
    cut, full = (
        write_campaign(tmp_path / name, times=times, stopped=stopped)
        for name, stopped in (("cut", {0: 8.5, 11: 30.0}), ("whole", None))
    )
    warned = [line for line in notes(compared(cut, full, "slow_s")) if line.startswith("slow_s:")]
    assert len(warned) == 1
    assert "2 of 60" in warned[0]
    assert "8.5 s" in warned[0]
    assert not [line for line in notes(compared(plain, plain)) if "[stop]" in line]


def test_discrete_outcomes_are_compared_by_their_means(tmp_path):
    one, other = (
        write_campaign(tmp_path / str(share), numbers={"groups.final": lambda _, rng, p=share: float(rng.random() < p)})
        for share in (0.1, 0.4)
    )
    comparison = compared(one, other, "groups")
    row = comparison.rows[0]
    assert cells(comparison, row)[4].endswith("(mean)")
    assert float(cells(comparison, row)[4].split()[0]) == pytest.approx(row.difference.mean, abs=0.005)
    assert any(line.startswith("(mean)") for line in notes(comparison))


@pytest.mark.parametrize(("rare", "is_skewed"), [(29, True), (15, False)])
def test_skewed_sample_of_a_mean_is_warned_of(tmp_path, rare, is_skewed):
    """Of 30 differences between seeds one alone, or every second, is 1."""
    turns = iter(range(30))
    paths = [
        write_campaign(tmp_path / name, {}, range(30), numbers={"groups.final": make}, points=[{}])
        for name, make in (("one", lambda *_: 1.0), ("other", lambda *_: 1.0 + (next(turns) >= rare)))
    ]
    assert any(SKEWED_SAMPLE in line for line in notes(compared(*paths, "groups"))) == is_skewed


def test_medians_of_another_sign_than_the_difference_are_noted(tmp_path):
    """Seeds 1 to 3: A 0, 10, 11 and B 1, 9.5, 12: differences 1, -0.5, 1 beside medians 10 and 9.5."""
    values = {"a": iter([0.0, 10.0, 11.0]), "b": iter([1.0, 9.5, 12.0])}
    one, other = (
        write_campaign(
            tmp_path / name, {}, points=[{}], seeds=(1, 2, 3), numbers={"gap_m.final": lambda *_, gaps=gaps: next(gaps)}
        )
        for name, gaps in values.items()
    )
    comparison = compared(one, other, "gap_m")
    assert any(line.startswith("gap_m.final at all") and "sign" in line for line in notes(comparison))


def test_samples_without_a_seed_in_common_are_said_to_be(tmp_path, plain):
    other = write_campaign(tmp_path / "other", seeds=range(50, 60))
    comparison = compared(f"{plain}@radio.loss=0", f"{other}@radio.loss=0", "aggregation_time_s", "order")
    assert [cells(comparison, row)[-1] for row in comparison.rows] == ["none (10, 10)"] * 2
    assert [row.difference.test for row in comparison.rows] == ["log-rank", "Mann-Whitney"]


def test_comparison_csv_has_the_numbers_of_the_rows(tmp_path, plain, better):
    never = write_campaign(tmp_path / "never", times={"aggregation_time_s": lambda *_: None})
    comparison = compared(never, better)
    write_comparison(comparison, tmp_path / "x.csv")
    rows = list(csv.DictReader((tmp_path / "x.csv").read_text().splitlines()))
    assert len(rows) == len(comparison.rows)
    assert rows[0]["response"] == "order.final"
    assert float(rows[0]["median_difference"]) == comparison.rows[0].difference.median
    assert rows[0]["a.radio.loss"] == rows[0]["b.radio.loss"] == "0.2"
    last = rows[-1]
    assert (last["kind"], last["a_censored"], last["a_q50"], last["a_limit"]) == ("time", "1.0", "", "100.0")
    assert last["median_difference_low"] == "-inf"
    assert math.isnan(comparison.rows[-1].first.q50)


@pytest.mark.parametrize("name", ["x.txt", "nowhere/x.csv"])
def test_path_that_takes_no_table_is_refused_for_a_comparison(tmp_path, plain, name):
    with pytest.raises(BadInput):
        write_comparison(compared(plain, plain), tmp_path / name)


@pytest.mark.parametrize(
    ("first", "second", "key", "hint"),
    [
        ("plain", "other", "", "vary"),
        ("plain", "far", "", "points"),
        ("plain", "strange", "", "responses"),
        ("plain", "nothing", "", "none"),
        ("plain@radio.los=0", "plain", "radio.los", "radio.loss .did you mean this"),
        ("plain@radio.loss=0.3", "plain", "radio.loss", "0, 0.2, 0.4"),
        ("plain@radio.loss", "plain", "radio.loss", "="),
        ("plain@radio.loss=", "plain", "radio.loss=", "="),
    ],
)
def test_campaigns_that_cannot_be_compared_are_refused_with_key(tmp_path, plain, first, second, key, hint):
    write_campaign(tmp_path / "other", {"physics.engine": ["discs", "pymunk"]})
    write_campaign(tmp_path / "far", {"radio.loss": [0.9]})
    write_campaign(tmp_path / "strange", numbers={"gap_m.final": lambda *_: 1.0}, times={})
    with refused_input(key=key, match=hint):
        compared(tmp_path / first, tmp_path / second)


def test_responses_of_another_kind_are_not_the_same(tmp_path, plain):
    other = write_campaign(tmp_path / "other", numbers=NUMBERS | TIMES, times={})
    with pytest.raises(BadInput, match="aggregation_time_s"):
        compared(plain, other, "aggregation_time_s")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (0.1 + 0.2, 0.3, True),
        (1, 1.0, True),
        (1, True, False),
        (True, True, True),
        ("a", "a", True),
        ("1", 1, False),
        (None, None, True),
        ([1, 2], [1, 2], True),
    ],
)
def test_values_are_the_same_but_for_rounding(one, other, same):
    assert same_value(one, other) is same
    assert same_value(other, one) is same


@pytest.mark.parametrize(
    ("text", "value"), [("[1, 2]", [1, 2]), ('"a b"', "a b"), ("a b", "a b"), ("1\nb = 2", "1\nb = 2")]
)
def test_values_are_written_as_in_a_scenario_or_as_they_are(text, value):
    assert parse_value(text) == value
