"""The metrics of emulated runs and of real robots, and their distances.

A log is within the spread over seeds if its distance to all runs does not exceed the greatest distance of a run to all
other runs. A further run would exceed the distances of n runs once in n + 1 times.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.measures.network.delivery import LinkPacketDeliveryRatio
from swarmwire.metrics.measures.network.latency import RELATIVE_ERROR
from swarmwire.metrics.real.sim_to_real.runs import EmulatedRun, EmulatedRuns, MeasuredLog
from swarmwire.metrics.statistics.bootstrap import mean_difference_interval
from swarmwire.metrics.statistics.difference import kolmogorov_smirnov, wasserstein_1
from swarmwire.metrics.statistics.sample import UNKNOWN, Interval
from swarmwire.metrics.text import number_text

Radio = Mapping[str, Any]
MIN_RUNS = 3  # least number of runs with a spread
COUNT_TOLERANCE = 0.01  # relative tolerance of counts per second: loops of robots skip steps, and clocks differ
MIN_COVERAGE = 0.95  # share of a run that must be compared for its totals to count
SPREAD = (0.05, 0.5, 0.95)
ONLY_IN_RANGE = "receivers within range are not in the log, and not all were; pdr counts all on both sides"


@dataclass(frozen=True)
class Spread:
    """Quantiles of a value over runs; NaN without runs."""

    low: float  # 5 %
    median: float
    high: float  # 95 %


@dataclass(frozen=True)
class MetricRow:
    """A metric: its mean over ticks (counts: per second), and its distribution."""

    metric: Metric
    emulated: Spread
    log: float
    runs: tuple[FloatArray, ...]  # values of each run
    values: FloatArray  # values of the log
    ks: float = math.nan  # Kolmogorov-Smirnov distance between log and all runs; NaN: a time, without a distribution
    distance: float = math.nan  # Wasserstein-1 distance, in the metric's unit
    reach: float = math.nan  # greatest distance of a run to the others; NaN: fewer than MIN_RUNS
    difference: Interval = UNKNOWN  # interval of the means' difference, log less a single run, by blocks of ticks
    grain: float = 0.0  # tolerance of counting, in the metric's unit

    @property
    def within(self) -> bool | None:
        """True if the log is within the spread, or the means differ by no more than chance; None: undecided."""
        if not math.isnan(self.reach):
            return self.distance <= self.reach + self.grain
        low, high = self.difference.low - self.grain, self.difference.high + self.grain
        return None if math.isnan(low) else low <= 0.0 <= high

    @property
    def badness(self) -> float:
        """Sort key: the distance relative to the spread."""
        if math.isnan(self.ks):
            return -1.0
        return self.distance / self.reach if self.reach > 0.0 else 1.0 + self.ks


@dataclass(frozen=True)
class RadioValue:
    """A number of the radio, for each run with a value and for the log; NaN: not in the log."""

    name: str
    unit: str
    help: str
    runs: tuple[float, ...]
    log: float
    grain: float  # tolerance of counting


@dataclass(frozen=True)
class RadioRow:
    """A number of the radio over the compared time."""

    value: RadioValue
    emulated: Spread
    runs: int  # runs with a value

    @property
    def within(self) -> bool | None:
        """True if the log is between the 5 % and the 95 % quantile, with tolerance; None: too few runs."""
        value = self.value
        if self.runs < MIN_RUNS or math.isnan(value.log):
            return None
        return self.emulated.low - value.grain <= value.log <= self.emulated.high + value.grain


@dataclass(frozen=True)
class SimToReal:
    """A comparison of runs with a log."""

    runs: int
    duration_s: float  # compared time from the start
    rows: tuple[MetricRow, ...]  # the worst first
    radio: tuple[RadioRow, ...]
    not_in_log: Mapping[str, str]  # missing data by metric
    not_compared: Mapping[str, str]  # reason by number of the radio
    not_in_run: tuple[str, ...]  # metrics that the runs did not record
    undefined: tuple[str, ...]  # metrics with a value only on one side
    never: tuple[str, ...]  # times of events that happened on neither side

    @property
    def judged(self) -> tuple[MetricRow, ...]:
        """Metrics with a result of `within`."""
        return tuple(row for row in self.rows if row.within is not None)

    @property
    def judged_radio(self) -> tuple[RadioRow, ...]:
        """Numbers of the radio with a result of `within`."""
        return tuple(row for row in self.radio if row.within is not None)

    @property
    def outside_by_chance(self) -> float:
        """Expected number of judged values of one more run that are outside.

        A metric is outside once in runs + 1. A number is below the 5 % quantile, which is 0.05 (runs - 1) ranks above
        the least of the runs, once in (runs + 1) / (1 + 0.05 (runs - 1)), and above the 95 % quantile as often.
        """
        ranks = 2.0 * (1.0 + SPREAD[0] * (self.runs - 1))
        return (len(self.judged) + ranks * len(self.judged_radio)) / (self.runs + 1)


def compare_sim_to_real(emulated: EmulatedRuns, log: MeasuredLog, metrics: Sequence[Metric]) -> SimToReal:
    """Compare metrics over the common duration of log and runs, counted from the start of each."""
    duration_s = min(log.duration_s, *(run.duration_s for run in emulated.runs), math.inf)
    rows: list[MetricRow] = []
    undefined: list[str] = []
    never: list[str] = []
    absent: list[str] = []
    not_in_log = {**log.left_out, **_range_metrics(emulated, metrics)}
    for metric in metrics:
        if metric.name in not_in_log:
            continue
        recorded = [run.series[metric.name] for run in emulated.runs if metric.name in run.series]
        if not recorded:
            absent.append(metric.name)
            continue
        runs = [_values(metric, series, emulated.rate_hz, duration_s) for series in recorded]
        real = _values(metric, log.series[metric.name], log.static.rate_hz, duration_s)
        runs = [values for values in runs if len(values)]
        if runs and len(real):
            rows.append(_row(metric, runs, real, duration_s))
        elif runs or len(real):
            undefined.append(metric.name)
        elif metric.kind == "time":
            never.append(metric.name)
    rows.sort(key=lambda row: -row.badness)
    numbers = list(radio_values(emulated, log, duration_s)) if log.radio else []
    reason = uncovered_time(emulated, log, duration_s)
    has_radio = any(run.radio for run in emulated.runs)
    return SimToReal(
        runs=len(emulated.runs),
        duration_s=duration_s,
        rows=tuple(rows),
        radio=tuple(RadioRow(value, spread(value.runs), len(value.runs)) for value in numbers if value.runs),
        not_in_log=not_in_log,
        not_compared={value.name: reason for value in numbers if not value.runs} if reason and has_radio else {},
        not_in_run=tuple(absent),
        undefined=tuple(undefined),
        never=tuple(never),
    )


def spread(values: Iterable[float]) -> Spread:
    """Return quantiles over runs, by linear interpolation."""
    samples = np.array(list(values), np.float64)
    return Spread(*np.quantile(samples, SPREAD).tolist()) if len(samples) else Spread(math.nan, math.nan, math.nan)


def _range_metrics(emulated: EmulatedRuns, metrics: Sequence[Metric]) -> dict[str, str]:
    """Return the metrics that count receivers in range, if some are out of range: in a log all receivers count."""
    out_of_range = any(run.radio and run.radio["fates"].get("out_of_range") for run in emulated.runs)
    counting = [metric.name for metric in metrics if isinstance(metric, LinkPacketDeliveryRatio)]
    return dict.fromkeys(counting, ONLY_IN_RANGE) if out_of_range else {}


def _values(metric: Metric, series: FloatArray, rate_hz: int, duration_s: float) -> FloatArray:
    """Return the finite values of a metric within a duration: increases per second of a count, the last of a time."""
    series = series[: math.floor(duration_s * rate_hz + 1e-6) + 1]
    if metric.kind == "time":
        series = series[-1:]
    finite = series[np.isfinite(series)]
    return np.diff(finite, prepend=0.0) * rate_hz if metric.kind == "count" else finite


def _row(metric: Metric, runs: list[FloatArray], real: FloatArray, duration_s: float) -> MetricRow:
    emulated = spread(float(values.mean()) for values in runs)
    row = MetricRow(metric, emulated, float(real.mean()), tuple(runs), real)
    if metric.kind == "time":
        return row
    pooled = np.concatenate(runs)
    reach, difference = math.nan, UNKNOWN
    if len(runs) >= MIN_RUNS:
        reach = max(_distance_to_others(runs, index) for index in range(len(runs)))
    elif len(runs) == 1:
        difference = mean_difference_interval(runs[0], real)
    return replace(
        row,
        ks=kolmogorov_smirnov(pooled, real),
        distance=wasserstein_1(pooled, real),
        reach=reach,
        difference=difference,
        grain=_count_grain(emulated.median, duration_s) if metric.kind == "count" and duration_s > 0.0 else 0.0,
    )


def _count_grain(per_s: float, duration_s: float) -> float:
    """Return the tolerance of counts per second: an event more or less at both ends, and COUNT_TOLERANCE."""
    return 2.0 / duration_s + COUNT_TOLERANCE * per_s


def _distance_to_others(runs: list[FloatArray], index: int) -> float:
    return wasserstein_1(np.concatenate([*runs[:index], *runs[index + 1 :]]), runs[index])


class _Totals(NamedTuple):
    """The radio's totals over a duration."""

    radio: Radio
    duration_s: float
    robots: int


_Number = tuple[str, str, str, Callable[[_Totals], float | None]]  # name, unit, help, function of the totals


def uncovered_time(emulated: EmulatedRuns, log: MeasuredLog, duration_s: float) -> str | None:
    """Return a text on totals of log or runs over more than the compared time; None: they agree."""
    if duration_s < MIN_COVERAGE * log.duration_s:
        return f"the log covers {number_text(log.duration_s)} s, of which {number_text(duration_s)} s are compared"
    longest_s = max((run.duration_s for run in emulated.runs if run.radio), default=0.0)
    if duration_s < MIN_COVERAGE * longest_s:
        return (
            f"runs keep totals of all their {number_text(longest_s)} s, of which {number_text(duration_s)} s are "
            f"compared; emulate {number_text(duration_s)} s for them"
        )
    return None


def radio_values(emulated: EmulatedRuns, log: MeasuredLog, duration_s: float) -> Iterator[RadioValue]:
    """Yield traffic, PDR and latencies over this time; latencies are those to the agent, if the log has no others.

    The PDR is received / intended receivers, in range or not. For longer runs, the values come from the counts of
    each tick; there are no values if the log is longer.
    """
    is_covered = duration_s >= MIN_COVERAGE * log.duration_s
    totals = [_totals(run, emulated, duration_s) for run in emulated.runs if run.radio and is_covered]
    log_totals = _Totals(log.radio, log.duration_s, log.static.robots)
    numbers = (*_TRAFFIC, *(_TO_AGENT if log.has_air else _ON_AIR))
    for name, unit, text, function in numbers:
        values = tuple(value for value in map(function, totals) if value is not None)
        log_value = function(log_totals)
        greatest = max(values, default=0.0)
        # The tolerance of latencies is a bin of their histogram.
        grain = _count_grain(greatest, log.duration_s) if unit == "1/s" else 2.0 * RELATIVE_ERROR * greatest
        yield RadioValue(name, unit, text, values, math.nan if log_value is None else log_value, grain if unit else 0.0)


def _totals(run: EmulatedRun, emulated: EmulatedRuns, duration_s: float) -> _Totals:
    """Return the totals of a run of this duration; of a longer run, the sums of its first ticks' counts."""
    radio = run.radio or {}
    if duration_s >= MIN_COVERAGE * run.duration_s:
        return _Totals(radio, run.duration_s, emulated.robots)
    ticks = math.floor(duration_s * emulated.rate_hz + 1e-6)
    sums = {name: float(np.nansum(count[:ticks])) for name, count in run.counts.items()}
    partial: dict[str, Any] = {"sent": sums["sent"]} if "sent" in sums else {}
    final = radio["intended"] - radio["fates"].get("in_flight", 0)
    if sums and final == radio.get("in_range"):  # all intended receivers were within range
        partial |= {"intended": sums["in_range"], "fates": {"received": sums["received"]}}
    return _Totals(partial, ticks / emulated.rate_hz, emulated.robots)


def _sent(totals: _Totals) -> float | None:
    if "sent" not in totals.radio:
        return None
    return totals.radio["sent"] / (totals.duration_s * totals.robots) if totals.duration_s > 0.0 else None


def _pdr(totals: _Totals) -> float | None:
    if "intended" not in totals.radio:
        return None
    final = totals.radio["intended"] - totals.radio["fates"].get("in_flight", 0)
    return totals.radio["fates"]["received"] / final if final else None


def _latency(kind: str, percent: str) -> Callable[[_Totals], float | None]:
    return lambda totals: totals.radio[kind][percent] if kind in totals.radio else None


def _latencies(name: str, kind: str, text: str) -> tuple[_Number, ...]:
    return tuple((f"{name} {percent}", "s", text, _latency(kind, percent)) for percent in ("p50", "p90", "p99"))


_TRAFFIC: tuple[_Number, ...] = (
    ("packets sent", "1/s", "by each robot", _sent),
    ("total pdr", "", "received / intended receivers, of all packets that ended", _pdr),
)
_ON_AIR = _latencies("latency", "latency_air_s", "from sending to reception")
_TO_AGENT = _latencies("latency to agent", "latency_agent_s", "from sending to the agent's next step")
