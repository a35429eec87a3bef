"""Expectations from Python: `expect` raises where one is not met, and its fixture records what was measured."""

from xml.etree import ElementTree as ET

import pytest

from swarmwire.deploy import NotMet, Sweep, expect, run
from swarmwire.metrics.records.campaign.expectations import parse_expectation, verdicts
from tests.support.deploy.runs import ROOT
from tests.support.metrics.campaigns import write_campaign
from tests.support.refusals import refused_input

FLOCK = ROOT / "scenarios" / "flocking.toml"
SHORT = ["duration_s=0.5"]
EXPECTATIONS = ("order <= 1", "radio.sent > 0", "radio.fates.received > 0", "counts.nan_commands <= 0", "ticks >= 5")
OWN_TEST = """
from swarmwire.deploy import run

def test_met(expect):
    expect(run({flock!r}, overrides={short!r}), "order <= 1")

def test_not_met(expect):
    expect(run({flock!r}, overrides={short!r}), "order <= 1", "ticks > 5")
"""
pytest_plugins = ["pytester"]


@pytest.mark.parametrize("seeds", [1, 6])
def test_expect_gives_a_result_the_verdicts_of_its_folder(tmp_path, seeds):
    result = run(FLOCK, overrides=SHORT, seeds=seeds, out=tmp_path / "run")
    checked = expect(result, *EXPECTATIONS)
    assert [verdict.is_met for verdict in checked] == [True] * len(EXPECTATIONS)
    assert checked == verdicts(str(tmp_path / "run"), [parse_expectation(text) for text in EXPECTATIONS])


def test_expect_raises_with_all_verdicts_where_one_is_not_met(tmp_path):
    """Medians are near 0.95 and 0.71, with a standard deviation of 0.05 and ten runs."""
    folder = write_campaign(tmp_path / "a", {"radio.loss": [0.0, 0.4]})
    with pytest.raises(NotMet, match="^[^\n]*$") as error:
        expect(Sweep(folder, runs=20, done=20, failed=0), "order >= 0.85")
    assert isinstance(error.value, AssertionError)
    verdicts = [(each.at, each.is_met) for each in error.value.verdicts]
    assert verdicts == [("radio.loss=0", True), ("radio.loss=0.4", False)]
    assert expect(f"{folder}@radio.loss=0", "order >= 0.85") == list(error.value.verdicts[:1])


def test_expect_refuses_a_name_that_the_result_lacks():
    with refused_input(key="odrer"):
        expect(run(FLOCK, overrides=SHORT), "odrer >= 1")


def test_expect_fixture_fails_a_test_and_records_what_was_measured(pytester):
    pytester.makepyfile(OWN_TEST.format(flock=str(FLOCK), short=SHORT))
    ended = pytester.runpytest_inprocess("-p", "no:cacheprovider", "--junit-xml=junit.xml")
    ended.assert_outcomes(passed=1, failed=1)
    ended.stdout.fnmatch_lines(["E *NOT MET: ticks > 5: measured 5, 1 run"])
    cases = ET.parse(pytester.path / "junit.xml").getroot().iter("testcase")
    recorded = {case.get("name"): [item.get("name") for item in case.iter("property")] for case in cases}
    assert recorded == {"test_met": ["order <= 1"], "test_not_met": ["order <= 1", "ticks > 5"]}
