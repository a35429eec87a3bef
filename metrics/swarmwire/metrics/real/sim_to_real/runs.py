"""What is compared: logs of real robots and emulated runs, each by the same metrics tick by tick."""

import math
from collections.abc import Mapping, Sequence
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

Radio = Mapping[str, Any]  # as in a summary: sent, intended, fates, latency_air_s, latency_agent_s
COUNTS = ("sent", "received", "in_range")  # the radio's, since the tick before, which run folders keep
WORLD = "world"  # a robot's kind of radio: that of a run
LACKS: dict[Need, str] = {
    "contacts": "contacts are not in the log",
    "graph": "a real network knows no range, so there is no radio graph in the log",
    "airtime": "times on air are not in the log",
    "latency": "the robots' radio was that of a run, whose latencies robots know to the agent alone: see latency_agent",
    "poses": "poses are not in the log: no tracker",
}


@dataclass(frozen=True)
class EmulatedRun:
    """One arena with one seed."""

    seed: int
    series: Mapping[str, FloatArray]  # by metric: (ticks,) as `Metrics.values`; NaN: undefined
    radio: Radio | None  # None: no radio, or the run was killed
    duration_s: float
    counts: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])  # of COUNTS, (ticks,) each


@dataclass(frozen=True)
class EmulatedRuns:
    """Runs that differ in their seeds alone."""

    name: str
    runs: tuple[EmulatedRun, ...]
    rate_hz: int
    robots: int


def runs_of_folder(path: Path, metrics: tuple[str, ...]) -> EmulatedRuns:
    """The arenas of a run folder; BadInput where it has no table of ticks."""
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


def runs_of_campaign(of: PointSelection, metrics: tuple[str, ...], rate_hz: int, robots: int) -> EmulatedRuns:
    """The runs of one design point that ended well.

    BadInput where several points are meant, the campaign kept no series, or no run ended well.
    """
    if len(of.points) != 1:
        paths = "".join(f"@{path}=VALUE" for path in of.campaign.parameters)
        raise BadInput(of.text, "", f"expected one design point of {len(of.points)}: {of.campaign.path}{paths}")
    files = sorted(of.campaign.path.joinpath(SERIES).glob("*.parquet"))
    if not files:
        raise BadInput(of.text, SERIES, "expected the metrics of each tick, which --no-series leaves out")
    rows = of.campaign.runs.filter((pl.col("point") == of.points[0]) & (pl.col("ended") != "failed"))
    wanted = rows["run"].to_list()
    try:
        table = pl.concat([pl.scan_parquet(file) for file in files], how="diagonal")
        table = table.filter(pl.col("run").is_in(wanted)).collect()
    except (OSError, *corruption_errors()) as error:
        refuse_corrupt(files)
        raise BadInput(of.text, SERIES, f"expected whole Parquet files: {str(error).splitlines()[0]}") from None
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
        raise BadInput(of.text, "", "expected a run that ended well, with its series")
    return EmulatedRuns(of.campaign.about.name, runs, rate_hz, robots)


def _radio_of(row: dict[str, Any]) -> Radio | None:
    """The columns of a campaign's row as a summary has them."""
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
    series: dict[str, FloatArray]  # by metric: (ticks,) as `Metrics.values`; NaN: undefined
    radio: dict[str, Any]  # as in a summary
    has_air: bool  # packets went over a run's radio, ticks apart: their latencies are those to the agent
    left_out: dict[str, str]  # by metric: what the log lacks for it
    notes: tuple[str, ...]


def measured_log(
    logs: RealLogs, metrics: Sequence[Metric], place: Static | None = None, longest_s: float = math.inf
) -> MeasuredLog:
    """Measure the metrics for which the log has the data; BadInput where the robots did not run at the same time.

    `place` describes the arena, for metrics that need it. Ticks and packets after `longest_s` are left out.
    """
    run = real_run(logs, place)
    ticks = math.floor(min(longest_s * run.base.rate_hz, run.base.ticks - 1) + 1e-6) + 1
    has_air = any(robot.about.radio.kind == WORLD for robot in logs.robots)
    lacks = {metric.name: why_not(metric, has_poses=run.base.has_poses, has_air=has_air) for metric in metrics}
    kept = Metrics([metric for metric in metrics if lacks[metric.name] is None])
    tally = RadioTally()
    for observer in (kept, tally):
        observer.begin(run.static)
    values: FloatArray = np.empty((ticks, len(kept.metrics)))
    for truth in run.truths(ticks):
        kept.see(truth)
        tally.see(truth)
        values[truth.tick] = kept.values[:, 0]
    return MeasuredLog(
        static=run.static,
        duration_s=(ticks - 1) / run.base.rate_hz,
        series={metric.name: values[:, place] for place, metric in enumerate(kept.metrics)},
        radio=tally.end(run.under_way(ticks))["radio"][0],
        has_air=has_air,
        left_out={name: lack for name, lack in lacks.items() if lack is not None},
        notes=run.notes,
    )


def why_not(metric: Metric, *, has_poses: bool, has_air: bool = False) -> str | None:
    """The data that a log lacks for this metric; None: none. `has_air`: packets went over a run's radio."""
    there: set[Need] = {*(("poses",) if has_poses else ()), *(() if has_air else ("latency",))}
    return next((LACKS[need] for need in metric.needs if need not in there), None)
