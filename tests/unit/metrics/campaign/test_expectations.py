"""Expectations of runs and campaigns are met by intervals, never by failed or missing runs."""

from xml.etree import ElementTree as ET

import pytest
from scipy.stats import binomtest
from typer.testing import CliRunner

from swarmwire.deploy import run
from swarmwire.deploy.cli.app import app
from swarmwire.metrics.records.campaign.expectations import parse_expectation, verdicts
from tests.support.deploy.runs import ROOT
from tests.support.metrics.campaigns import write_campaign
from tests.support.refusals import refused_input

AT = {"radio.loss": [0.0, 0.4]}


def are_met(folder, *expectations: str) -> list[bool]:
    return [verdict.is_met for verdict in verdicts(str(folder), [parse_expectation(text) for text in expectations])]


def test_expectation_of_a_campaign_is_checked_at_each_point_by_its_interval(tmp_path):
    """Medians are near 0.95 and 0.71, with a standard deviation of 0.05 and ten runs."""
    folder = write_campaign(tmp_path / "a", AT)
    assert are_met(folder, "order >= 0.85") == [True, False]
    assert are_met(folder, "order < 0.8", "order.final.mean <= 0.8") == [False, True, False, True]
    assert are_met(f"{folder}@radio.loss=0.4", "order >= 0.7") == [False]  # the median is above, its interval not
    assert are_met(f"{folder}@radio.loss=0.4", "order.final.q50 > 0.6") == [True]


@pytest.mark.parametrize("times_s", [(10.0,) * 9 + (None,), (10.0,) * 6 + (None,) * 4])
def test_expectation_in_a_share_of_runs_uses_wilsons_lower_end(tmp_path, times_s):
    values = iter(times_s)
    folder = write_campaign(tmp_path / "a", {"radio.loss": [0.0]}, times={"found_s": lambda *_: next(values)})
    successes = sum(time_s is not None for time_s in times_s)
    low = binomtest(successes, 10).proportion_ci(0.95, method="wilson").low
    below, above = (f"found_s <= 60 in {100 * (low + change):.3f} % of runs" for change in (-0.001, 0.001))
    assert are_met(folder, below, above) == [True, False]


def test_expectation_of_a_censored_time_has_no_upper_bound_that_holds(tmp_path):
    folder = write_campaign(tmp_path / "a", {"radio.loss": [0.0]}, times={"found_s": lambda *_: None}, limit_s=50.0)
    assert are_met(folder, "found_s < 1e9", "found_s < 1e9 in 1 % of runs") == [False, False]
    assert are_met(folder, "found_s > 49 in 50 % of runs", "found_s > 51 in 50 % of runs") == [True, False]


@pytest.mark.parametrize("faults", [{"failed": (3,)}, {"missing": (3,)}])
def test_expectation_is_not_met_where_a_run_failed_or_is_missing(tmp_path, faults):
    folder = write_campaign(tmp_path / "a", AT, **faults)
    assert are_met(folder, "order >= 0", "order >= 0 in 10 % of runs") == [False, True, False, True]


@pytest.mark.parametrize(("seeds", "is_met"), [(5, False), (6, True)])
def test_expectation_of_a_campaign_needs_runs_for_an_interval(tmp_path, seeds, is_met):
    folder = write_campaign(tmp_path / "a", {"radio.loss": [0.0]}, seeds=range(seeds))
    assert are_met(folder, "order >= 0", "order.final.mean >= 0") == [is_met] * 2


def test_expectation_is_not_met_where_a_run_has_no_value(tmp_path):
    values = iter([float("nan"), *[1.0] * 9])
    folder = write_campaign(tmp_path / "a", {"radio.loss": [0.0]}, numbers={"order.final": lambda *_: next(values)})
    assert are_met(folder, "order >= 0", "order.final.mean >= 0", "order >= 0 in 50 % of runs") == [False, False, True]


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("order", "order"),
        ("order >= high", "order >= high"),
        ("order >= nan", "order >= nan"),
        ("order >= 1 in 101 % of runs", "order >= 1 in 101 % of runs"),
        ("order.q25 >= 0", "order.q25 >= 0"),
        ("order.final.mean >= 0 in 50 % of runs", "order.final.mean >= 0 in 50 % of runs"),
        ("odrer >= 1", "odrer"),
    ],
)
def test_expectation_that_cannot_be_checked_is_refused(tmp_path, text, key):
    folder = write_campaign(tmp_path / "a", AT)
    with refused_input(key=key):
        are_met(folder, text)


def test_expect_command_exits_with_1_and_writes_junit(tmp_path):
    run(ROOT / "scenarios" / "flocking.toml", overrides=["duration_s=1"], out=tmp_path / "run")
    expectations = ["order <= 1", "radio.sent > 0", "counts.no_such_fault <= 0", "order.mean > 1"]
    junit = tmp_path / "junit.xml"
    done = CliRunner().invoke(app, ["expect", str(tmp_path / "run"), *expectations, "--junit", str(junit)])
    assert done.exit_code == 1
    suite = ET.parse(junit).getroot()
    assert (suite.attrib["tests"], suite.attrib["failures"]) == ("4", "1")
    assert [case.find("failure") is None for case in suite] == [True, True, True, False]
    assert CliRunner().invoke(app, ["expect", str(tmp_path / "run"), *expectations[:3]]).exit_code == 0
