from dataclasses import replace

import numpy as np
import pytest

from swarmwire.deploy import RunFolder, sweep
from swarmwire.deploy.campaigns import sweep as sweeping
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.metrics.real.real_log.real_logs import read_real_logs
from swarmwire.metrics.real.sim_to_real.comparison import (
    MetricRow,
    RadioRow,
    RadioValue,
    SimToReal,
    Spread,
    compare_sim_to_real,
)
from swarmwire.metrics.real.sim_to_real.report import (
    COLUMNS,
    RADIO_COLUMNS,
    left_out,
    meanings,
    metric_cells,
    radio_cells,
    verdict,
)
from swarmwire.metrics.real.sim_to_real.runs import (
    EmulatedRun,
    EmulatedRuns,
    measured_log,
    runs_of_campaign,
    runs_of_folder,
)
from swarmwire.metrics.records.campaign.folder import select
from tests.support.deploy.campaign import InThisProcess
from tests.support.deploy.runs import LOSSY
from tests.support.metrics.real_logs import BEGAN_S, SMALL, Watched, as_logs, measured_run, watched
from tests.support.refusals import refused_input

NAMES = (
    "order",
    "order_velocity",
    "speed",
    "cohesion",
    "min_gap",
    "throughput",
    "link_pdr",
    "collisions",
    "coverage_time_s",
)
MEASURES = [METRICS[name]() for name in NAMES]
SEEDS = range(1, 8)
PHASES_S = (0.03, 0.0, 0.09, 0.05, 0.01, 0.07)
NOTHING = np.empty(0)
METRIC_NAMES = ("order", "min_gap")


def emulated_run(watched_run: Watched, seed: int) -> EmulatedRun:
    series, radio = measured_run(watched_run, MEASURES)
    return EmulatedRun(seed, series, radio, len(watched_run.truths) / watched_run.static.rate_hz)


@pytest.fixture(scope="module")
def runs():
    """Runs with seven seeds."""
    watched_runs = [watched(seed=seed) for seed in SEEDS]
    many = tuple(emulated_run(watched_run, seed) for watched_run, seed in zip(watched_runs, SEEDS, strict=True))
    return watched_runs, EmulatedRuns("small", many, 10, 6)


def compared(emulated: EmulatedRuns, watched_run: Watched, folder) -> SimToReal:
    logs = read_real_logs(as_logs(watched_run, folder, phase_s=PHASES_S))
    return compare_sim_to_real(emulated, measured_log(logs, MEASURES, watched_run.static), MEASURES)


def test_run_is_near_the_log_of_itself(runs, tmp_path):
    watched_runs, many = runs
    alone = replace(many, runs=many.runs[:1])
    comparison = compared(alone, watched_runs[0], tmp_path)
    rows = {row.metric.name: row for row in comparison.rows}
    for name, within in (("order", 0.03), ("cohesion", 0.01), ("min_gap", 0.01), ("speed", 0.005)):
        assert rows[name].distance < within, name
        assert rows[name].emulated.median == pytest.approx(rows[name].log, abs=within), name
        assert rows[name].within is True, name
    pdr = next(row for row in comparison.radio if row.value.name == "total pdr")
    assert pdr.value.log == pytest.approx(pdr.emulated.median, abs=0.01)
    assert pdr.within is None
    assert "campaign" in verdict(comparison)


def test_another_seed_lies_within_the_spread(runs, tmp_path):
    comparison = compared(runs[1], watched(seed=11), tmp_path)
    within = [row.within for row in comparison.judged]
    assert len(within) == 6
    assert sum(within) >= 5  # of six each is outside once in eight times
    radio = [row.within for row in comparison.judged_radio]
    assert len(radio) == len(comparison.radio) == 5
    assert verdict(comparison).startswith(f"{sum(within) + sum(radio)} of 11 ")
    assert f"{sum(within)} of 6 metrics, {sum(radio)} of 5 " in verdict(comparison)


def test_swarm_at_half_the_speed_is_outside_the_spread(runs, tmp_path):
    comparison = compared(runs[1], watched("robots.flock.params.speed_mps=0.05", seed=11), tmp_path)
    assert comparison.rows[0].metric.name == "speed"
    assert comparison.rows[0].within is False
    assert comparison.rows[0].distance > 2.0 * comparison.rows[0].reach
    assert ": speed" in verdict(comparison)


@pytest.mark.parametrize(("sent", "within"), [(9.95, True), (10.1, True), (9.5, False), (10.3, False)])
def test_counts_have_a_tolerance_of_their_own(runs, tmp_path, sent, within):
    """In each of the runs of 20 s a robot sends 9.95 packets a second."""
    watched_runs, many = runs
    logs = measured_log(read_real_logs(as_logs(watched_runs[0], tmp_path, phase_s=PHASES_S)), MEASURES)
    logs.radio["sent"] = round(sent * 6 * logs.duration_s)
    comparison = compare_sim_to_real(many, logs, MEASURES)
    (row,) = (row for row in comparison.radio if row.value.name == "packets sent")
    assert (row.emulated.low, row.emulated.high) == (9.95, 9.95)
    assert row.within is within


@pytest.mark.parametrize(("events", "within"), [(100, True), (101, True), (103, True), (110, False)])
def test_metric_of_events_tolerates_one_event_more_at_either_end(runs, tmp_path, events, within):
    """In each of the runs an event happens in every third tick, 100 in all."""
    watched_runs, many = runs
    metric = METRICS["collisions"]()
    ticks = len(watched_runs[0].truths)
    series = np.floor(np.arange(1, ticks + 1) * 100 / ticks)
    emulated = replace(many, runs=tuple(replace(run, series={metric.name: series}) for run in many.runs))
    logs = measured_log(read_real_logs(as_logs(watched_runs[0], tmp_path, phase_s=PHASES_S)), [])
    logs.series[metric.name] = np.floor(np.arange(1, ticks + 1) * events / ticks)
    (row,) = compare_sim_to_real(emulated, logs, [metric]).rows
    assert row.within is within


def test_metrics_that_are_not_compared_have_their_reason(runs, tmp_path):
    comparison = compared(runs[1], watched(seed=11), tmp_path)
    assert "contacts" in comparison.not_in_log["collisions"]
    assert "range" in comparison.not_in_log["link_pdr"]  # some were out of it
    assert comparison.undefined == ()
    assert comparison.never == ("coverage_time_s",)
    lines = left_out(comparison)
    assert any("collisions: " in line for line in lines)
    assert any(line.endswith(": coverage_time_s") for line in lines)
    assert any("p-values" in line for line in meanings(comparison))


def test_metric_that_neither_side_has_is_skipped_and_that_one_has_is_named(runs, tmp_path):
    _, many = runs
    nothing = np.full(200, np.nan)
    neither = tuple(replace(run, series={"target_best": nothing, "order": nothing}) for run in many.runs)
    log = measured_log(read_real_logs(as_logs(watched(seed=11), tmp_path)), MEASURES)
    log = replace(log, series={"target_best": nothing, "order": log.series["order"]})
    comparison = compare_sim_to_real(replace(many, runs=neither), log, [METRICS["target_best"](), METRICS["order"]()])
    assert (comparison.undefined, comparison.never, comparison.rows) == (("order",), (), ())


def test_metrics_that_the_run_did_not_keep_are_told(runs, tmp_path):
    _, many = runs
    poor = replace(many, runs=tuple(replace(run, series={"order": run.series["order"]}) for run in many.runs))
    comparison = compared(poor, watched(seed=11), tmp_path)
    assert "speed" in comparison.not_in_run
    assert [row.metric.name for row in comparison.rows] == ["order"]


def test_comparison_covers_only_the_time_in_common(runs, tmp_path):
    watched_run = watched(seed=11)
    short = Watched()
    short.static, short.truths = watched_run.static, watched_run.truths[:101]
    comparison = compared(runs[1], short, tmp_path)
    assert comparison.duration_s == pytest.approx(9.9, abs=0.11)
    assert all(len(values) <= 101 for row in comparison.rows for values in row.runs)
    assert comparison.radio == ()  # runs have their totals of 20 s alone
    assert "20 s" in comparison.not_compared["total pdr"]
    assert any("packets sent, total pdr, " in line for line in left_out(comparison))


def test_radio_counts_of_a_longer_run_are_cut_to_the_common_time(tmp_path):
    """Afterwards nothing is sent any more, which the time that is compared does not know."""
    watched_run = watched("radio.range_m=20", "duration_s=10", out=tmp_path / "run")
    recorded = runs_of_folder(tmp_path / "run", NAMES)
    run = recorded.runs[0]
    quiet = {name: np.append(count, np.zeros(100)) for name, count in run.counts.items()}
    longer = replace(run, duration_s=20.0, counts=quiet)
    comparison = compared(replace(recorded, runs=(longer,)), watched_run, tmp_path / "logs")
    rows = {row.value.name: row for row in comparison.radio}
    assert list(rows) == ["packets sent", "total pdr"]
    assert rows["packets sent"].value.log == pytest.approx(rows["packets sent"].emulated.median, rel=0.04)
    assert rows["total pdr"].value.log == pytest.approx(rows["total pdr"].emulated.median, abs=0.02)
    assert comparison.not_compared.keys() == {"latency p50", "latency p90", "latency p99"}


def test_radio_counts_of_a_longer_log_are_cut_to_the_common_time(runs, tmp_path):
    """It is silent from the tenth second on, after which the run that it is held against ends."""
    watched_run = runs[0][0]
    folder = as_logs(watched_run, tmp_path)
    for robot in folder.iterdir():
        for name in ("sent.csv", "received.csv"):
            head, *rows = (robot / name).read_text().splitlines(keepends=True)
            early = [row for row in rows if float(row.split(",")[0]) < BEGAN_S + 10.0]
            (robot / name).write_text("".join([head, *early]))
    logs = read_real_logs(folder)
    half = Watched()
    half.static, half.truths = watched_run.static, watched_run.truths[:100]
    short = replace(runs[1], runs=(emulated_run(half, 1),))
    comparison = compare_sim_to_real(short, measured_log(logs, MEASURES, watched_run.static, 10.0), MEASURES)
    rows = {row.value.name: row for row in comparison.radio}
    assert rows["packets sent"].value.log == pytest.approx(rows["packets sent"].emulated.median, rel=0.03)
    assert rows["total pdr"].value.log == pytest.approx(rows["total pdr"].emulated.median, abs=0.02)
    complete = compare_sim_to_real(short, measured_log(logs, MEASURES, watched_run.static), MEASURES)
    assert complete.radio == ()
    assert all(length in complete.not_compared["total pdr"] for length in ("19.9 s", "10 s"))


def test_latencies_over_a_runs_radio_are_held_against_those_to_the_agent(runs, tmp_path):
    watched_runs, many = runs
    folder = as_logs(watched_runs[0], tmp_path, about={"radio": {"kind": "world"}})
    for path in folder.glob("*/received.csv"):  # such robots do not know when a packet was sent
        head, *rows = (line.split(",") for line in path.read_text().splitlines())
        at = head.index("latency_s")
        path.write_text(
            "\n".join(",".join(row) for row in [head, *([*row[:at], "", *row[at + 1 :]] for row in rows)]) + "\n"
        )
    logs = read_real_logs(folder)
    measures = [*MEASURES, METRICS["latency_air"](), METRICS["latency_agent"]()]
    log = measured_log(logs, measures, watched_runs[0].static)
    comparison = compare_sim_to_real(many, log, measures)
    assert [row.value.name for row in comparison.radio][2:] == [f"latency to agent {p}" for p in ("p50", "p90", "p99")]
    assert comparison.radio[2].value.runs[0] == many.runs[0].radio["latency_agent_s"]["p50"]
    assert comparison.radio[2].value.log == pytest.approx(comparison.radio[2].value.runs[0], abs=0.011)
    assert "latency_agent" in comparison.not_in_log["latency_air"]
    assert "latency_agent" in log.series


def test_verdict_on_two_runs_has_no_spread(runs, tmp_path):
    two = replace(runs[1], runs=runs[1].runs[:2])
    comparison = compared(two, watched(seed=11), tmp_path)
    assert not comparison.judged
    assert verdict(comparison).startswith("2 runs ")


def test_row_of_a_metric_or_the_radio_has_a_text_for_each_column_and_of_a_single_run_no_spread():
    row = MetricRow(
        METRICS["min_gap"](), Spread(0.1, 0.2, 0.3), 0.25, (NOTHING,), NOTHING, ks=0.125, distance=0.05, reach=0.04
    )
    cells = dict(zip(COLUMNS, metric_cells(row), strict=True))
    assert cells["metric"].startswith("min_gap")
    assert cells["emulated"] == "0.2 (0.1 to 0.3)"
    assert (cells["log"], cells["distance"], cells["spread"], cells["KS"]) == ("0.25", "0.05", "0.04", "0.125")
    assert cells["within"] == "no"

    single = MetricRow(METRICS["order"](), Spread(0.5, 0.5, 0.5), 0.5, (NOTHING,), NOTHING, ks=0.0, distance=0.0)
    cells = dict(zip(COLUMNS, metric_cells(single), strict=True))
    assert cells["emulated"] == "0.5"
    assert cells["within"] not in ("yes", "no")
    value = RadioValue("latency, median", "s", "how long", (0.01, 0.02, 0.03), log=0.02, grain=0.0)
    cells = dict(zip(RADIO_COLUMNS, radio_cells(RadioRow(value, Spread(0.01, 0.02, 0.03), 3)), strict=True))
    assert cells["radio"] == "latency, median [s]"
    assert (cells["log"], cells["within"]) == ("0.02", "yes")


def test_runs_of_a_run_folder_have_its_series(tmp_path):
    watched("duration_s=3", seed=2, out=tmp_path / "run")
    emulated = runs_of_folder(tmp_path / "run", METRIC_NAMES)
    folder = RunFolder(tmp_path / "run")
    assert (emulated.robots, emulated.rate_hz, [run.seed for run in emulated.runs]) == (6, 10, [2])
    assert emulated.runs[0].series.keys() == set(METRIC_NAMES)
    assert np.array_equal(emulated.runs[0].series["order"], folder.metrics()["order"].to_numpy(), equal_nan=True)
    assert emulated.runs[0].duration_s == pytest.approx(3.0)


def test_runs_of_a_campaign_point_have_its_series(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
    short = [*SMALL, "duration_s=3"]
    sweep(LOSSY, seeds=[1, 2], vary={"radio.loss": [0.3, 0.6]}, overrides=short, out=tmp_path / "c")
    emulated = runs_of_campaign(select(f"{tmp_path / 'c'}@radio.loss=0.6"), METRIC_NAMES, 10, 6)
    assert [run.seed for run in emulated.runs] == [1, 2]
    assert all(len(run.series["order"]) == 30 for run in emulated.runs)
    first, *_ = (tmp_path / "c" / "series").glob("*.parquet")
    first.write_bytes(first.read_bytes()[:-1])
    with refused_input(first):
        runs_of_campaign(select(f"{tmp_path / 'c'}@radio.loss=0.6"), METRIC_NAMES, 10, 6)
