"""Tables with which runs and campaigns end, and how campaigns are shown while they run."""

import io
import json
from dataclasses import replace
from io import StringIO

import polars as pl
import pytest
from rich.console import Console

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.deploy import Result, run
from swarmwire.deploy.campaigns.sweep import Sweep
from swarmwire.deploy.campaigns.worker import TaskResult
from swarmwire.deploy.cli.display.report import print_result
from swarmwire.deploy.cli.display.sweep import SweepProgress, print_sweep
from swarmwire.deploy.runs.result import Statistics
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.world.backends.realtime_backend import RealTimeReport
from swarmwire.world.backends.runner_reports import RunnerEvent
from tests.support.clocks import StillClock
from tests.support.deploy.runs import LOSSY


@pytest.fixture(scope="module")
def result() -> Result:
    return run(LOSSY, overrides=["duration_s=1"])


def printed_result(result: Result) -> str:
    out = StringIO()
    print_result(result, METRICS.values(), Console(file=out, width=160, color_system=None))
    return out.getvalue()


def shown(result: Result, **changes: object) -> str:
    """The table, of a run whose one arena is changed so."""
    arena = replace(result.arenas[0], **changes)  # pyright: ignore[reportArgumentType] - of any field
    return printed_result(replace(result, arenas=(arena,)))


def row(text: str, name: str) -> str:
    line = next(line for line in text.splitlines() if line.startswith(f"  {name} "))
    return " ".join(line.split()).removeprefix(f"{name} ")


def test_packets_row_excludes_robots_behind_obstacles_from_range(result):
    radio = result.radio
    assert radio is not None
    fates = dict.fromkeys(FATE_NAMES, 0) | {"received": 60, "lost": 20, "out_of_range": 10}
    account = replace(radio, sent=10, intended=100, in_range=80, pdr=0.6, link_pdr=0.75, fates=fates)
    text = shown(result, radio=account)
    assert row(text, "packets") == "10 sent, 100 intended receivers, 80 in range"
    assert row(text, "pdr") == "60.0% (received / intended)"
    assert row(text, "link_pdr") == "75.0% (received / in range)"
    account = replace(account, fates=fates | {"blocked": 10})
    assert row(shown(result, radio=account), "packets").endswith("80 in range and sight")
    alone = shown(result, radio=replace(account, sent=1, intended=19, in_range=0, pdr=0.0, link_pdr=None))
    assert row(alone, "pdr") == "0.0% (received / intended)"
    assert "link_pdr" not in alone


@pytest.mark.parametrize(
    ("name", "statistics", "expected"),
    [
        ("collisions", Statistics(final=3.0, mean=0.25, min=0.0, max=1.0), "3 in all"),
        ("min_gap", Statistics(final=3.0, mean=0.25, min=0.0, max=1.0), "3 0.25 0 1 m"),
        ("aggregation_time_s", Statistics(12.5, 12.5, 12.5, 12.5), "12.5 s"),
        ("aggregation_time_s", Statistics(None, None, None, None), "never within 1 s"),
    ],
)
def test_metric_row_has_a_total_statistics_or_when_it_was_reached(result, name, statistics, expected):
    assert row(shown(result, metrics={name: statistics}), name) == expected


def test_arenas_that_stopped_are_told_with_when_and_by_what_and_those_that_did_not(result):
    early, late = "order at least 0.9 for 5 s", "target_best below 0.1"
    [arena] = result.arenas
    stopped = {3: (early, 1.5), 5: (late, 0.0)}
    ends = {seed: stopped.get(seed, (None, None)) for seed in range(1, 11)}
    arenas = tuple(replace(arena, seed=seed, stopped_by=by, stop_time_s=at_s) for seed, (by, at_s) in ends.items())
    text = printed_result(replace(result, arenas=arenas, stop=(early, late), ended="duration"))
    assert [" ".join(row.split()) for row in text.splitlines() if "stopped" in row] == [
        f"stopped {early}: seed 3 since 1.5 s",
        f"stopped {late}: seed 5 since 0 s",
        f"not stopped seed 1, seed 2, seed 4, seed 6, seed 7, seed 8 and 2 more in 1 s: {early} or {late}",
    ]
    assert "stopped" not in shown(result)


@pytest.mark.parametrize(("gateways", "longer"), [({"flock": "epuck2"}, ", took 20.64 s longer"), ({}, "")])
def test_real_time_rows_agree_on_requested_and_reached_factor(result, gateways, longer):
    took = {"ticks": 600, "sim_time_s": 60.0, "wall_time_s": 80.64, "realtime": RealTimeReport(1.0, 2, 9.9924)}
    facts = replace(result.facts, gateways=gateways)
    text = printed_result(replace(result, mode="realtime", facts=facts, **took))
    assert row(text, "simulated").startswith("60 s in 80.64 s: 0.74 x real time (")
    assert row(text, "real time") == f"asked for x 1{longer}; 2 of 600 ticks missed, worst lag 9.99 s"


def test_robots_row_counts_processes_of_the_run_or_runners_that_joined_it(result):
    apart = replace(result, runners=2, mode="lockstep")
    assert row(shown(apart), "robots") == "20, 2 processes, lockstep"
    joined = tuple(RunnerEvent("joined", name, ("flock-0",), NO_TICK) for name in ("r1", "r2"))
    assert row(shown(replace(apart, runner_events=joined)), "robots") == "20, 2 runners, lockstep"


class Campaign:
    name, points, seeds, runs = "a [bold] flock", [{}, {}], list(range(50)), 100


def task(runs, failed=0):
    return TaskResult(tuple({"run": run, "ended": "failed" if run < failed else "duration"} for run in range(runs)))


def printed(tasks, terminal, done=0):
    clock, text = StillClock(), io.StringIO()
    watcher = SweepProgress(Console(file=text, force_terminal=terminal, width=110), clock)
    watcher.begin(Campaign(), done, 0)
    for one in tasks:
        clock.time_ns += NS_PER_S
        watcher.see(one)
    watcher.end()
    return text.getvalue()


def test_plain_lines_tell_how_far_how_fast_and_how_long():
    lines = printed([task(25), task(25, failed=2), task(50)], terminal=False).splitlines()
    assert lines == [
        "a [bold] flock: 2 points x 50 seeds = 100 runs",
        "25/100 runs, 25.0 runs/s, 3 s left",
        "50/100 runs, 25.0 runs/s, 2 failed, 2 s left",
        "100/100 runs, 33.3 runs/s, 2 failed, 0 s left",
    ]


def test_many_pieces_are_a_few_lines_and_what_was_there_is_no_speed():
    lines = printed([task(1)] * 60, terminal=False, done=40).splitlines()
    assert lines[0].endswith("; 40 of them are there")
    assert len(lines) == 7
    assert lines[-1] == "100/100 runs, 1.0 runs/s, 0 s left"


def test_progress_bar_shows_name_runs_and_failures():
    text = printed([task(25, failed=1)], terminal=True)
    assert "a [bold] flock" in text
    assert "25/100" in text
    assert "1 failed" in text


TIME = {"unit": "s", "kind": "time", "help": "", "listed": False, "hold_s": 0.0}
ABOUT = {
    "format": 1, "name": "times", "scenario": "times", "command": "", "began_utc": "", "versions": {}, "cpu": "",
    "modules": {}, "files": [], "design": "grid", "seeds": [1, 2, 3, 4], "vary": {}, "points": [{}], "overrides": [],
    "duration_s": 50.0, "robots": 1, "series": False, "record_seeds": [], "batch": None,
    "realtime": None, "max_late": 0.01, "point_overrides": [[]],
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
def test_median_of_times_is_that_of_kaplan_and_meier(tmp_path, find, ends, median):
    assert f" {median} " in table(tmp_path, [1.0] * 4, find, ends)
