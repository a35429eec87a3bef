"""The table that a campaign prints once it is over."""

import json

import polars as pl
import pytest
from rich.console import Console

from swarmwire.deploy.campaign.sweeping import Sweep
from swarmwire.deploy.terminal.sweep_report import print_sweep

ABOUT = {
    "format": 1, "name": "times", "scenario": "times", "command": "", "began_utc": "", "versions": {}, "cpu": "",
    "modules": {}, "files": [], "design": "grid", "seeds": [1, 2, 3, 4], "vary": {}, "points": [{}], "overrides": [],
    "duration_s": 50.0, "outcomes": [{"column": "stop_time_s", "unit": "s", "kind": "time", "help": ""},
                                     {"column": "find_time_s", "unit": "s", "kind": "time", "help": ""}],
}  # fmt: skip


def table(folder, stop, find, ends):
    (folder / "campaign.json").write_text(json.dumps(ABOUT))
    rows = {"run": [0, 1, 2, 3], "point": [0] * 4, "seed": [1, 2, 3, 4], "ended": ["stopped"] * 4}
    times = {"sim_time_s": ends, "stop_time_s": stop, "find_time_s": find}
    pl.DataFrame(rows | times).write_parquet(folder / "summary.parquet")
    console = Console(width=100)
    with console.capture() as printed:
        print_sweep(Sweep(folder, 4, 4, 0), console, "swarmwire")
    return next(line for line in printed.get().splitlines() if line.startswith("│"))


@pytest.mark.parametrize(
    ("find", "ends", "median"),
    [
        ([10.0, None, 30.0, None], [50.0, 20.0, 50.0, 20.0], "30"),  # at risk by 30 s: one run, to which it happens
        ([10.0, 20.0, 30.0, 40.0], [50.0] * 4, "20"),  # the first by which it has happened to half of them
        ([10.0, None, None, None], [50.0, 20.0, 5.0, 20.0], "> 20"),  # not 50: nobody was watched so long in vain
    ],
)
def test_a_median_of_times_is_kaplan_and_meiers(tmp_path, find, ends, median):
    assert f" {median} " in table(tmp_path, [1.0] * 4, find, ends)
