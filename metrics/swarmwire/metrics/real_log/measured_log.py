"""Logs of real robots, measured by the metrics of a run."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.metric import Metric, Need
from swarmwire.metrics.network.radio_tally import RadioTally
from swarmwire.metrics.real_log.real_logs import RealLogs
from swarmwire.metrics.real_log.truths import real_run

WORLD = "world"  # a robot's kind of radio: that of a run
LACKS: dict[Need, str] = {
    "contacts": "contacts are not in the log",
    "graph": "a real network knows no range, so there is no radio graph in the log",
    "airtime": "times on air are not in the log",
    "latency": "the robots' radio was that of a run, whose latencies robots know to the agent alone: see latency_agent",
    "poses": "poses are not in the log: no tracker",
}


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
    has_air = any(robot.about.radio_kind == WORLD for robot in logs.robots)
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
