"""How campaigns are shown while they run, and the table that they print once they are over."""

import io
import json

import polars as pl
import pytest
from rich.console import Console

from swarmwire.comms.clock import NS_PER_S
from swarmwire.deploy.campaign.sweep import Sweep
from swarmwire.deploy.campaign.worker import TaskResult
from swarmwire.deploy.terminal.sweep import SweepBar, SweepLines, print_sweep, sweep_progress
from tests.support.clocks import StillClock


class Campaign:
    name, points, seeds, runs = "a [bold] flock", [{}, {}], list(range(50)), 100


def task(runs, failed=0):
    return TaskResult(tuple({"run": run, "ended": "failed" if run < failed else "duration"} for run in range(runs)))


def printed(watcher_of, tasks, terminal, done=0):
    clock, text = StillClock(), io.StringIO()
    watcher = watcher_of(clock, Console(file=text, force_terminal=terminal, width=110))
    watcher.begin(Campaign(), done, 0)
    for one in tasks:
        clock.time_ns += NS_PER_S
        watcher.see(one)
    watcher.end()
    return text.getvalue()


def test_plain_lines_tell_how_far_how_fast_and_how_long():
    lines = printed(SweepLines, [task(25), task(25, failed=2), task(50)], terminal=False).splitlines()
    assert lines == [
        "a [bold] flock: 2 points x 50 seeds = 100 runs",
        "25/100 runs, 25.0 runs/s, 3 s left",
        "50/100 runs, 25.0 runs/s, 2 failed, 2 s left",
        "100/100 runs, 33.3 runs/s, 2 failed, 0 s left",
    ]


def test_many_pieces_are_a_few_lines_and_what_was_there_is_no_speed():
    lines = printed(SweepLines, [task(1)] * 60, terminal=False, done=40).splitlines()
    assert lines[0].endswith("; 40 of them are there")
    assert len(lines) == 7
    assert lines[-1] == "100/100 runs, 1.0 runs/s, 0 s left"


def test_a_bar_shows_the_same():
    text = printed(SweepBar, [task(25, failed=1)], terminal=True)
    assert "a [bold] flock" in text
    assert "25/100" in text
    assert "1 failed" in text


def test_a_terminal_gets_a_bar_and_all_else_lines():
    assert isinstance(sweep_progress(Console(file=io.StringIO(), force_terminal=True)), SweepBar)
    assert isinstance(sweep_progress(Console(file=io.StringIO())), SweepLines)


TIME = {"unit": "s", "kind": "time", "help": "", "listed": False, "hold_s": 0.0}
ABOUT = {
    "format": 1, "name": "times", "scenario": "times", "command": "", "began_utc": "", "versions": {}, "cpu": "",
    "modules": {}, "files": [], "design": "grid", "seeds": [1, 2, 3, 4], "vary": {}, "points": [{}], "overrides": [],
    "duration_s": 50.0, "robots": 1, "series": False, "record_seeds": [], "batch": None, "point_overrides": [[]],
    "responses": [{"column": "stop_time_s", **TIME}, {"column": "find_time_s", **TIME}],
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
