"""The metrics of emulated runs and of real robots side by side, and how far apart they are.

Whether a log lies within the spread over seeds is asked of distances: each run's to all other runs, and the log's to
all runs. A log that is one more of these runs lies farther out than all n of them once in n + 1 times.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
MIN_RUNS = 3  # that have a spread
COUNT_TOLERANCE = 0.01  # of a count per second: robots' loops miss a step now and then, and clocks differ
WHOLE = 0.95  # share of a run that must be compared for its totals to count
SPREAD = (0.05, 0.5, 0.95)
ONLY_IN_RANGE = "who was within range is not in the log, and not all were; pdr counts all on both sides"


@dataclass(frozen=True)
class Spread:
    """A value over runs: of a single one all three are the same; NaN of none."""

    low: float  # 5 %
    median: float
    high: float  # 95 %


@dataclass(frozen=True)
class MetricRow:
    """One metric: its mean over ticks (of a count per second), and its distribution."""

    metric: Metric
    emulated: Spread  # over runs
    log: float
    ks: float  # between the log's values and those of all runs; NaN for what has no distribution, a time
    distance: float  # Wasserstein-1 between them, in the metric's unit
    reach: float  # the farthest that one run is from the others; NaN of fewer than three
    difference: Interval  # of the means, log less run, by blocks of ticks: of a single run
    runs: tuple[FloatArray, ...]  # the values of each run
    values: FloatArray  # those of the log
    grain: float = 0.0  # how far apart equal ones may be by the way they are counted, in the metric's unit

    @property
    def within(self) -> bool | None:
        """Whether the log lies within the spread, or the means differ by no more than chance; None: undecided."""
        if not math.isnan(self.reach):
            return self.distance <= self.reach + self.grain
        low, high = self.difference.low - self.grain, self.difference.high + self.grain
        return None if math.isnan(low) else low <= 0.0 <= high

    @property
    def badness(self) -> float:
        """By which the worst come first."""
        if math.isnan(self.ks):
            return -1.0
        return self.distance / self.reach if self.reach > 0.0 else 1.0 + self.ks


@dataclass(frozen=True)
class RadioValue:
    """One number, of each run that has it and of the log; NaN: the log lacks it."""

    name: str
    unit: str
    help: str
    runs: tuple[float, ...]
    log: float
    grain: float  # how far apart equal networks may be by the way it is counted


@dataclass(frozen=True)
class RadioRow:
    """A number of the radio over the time that is compared."""

    of: RadioValue
    emulated: Spread
    runs: int  # with a value

    @property
    def within(self) -> bool | None:
        """Whether it is between the 5 % and the 95 % of the runs, as far as can be counted; None: too few."""
        if self.runs < MIN_RUNS or math.isnan(self.of.log):
            return None
        return self.emulated.low - self.of.grain <= self.of.log <= self.emulated.high + self.of.grain


@dataclass(frozen=True)
class SimToReal:
    """The whole comparison."""

    runs: int
    duration_s: float  # that is compared, from the start
    rows: tuple[MetricRow, ...]  # the worst first
    radio: tuple[RadioRow, ...]
    not_in_log: Mapping[str, str]  # by metric: what it lacks
    not_compared: Mapping[str, str]  # by number of the radio: why
    not_in_run: tuple[str, ...]  # metrics that the runs did not keep
    undefined: tuple[str, ...]  # that had a value on one side alone
    never: tuple[str, ...]  # times of what happened on neither side

    @property
    def judged(self) -> tuple[MetricRow, ...]:
        """The metrics of which something can be said."""
        return tuple(row for row in self.rows if row.within is not None)

    @property
    def judged_radio(self) -> tuple[RadioRow, ...]:
        """The radio's numbers of which something can be said."""
        return tuple(row for row in self.radio if row.within is not None)

    @property
    def outside_by_chance(self) -> float:
        """How many of the judged numbers of one more run would lie outside, on average.

        A metric is outside once in runs + 1. A number is below the 5 % quantile, which lies 0.05 (runs - 1) ranks above
        the least of the runs, once in (runs + 1) / (1 + 0.05 (runs - 1)), and above the 95 % quantile as often.
        """
        ranks = 2.0 * (1.0 + SPREAD[0] * (self.runs - 1))
        return (len(self.judged) + ranks * len(self.judged_radio)) / (self.runs + 1)


def compare_sim_to_real(emulated: EmulatedRuns, log: MeasuredLog, metrics: Sequence[Metric]) -> SimToReal:
    """Compare metrics over the time that log and runs have in common, counted from the start of each."""
    duration_s = min(log.duration_s, *(run.duration_s for run in emulated.runs), math.inf)
    rows: list[MetricRow] = []
    undefined: list[str] = []
    never: list[str] = []
    absent: list[str] = []
    lacks = {**log.left_out, **_of_range(emulated, metrics)}
    for metric in metrics:
        if metric.name in lacks:
            continue
        kept = [run.series[metric.name] for run in emulated.runs if metric.name in run.series]
        if not kept:
            absent.append(metric.name)
            continue
        runs = [_values(metric, of, emulated.rate_hz, duration_s) for of in kept]
        real = _values(metric, log.series[metric.name], log.static.rate_hz, duration_s)
        runs = [values for values in runs if len(values)]
        if runs and len(real):
            rows.append(_row(metric, runs, real, duration_s))
        elif runs or len(real):
            undefined.append(metric.name)
        elif metric.kind == "time":
            never.append(metric.name)
    rows.sort(key=lambda row: -row.badness)
    numbers = list(radio_values(emulated, log, duration_s))
    radio = tuple(RadioRow(of, spread(of.runs), len(of.runs)) for of in numbers if of.runs)
    why = why_no_radio(emulated, log, duration_s)
    has_radio = any(run.radio for run in emulated.runs)
    not_compared = {of.name: why for of in numbers if not of.runs} if why is not None and has_radio else {}
    lists = (tuple(names) for names in (absent, undefined, never))
    return SimToReal(len(emulated.runs), duration_s, tuple(rows), radio, lacks, not_compared, *lists)


def spread(values: Iterable[float]) -> Spread:
    """Over runs, by linear interpolation."""
    known = np.array(list(values), np.float64)
    return Spread(*np.quantile(known, SPREAD).tolist()) if len(known) else Spread(math.nan, math.nan, math.nan)


def _of_range(emulated: EmulatedRuns, metrics: Sequence[Metric]) -> dict[str, str]:
    """Metrics that count receivers in range alone, which in a log are all: not the same where some were out of it."""
    out_of_range = any(run.radio and run.radio["fates"].get("out_of_range") for run in emulated.runs)
    counting = [metric.name for metric in metrics if isinstance(metric, LinkPacketDeliveryRatio)]
    return dict.fromkeys(counting, ONLY_IN_RANGE) if out_of_range else {}


def _values(metric: Metric, series: FloatArray, rate_hz: int, duration_s: float) -> FloatArray:
    """The finite values of a metric within a time: of a count what was added per second, of a time the last."""
    series = series[: math.floor(duration_s * rate_hz + 1e-6) + 1]
    if metric.kind == "time":
        series = series[-1:]
    known = series[np.isfinite(series)]
    return np.diff(known, prepend=0.0) * rate_hz if metric.kind == "count" else known


def _row(metric: Metric, runs: list[FloatArray], real: FloatArray, duration_s: float) -> MetricRow:
    emulated, mean = spread(float(of.mean()) for of in runs), float(real.mean())
    nan, values = math.nan, (tuple(runs), real)
    if metric.kind == "time":
        return MetricRow(metric, emulated, mean, nan, nan, nan, UNKNOWN, *values)
    pooled = np.concatenate(runs)
    reach, difference = nan, UNKNOWN
    if len(runs) >= MIN_RUNS:
        reach = max(_to_others(runs, place) for place in range(len(runs)))
    elif len(runs) == 1:
        difference = mean_difference_interval(runs[0], real)
    ks, distance = kolmogorov_smirnov(pooled, real), wasserstein_1(pooled, real)
    grain = _count_grain(emulated.median, duration_s) if metric.kind == "count" and duration_s > 0.0 else 0.0
    return MetricRow(metric, emulated, mean, ks, distance, reach, difference, *values, grain)


def _count_grain(per_s: float, duration_s: float) -> float:
    """How far apart equal counts per second may be: one event more or less at either end, and the tolerance."""
    return 2.0 / duration_s + COUNT_TOLERANCE * per_s


def _to_others(runs: list[FloatArray], place: int) -> float:
    return wasserstein_1(np.concatenate([*runs[:place], *runs[place + 1 :]]), runs[place])


class _Whole(NamedTuple):
    """A whole run."""

    radio: Radio
    duration_s: float
    robots: int


_Number = tuple[str, str, str, Callable[[_Whole], float | None]]  # name, unit, help, and the number itself


def why_no_radio(emulated: EmulatedRuns, log: MeasuredLog, duration_s: float) -> str | None:
    """Why the totals of runs or log do not cover the compared time; None: they do."""
    if duration_s < WHOLE * log.duration_s:
        return f"the log's are of {number_text(log.duration_s)} s, of which {number_text(duration_s)} s are compared"
    longest_s = max((run.duration_s for run in emulated.runs if run.radio), default=0.0)
    if duration_s < WHOLE * longest_s:
        return (
            f"runs keep totals of all their {number_text(longest_s)} s, of which {number_text(duration_s)} s are "
            f"compared; emulate {number_text(duration_s)} s for them"
        )
    return None


def radio_values(emulated: EmulatedRuns, log: MeasuredLog, duration_s: float) -> Iterator[RadioValue]:
    """Traffic, PDR and latencies over this time: to the agent, where logs have no others.

    The PDR is received / intended receivers, in range or not. For longer runs, the values come from the counts of
    each tick; none has values if the log is longer.
    """
    fits = duration_s >= WHOLE * log.duration_s
    wholes = [_within(run, emulated, duration_s) for run in emulated.runs if run.radio and fits]
    real = _Whole(log.radio, log.duration_s, log.static.robots)
    numbers = (*_TRAFFIC, *(_TO_AGENT if log.has_air else _ON_AIR))
    for name, unit, text, of in numbers:
        told = (of(whole) for whole in wholes)
        of_log = of(real)
        known = tuple(value for value in told if value is not None)
        most = max(known, default=0.0)  # of latencies, a bin of their histogram
        grain = _count_grain(most, log.duration_s) if unit == "1/s" else 2.0 * RELATIVE_ERROR * most
        yield RadioValue(name, unit, text, known, math.nan if of_log is None else of_log, grain if unit else 0.0)


def _within(run: EmulatedRun, emulated: EmulatedRuns, duration_s: float) -> _Whole:
    """The totals of a run, if it is that long; else the sums of its first ticks' counts."""
    radio = run.radio or {}
    if duration_s >= WHOLE * run.duration_s:
        return _Whole(radio, run.duration_s, emulated.robots)
    ticks = math.floor(duration_s * emulated.rate_hz + 1e-6)
    sums = {name: float(np.nansum(count[:ticks])) for name, count in run.counts.items()}
    told: dict[str, Any] = {"sent": sums["sent"]} if "sent" in sums else {}
    final = radio["intended"] - radio["fates"].get("in_flight", 0)
    if sums and final == radio.get("in_range"):  # all that packets were meant for were within range
        told |= {"intended": sums["in_range"], "fates": {"received": sums["received"]}}
    return _Whole(told, ticks / emulated.rate_hz, emulated.robots)


def _sent(of: _Whole) -> float | None:
    if "sent" not in of.radio:
        return None
    return of.radio["sent"] / (of.duration_s * of.robots) if of.duration_s > 0.0 else None


def _pdr(of: _Whole) -> float | None:
    if "intended" not in of.radio:
        return None
    final = of.radio["intended"] - of.radio["fates"].get("in_flight", 0)
    return of.radio["fates"]["received"] / final if final else None


def _latency(kind: str, percent: str) -> Callable[[_Whole], float | None]:
    return lambda of: of.radio[kind][percent] if kind in of.radio else None


def _latencies(name: str, kind: str, text: str) -> tuple[_Number, ...]:
    return tuple((f"{name} {percent}", "s", text, _latency(kind, percent)) for percent in ("p50", "p90", "p99"))


_TRAFFIC: tuple[_Number, ...] = (
    ("packets sent", "1/s", "by each robot", _sent),
    ("total pdr", "", "received / intended receivers, of all packets that ended", _pdr),
)
_ON_AIR = _latencies("latency", "latency_air_s", "from sending to hearing")
_TO_AGENT = _latencies("latency to agent", "latency_agent_s", "from sending to the agent's next step")
