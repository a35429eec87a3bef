"""Emulated runs that a log is held against are what run folders and campaigns hold."""

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import RunFolder, sweep
from swarmwire.deploy.campaign import sweep as sweeping
from swarmwire.metrics.campaign.select import select
from swarmwire.metrics.sim_to_real.emulated_runs import runs_of_campaign, runs_of_folder
from tests.support.deploy.campaign.small import InThisProcess
from tests.support.deploy.commands import LOSSY
from tests.support.metrics.real_log.emulated import SMALL, watched

NAMES = ("order", "min_gap")


def test_of_a_run_folder(tmp_path):
    watched("duration_s=3", seed=2, out=tmp_path / "run")
    of = runs_of_folder(tmp_path / "run", NAMES)
    folder = RunFolder(tmp_path / "run")
    assert (of.robots, of.rate_hz, [run.seed for run in of.runs]) == (6, 10, [2])
    assert of.runs[0].series.keys() == set(NAMES)
    assert np.array_equal(of.runs[0].series["order"], folder.metrics()["order"].to_numpy(), equal_nan=True)
    assert of.runs[0].duration_s == pytest.approx(3.0)


def test_of_a_campaigns_point(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
    short = [*SMALL, "duration_s=3"]
    sweep(LOSSY, seeds=[1, 2], vary={"radio.loss": [0.3, 0.6]}, overrides=short, out=tmp_path / "c")
    of = runs_of_campaign(select(f"{tmp_path / 'c'}@radio.loss=0.6"), NAMES, 10, 6)
    assert [run.seed for run in of.runs] == [1, 2]
    assert all(len(run.series["order"]) == 30 for run in of.runs)
    first, *_ = (tmp_path / "c" / "series").glob("*.parquet")
    first.write_bytes(first.read_bytes()[:-1])
    with pytest.raises(BadInput) as told:
        runs_of_campaign(select(f"{tmp_path / 'c'}@radio.loss=0.6"), NAMES, 10, 6)
    assert told.value.where == str(first)
