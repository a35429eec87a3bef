"""Reads what a campaign wrote, finished or not, and refuses what is none."""

import json
from typing import get_args

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.campaign.spec import Stat
from tests.support.metrics.campaigns import write_campaign


def rewritten(folder, **changes):
    path = folder / "campaign.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return folder


def test_a_finished_campaign_has_every_run_in_order(tmp_path):
    campaign = CampaignFolder(write_campaign(tmp_path / "a", seeds=(7, 3, 5)))
    assert campaign.finished
    assert campaign.missing == ()
    assert campaign.parameters == ("radio.loss",)
    assert [point["radio.loss"] for point in campaign.points] == [0.0, 0.2, 0.4]
    assert campaign.runs["run"].to_list() == list(range(9))
    assert campaign.sample("order", 1).seed.tolist() == [7, 3, 5]


def test_parts_give_the_same_rows_as_the_whole(tmp_path):
    whole = CampaignFolder(write_campaign(tmp_path / "whole"))
    parts = CampaignFolder(write_campaign(tmp_path / "parts", parts=3))
    assert parts.runs.equals(whole.runs)
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


def test_a_file_that_is_being_written_is_not_read(tmp_path):
    folder = write_campaign(tmp_path / "a", parts=1)
    (folder / "parts" / ".aside-part-000001.parquet").write_text("half of a file")
    assert CampaignFolder(folder).finished


def test_failed_runs_are_counted_and_have_no_value(tmp_path):
    sample = CampaignFolder(write_campaign(tmp_path / "a", failed=(1, 2))).sample("aggregation_time_s", 0)
    assert (len(sample), sample.failed, sample.seed.tolist()) == (8, 2, [1, *range(4, 11)])


def test_a_time_that_never_came_is_censored_where_its_run_ended(tmp_path):
    times = {"never_s": lambda *_: None, "soon_s": lambda *_: 3.0}
    campaign = CampaignFolder(write_campaign(tmp_path / "a", times=times, limit_s=40.0))
    never, soon = campaign.sample("never_s", 0), campaign.sample("soon_s", 0)
    assert never.value.tolist() == [40.0] * 10
    assert (never.censored, soon.censored) == (1.0, 0.0)
    assert soon.observed.all()


def test_a_number_that_was_not_to_be_measured_is_undefined(tmp_path):
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
def test_a_time_has_every_statistic(tmp_path, stat):
    found = CampaignFolder(write_campaign(tmp_path / "a")).statistic(f"aggregation_time_s.{stat}")
    assert (found.response.kind, found.stat) == ("time", stat)


@pytest.mark.parametrize(
    ("name", "hint"),
    [("ordre.final", "order.final (did you"), ("order.q51", ""), ("order.censored", "time"), ("", ""), (".q50", "")],
)
def test_a_statistic_that_there_is_not_is_refused(tmp_path, name, hint):
    campaign = CampaignFolder(write_campaign(tmp_path / "a"))
    with pytest.raises(BadInput, check=lambda error: error.key == name and hint in error.expected):
        campaign.statistic(name)


@pytest.mark.parametrize("point", [-1, 3])
def test_a_point_that_there_is_not_is_refused(tmp_path, point):
    with pytest.raises(BadInput, check=lambda error: error.key == "point"):
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
def test_a_damaged_or_foreign_campaign_is_refused_with_its_key(tmp_path, changes, key):
    folder = rewritten(write_campaign(tmp_path / "a"), **changes)
    with pytest.raises(BadInput) as refused:
        CampaignFolder(folder)
    assert (refused.value.where, refused.value.key) == (str(folder / "campaign.json"), key)


def test_what_is_no_campaign_is_refused(tmp_path):
    with pytest.raises(BadInput, check=lambda error: error.where == str(tmp_path / "nothing")):
        CampaignFolder(tmp_path / "nothing")
    with pytest.raises(BadInput, check=lambda error: (error.where, error.key) == (str(tmp_path), "campaign.json")):
        CampaignFolder(tmp_path)
    for text in ("[]", "{"):
        (tmp_path / "campaign.json").write_text(text)
        with pytest.raises(BadInput, check=lambda error: error.where == str(tmp_path / "campaign.json")):
            CampaignFolder(tmp_path)


def test_a_damaged_table_is_refused_when_it_is_read(tmp_path):
    folder = write_campaign(tmp_path / "a")
    (folder / "summary.parquet").write_text("no table")
    with pytest.raises(BadInput, check=lambda error: error.where == str(folder / "summary.parquet")):
        _ = CampaignFolder(folder).runs
    pl.DataFrame({"run": [0]}).write_parquet(folder / "summary.parquet")
    with pytest.raises(BadInput, check=lambda error: error.key == "point"):
        _ = CampaignFolder(folder).runs


def test_a_time_that_must_hold_is_watched_for_so_much_less_than_the_run(tmp_path):
    folder = write_campaign(tmp_path / "a")
    responses = json.loads((folder / "campaign.json").read_text())["responses"]
    held = [of | {"hold_s": 5.0} if of["column"] == "aggregation_time_s" else of for of in responses]
    before = CampaignFolder(folder).sample("aggregation_time_s", 2)
    after = CampaignFolder(rewritten(folder, responses=held)).sample("aggregation_time_s", 2)
    assert not before.observed.all()
    np.testing.assert_array_equal(after.value, before.value - np.where(before.observed, 0.0, 5.0))
