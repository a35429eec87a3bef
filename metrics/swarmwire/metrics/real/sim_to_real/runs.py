"""The compared data: logs of real robots and emulated runs, with the same metrics tick by tick."""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import Metric, Need
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.real.real_log.real_logs import RealLogs
from swarmwire.metrics.real.real_log.truths import real_run
from swarmwire.metrics.records.campaign.campaign_json import SERIES
from swarmwire.metrics.records.campaign.folder import PointSelection
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.table_file import corruption_errors, refuse_corrupt

Radio = Mapping[str, Any]  # a summary's radio: sent, intended, fates, latency_air_s, latency_agent_s
COUNTS = ("sent", "received", "in_range")  # the radio's counts per tick in run folders
WORLD = "world"  # kind of a robot's radio that is the radio of a run
LACKS: dict[Need, str] = {
    "contacts": "contacts are not in the log",
    "graph": "a real network has no nominal range, so there is no radio graph in the log",
    "airtime": "times on air are not in the log",
    "latency": "the robots used the radio of a run, where they know only latencies to the agent: see latency_agent",
    "poses": "poses are not in the log: no tracker",
    "commands": "commands are not in the log",
    "packets": "packets are not in the log",
}


@dataclass(frozen=True)
class EmulatedRun:
    """An arena with its seed."""

    seed: int
    series: Mapping[str, FloatArray]  # `Metrics.values` by metric, (ticks,); NaN: undefined
    radio: Radio | None  # None: no radio, or the run was killed
    duration_s: float
    counts: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])  # COUNTS, (ticks,)


@dataclass(frozen=True)
class EmulatedRuns:
    """Runs that differ only in their seeds."""

    name: str
    runs: tuple[EmulatedRun, ...]
    rate_hz: int
    robots: int


def runs_of_folder(path: Path, metrics: tuple[str, ...]) -> EmulatedRuns:
    """Return the arenas of a run folder; BadInput without a table of ticks."""
    folder = RunFolder(path)
    static, summary = folder.static, folder.summary
    runs: list[EmulatedRun] = []
    for arena, seed in enumerate(static.seeds):
        table = folder.metrics(arena)
        radio = None if summary is None else _arena(summary["radio"], arena)
        series = {name: _floats(table[name]) for name in metrics if name in table.columns}
        counts = {name: _floats(table[name]) for name in COUNTS if name in table.columns}
        runs.append(EmulatedRun(seed, series, radio, len(table) / static.rate_hz, counts))
    return EmulatedRuns(path.name, tuple(runs), static.rate_hz, static.robots)


def runs_of_campaign(selection: PointSelection, metrics: tuple[str, ...], rate_hz: int, robots: int) -> EmulatedRuns:
    """Return the runs of a design point that did not fail.

    BadInput for several points, a campaign without series, or if all runs failed.
    """
    if len(selection.points) != 1:
        example = f"{selection.campaign.path}{''.join(f'@{path}=VALUE' for path in selection.campaign.parameters)}"
        raise BadInput(selection.text, "", f"expected one design point of {len(selection.points)}: {example}")
    files = sorted(selection.campaign.path.joinpath(SERIES).glob("*.parquet"))
    if not files:
        raise BadInput(selection.text, SERIES, "expected the metrics of each tick, which --no-series leaves out")
    rows = selection.campaign.runs.filter((pl.col("point") == selection.points[0]) & (pl.col("ended") != "failed"))
    numbers = rows["run"].to_list()
    try:
        table = pl.concat([pl.scan_parquet(file) for file in files], how="diagonal")
        table = table.filter(pl.col("run").is_in(numbers)).collect()
    except (OSError, *corruption_errors()) as error:
        refuse_corrupt(files)
        raise BadInput(selection.text, SERIES, f"expected whole Parquet files: {str(error).splitlines()[0]}") from None
    by_run = {int(key[0]): ticks for key, ticks in table.partition_by("run", as_dict=True).items()}
    runs = tuple(
        EmulatedRun(
            int(row["seed"]),
            {name: _floats(by_run[row["run"]][name]) for name in metrics if name in table.columns},
            _radio_of(row),
            len(by_run[row["run"]]) / rate_hz,
        )
        for row in rows.iter_rows(named=True)
        if row["run"] in by_run
    )
    if not runs:
        raise BadInput(selection.text, "", "expected a run that ended well, with its series")
    return EmulatedRuns(selection.campaign.about.name, runs, rate_hz, robots)


def _radio_of(row: dict[str, Any]) -> Radio | None:
    """Return the columns of a campaign's row in the form of a summary."""
    if row.get("radio.sent") is None:
        return None
    latencies = {
        name: {p: row.get(f"radio.{name}.{p}") for p in ("p50", "p90", "p99")}
        for name in ("latency_air_s", "latency_agent_s")
    }
    fates = {key.removeprefix("radio.fates."): n for key, n in row.items() if key.startswith("radio.fates.")}
    return {"sent": row["radio.sent"], "intended": row["radio.intended"], "fates": fates, **latencies}


def _arena(radio: Any, arena: int) -> Radio:
    return cast("list[Radio]", radio)[arena] if isinstance(radio, list) else radio


def _floats(column: pl.Series) -> FloatArray:
    return column.cast(pl.Float64).fill_null(float("nan")).to_numpy().astype(np.float64)


@dataclass(frozen=True)
class MeasuredLog:
    """The metrics of a log, tick by tick."""

    static: Static
    duration_s: float
    series: dict[str, FloatArray]  # `Metrics.values` by metric, (ticks,); NaN: undefined
    radio: dict[str, Any]  # a summary's radio; empty without packets
    has_air: bool  # packets were sent over the radio of a run, so their latencies are those to the agent
    left_out: dict[str, str]  # missing data by metric
    notes: tuple[str, ...]


def measured_log(
    logs: RealLogs, metrics: Sequence[Metric], scenery: Static | None = None, max_duration_s: float = math.inf
) -> MeasuredLog:
    """Measure the metrics for which the log has the data; BadInput if the robots did not run at the same time.

    `scenery` describes the arena, for metrics that need it. Ticks and packets after `max_duration_s` are left out.
    """
    run = real_run(logs, scenery)
    ticks = math.floor(min(max_duration_s * run.base.rate_hz, run.base.ticks - 1) + 1e-6) + 1
    has_air = any(robot.about.radio.kind == WORLD for robot in logs.robots)
    has_packets = any(len(robot.sent.time_s) + len(robot.received.time_s) for robot in logs.robots)
    available: dict[Need, bool] = {
        "poses": run.base.has_poses,
        "commands": not any(np.isnan(robot.steps.command).any() for robot in logs.robots),
        "packets": has_packets,
        "latency": not has_air,
    }
    missing = {metric.name: missing_data(metric, {need for need in available if available[need]}) for metric in metrics}
    measures = Metrics([metric for metric in metrics if missing[metric.name] is None])
    tally = RadioTally()
    for observer in (measures, tally):
        observer.begin(run.static)
    values: FloatArray = np.empty((ticks, len(measures.metrics)))
    for truth in run.truths(ticks):
        measures.see(truth)
        tally.see(truth)
        values[truth.tick] = measures.values[:, 0]
    return MeasuredLog(
        static=run.static,
        duration_s=(ticks - 1) / run.base.rate_hz,
        series={metric.name: values[:, index] for index, metric in enumerate(measures.metrics)},
        radio=tally.end(run.under_way(ticks))["radio"][0] if has_packets else {},
        has_air=has_air,
        left_out={name: data for name, data in missing.items() if data is not None},
        notes=run.notes,
    )


def missing_data(metric: Metric, available: Set[Need]) -> str | None:
    """Return the data that a log lacks for a metric; None: complete."""
    return next((LACKS[need] for need in metric.needs if need not in available), None)
