"""A tuning finds a known optimum, whatever interrupts it, and says what it is worth on fresh seeds."""

import json

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.tuning.best import gained
from swarmwire.deploy.tuning.study import FILE
from swarmwire.metrics.campaign.folder import CampaignFolder
from tests.support.deploy.tuning import gone_on_with, trials_in, tuned

pytestmark = pytest.mark.usefixtures("calculated")


@pytest.mark.parametrize(("sampler", "within"), [("tpe", 0.05), ("random", 0.15)])
def test_a_known_optimum_is_found(tmp_path, scenario, sampler, within):
    found = tuned(scenario, tmp_path / "t", sampler=sampler, trials=24, seeds=1)
    assert found.is_over
    assert found.best.parameters["metrics.0.at"] == pytest.approx(0.7, abs=within)
    rows = trials_in(tmp_path / "t")
    assert rows["trial"].to_list() == list(range(24))
    assert np.allclose(rows["value"], (rows["metrics.0.at"] - 0.7) ** 2)
    assert found.best.number == rows["value"].arg_min()
    assert set(rows["state"]) == {"complete"}


def test_the_best_is_checked_on_seeds_that_no_trial_had(tmp_path, scenario):
    found = tuned(scenario, tmp_path / "t", trials=4, seeds=3, check_seeds="5")
    own, best = (CampaignFolder(tmp_path / "t" / "check" / name) for name in ("baseline", f"trial-{found.best.number}"))
    assert own.about.seeds == best.about.seeds == (4, 5, 6, 7, 8)
    assert own.sample("bowl", 0).value == pytest.approx([0.36] * 5)
    assert set(best.sample("bowl", 0).value) == {found.best.result.value}
    of, difference, interval = gained(found.check, found.tuning.goal)
    assert (of, difference) == ("medians", pytest.approx(found.best.result.value - 0.36))
    assert interval.low == interval.high == pytest.approx(difference)


@pytest.mark.parametrize("until", [1, 4, 6])
def test_ended_anywhere_and_gone_on_with_it_is_as_in_one_go(tmp_path, scenario, until):
    tuned(scenario, tmp_path / "whole", seeds=1)
    ended = tuned(scenario, tmp_path / "t", seeds=1, until=until)
    assert (ended.is_over, until <= len(ended.trials) < 10) == (False, True)
    again = gone_on_with(tmp_path / "t")
    assert again.is_over
    assert trials_in(tmp_path / "t").equals(trials_in(tmp_path / "whole"), null_equal=True)
    assert (tmp_path / "t" / "best.toml").read_text() == (tmp_path / "whole" / "best.toml").read_text()


def test_more_trials_are_those_of_a_longer_tuning(tmp_path, scenario):
    tuned(scenario, tmp_path / "whole", seeds=1, trials=14)
    tuned(scenario, tmp_path / "t", seeds=1, trials=5)
    assert gone_on_with(tmp_path / "t", trials=14).is_over
    assert trials_in(tmp_path / "t").equals(trials_in(tmp_path / "whole"), null_equal=True)
    assert json.loads((tmp_path / "t" / "tuning.json").read_text())["trials"] == 14
    with pytest.raises(BadInput, match="14") as refused:
        gone_on_with(tmp_path / "t", trials=13)
    assert refused.value.where == "--trials"


def test_a_half_written_line_of_a_killed_process_is_no_trial(tmp_path, scenario):
    tuned(scenario, tmp_path / "whole", seeds=1, trials=5)
    tuned(scenario, tmp_path / "t", seeds=1, trials=5, until=1)
    journal = tmp_path / "t" / FILE
    journal.write_bytes(journal.read_bytes() + b'{"op_code": 6, "trial')
    assert gone_on_with(tmp_path / "t").is_over
    assert trials_in(tmp_path / "t").equals(trials_in(tmp_path / "whole"), null_equal=True)


def test_a_time_that_most_runs_do_not_reach_is_worse_than_any_that_they_do(tmp_path, scenario):
    found = tuned(scenario, tmp_path / "t", "metrics.1.after_s=0.1:0.9", goal="min ready_s", trials=10)
    rows = trials_in(tmp_path / "t")
    late = rows.filter(pl.col("metrics.1.after_s") > 0.4)
    assert set(late["value"]) == {1.0}
    assert late["statistic"].null_count() == len(late)
    assert set(late["censored"]) == {1.0}
    early = rows.filter(pl.col("metrics.1.after_s") <= 0.4)
    assert all(value <= 0.5 for value in early["value"])
    assert found.best.result.value == early["value"].min()


def test_changed_files_and_other_code_are_refused(tmp_path, scenario):
    tuned(scenario, tmp_path / "t", trials=2)
    about = tmp_path / "t" / "tuning.json"
    found = json.loads(about.read_text())
    about.write_text(json.dumps({**found, "cpu": "another"}))
    with pytest.raises(BadInput, match="CPU.* another.*--force"):
        gone_on_with(tmp_path / "t")
    about.write_text(json.dumps(found))
    (tmp_path / "t" / "scenario" / "files" / "careful.py").write_text("x = 1")
    with pytest.raises(BadInput, match="scenario/files/careful.py"):
        gone_on_with(tmp_path / "t")


@pytest.mark.parametrize("text", [None, "{", "[]", '{"format": 1}', '{"format": 2}'])
def test_a_folder_that_is_no_tuning_is_refused_in_a_line(tmp_path, text):
    if text is not None:
        (tmp_path / "tuning.json").write_text(text)
    with pytest.raises(BadInput, match=f"^{tmp_path}.*expected ") as refused:
        gone_on_with(tmp_path)
    assert "\n" not in str(refused.value)
