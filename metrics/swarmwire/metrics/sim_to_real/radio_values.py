"""What the radio came to in the time that is compared, in numbers that a real network knows, too."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import floor, nan
from typing import Any, NamedTuple

import numpy as np

from swarmwire.metrics.network.latency import RELATIVE_ERROR
from swarmwire.metrics.real_log.measured_log import MeasuredLog
from swarmwire.metrics.sim_to_real.emulated_runs import EmulatedRun, EmulatedRuns
from swarmwire.metrics.statistics.summary import number_text

Radio = Mapping[str, Any]


@dataclass(frozen=True)
class RadioValue:
    """One number, of each run that has it and of the log; NaN: the log does not tell."""

    name: str
    unit: str
    help: str
    runs: tuple[float, ...]
    log: float
    grain: float  # how far apart equal networks may be by the way it is counted


class _Whole(NamedTuple):
    """A whole run."""

    radio: Radio
    duration_s: float
    robots: int


_Number = tuple[str, str, str, Callable[[_Whole], float | None]]  # name, unit, help, and the number itself
WHOLE = 0.95  # share of a run that must be compared for its totals to count


def why_no_radio(emulated: EmulatedRuns, log: MeasuredLog, duration_s: float) -> str | None:
    """Why numbers that only totals tell are not of the time that is compared; None: they are."""
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
    """Traffic, delivery ratio and latencies over this time: to the agent, where robots know no others.

    The delivery ratio is of all intended receivers, in range or not. Runs that are longer have what their counts of
    each tick tell; none has anything if the log is longer.
    """
    fits = duration_s >= WHOLE * log.duration_s
    wholes = [_within(run, emulated, duration_s) for run in emulated.runs if run.radio and fits]
    real = _Whole(log.radio, log.duration_s, log.static.robots)
    numbers = (*_TRAFFIC, *(_TO_AGENT if log.has_air else _ON_AIR))
    for name, unit, text, of in numbers:
        told = (of(whole) for whole in wholes)
        of_log = of(real)
        known = tuple(value for value in told if value is not None)
        # One packet more or less at the ends; a bin of the latencies' histogram.
        grain = 1.0 / log.duration_s if unit == "1/s" else 2.0 * RELATIVE_ERROR * max(known, default=0.0)
        yield RadioValue(name, unit, text, known, nan if of_log is None else of_log, grain if unit else 0.0)


def _within(run: EmulatedRun, emulated: EmulatedRuns, duration_s: float) -> _Whole:
    """The whole of a run, if it is that long; else what counts of each tick tell of its beginning."""
    radio = run.radio or {}
    if duration_s >= WHOLE * run.duration_s:
        return _Whole(radio, run.duration_s, emulated.robots)
    ticks = floor(duration_s * emulated.rate_hz + 1e-6)
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
    ("total pdr", "", "received / intended receivers, of all packets", _pdr),
)
_ON_AIR = _latencies("latency", "latency_air_s", "from sending to hearing")
_TO_AGENT = _latencies("latency to agent", "latency_agent_s", "from sending to the agent's next step")
