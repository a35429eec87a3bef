"""Campaigns in real time: robots' programs run in each run, and late runs fail."""

import polars as pl
import pytest

from swarmwire.deploy import RunFolder, resume, sweep
from swarmwire.deploy.campaigns.repetition import CampaignRun
from tests.support.deploy.interfaces import DISK, STILL, line, needs_interfaces, with_program
from tests.support.refusals import refused_input

SAY = "import os, sys\nprint(os.environ['ROBOT'], *sys.argv[1:], flush=True)\nimport time\ntime.sleep(60)\n"


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    (folder / "still.py").write_text(STILL)
    (folder / "say.py").write_text(SAY)
    text = with_program(line(2), "python3", "say.py", "hello").replace("3600", "0.5")
    (folder / "line.toml").write_text(f"{text}{DISK}[radio.interface]\n")
    return folder / "line.toml"


@needs_interfaces
def test_realtime_campaign_runs_the_robots_programs_from_copies_of_their_files(scenario, tmp_path):
    done = sweep(scenario, seeds=2, realtime=1.0, max_late=1.0, record_seeds=2, out=tmp_path / "c", workers=1)
    assert (done.done, done.failed) == (2, 0)
    table = pl.read_parquet(tmp_path / "c/summary.parquet")
    assert table["sim_time_s"].to_list() == [0.5, 0.5]
    assert all(table["timing_wall_s"] > 0.5)
    assert table["timing_late"].is_between(0.0, 1.0).all()
    for run in (0, 1):
        folder = tmp_path / f"c/runs/run-{run:06d}"
        assert (folder / "programs/line-1.log").read_text() == "line-1 hello\n"
        assert (RunFolder(folder).summary or {})["mode"] == "realtime"
    with refused_input(match="realtime"):
        CampaignRun(tmp_path / "c", 0)


def test_realtime_run_that_is_late_fails_and_can_be_retried(scenario, tmp_path):
    lagging = ["time.rate_hz=1000", "robots.line.program=[]", "robots.line.agent='lagging.py:Lagging'"]
    (scenario.parent / "lagging.py").write_text(
        "import time\n" + STILL.replace("Still", "Lagging").replace("...", "time.perf_counter(); sum(range(300_000))")
    )
    plain = scenario.parent / "plain.toml"
    plain.write_text(scenario.read_text().replace("[radio.interface]\n", ""))
    out = tmp_path / "c"
    done = sweep(plain, seeds=1, realtime=1.0, overrides=lagging, out=out, workers=1)
    assert (done.done, done.failed) == (1, 1)
    assert "max_late" in pl.read_parquet(out / "summary.parquet")["error"][0]
    assert resume(out, workers=1).failed == 1
    assert resume(out, retry_failed=True, workers=1).failed == 1


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"realtime": 0.0}, "realtime"),
        ({"realtime": 1.0, "batch": 2}, "batch"),
        ({"realtime": 1.0, "max_late": 1.5}, "max_late"),
        ({"realtime": 1.0, "executor": "dask://127.0.0.1:1"}, "executor"),
    ],
)
def test_realtime_campaign_refuses_settings_that_contradict_it(scenario, tmp_path, settings, key):
    plain = scenario.parent / "lone.toml"
    plain.write_text(line(1) + DISK)
    with refused_input(key):
        sweep(plain, seeds=1, out=tmp_path / "c", **settings)
