"""Latency fitted to delivery times: a constant with uniform jitter, or a distribution of delays."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy import optimize
from scipy.special import ndtri

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue
from swarmwire.metrics.statistics.difference import kolmogorov_smirnov

TAIL = 0.05  # the quantiles: this, the median, and 1 - this
EVEN = 1000  # quantiles of a fitted delay that packets are held against
FOLDS = 10  # parts of the packets, for standard errors
MIN_SHAPE, MAX_SHAPE = 2.01, 100.0  # of a Pareto law: below, it has no deviation; above, it is exponential
SYMMETRIC = 3.0  # deviations that a normal delay's mean is above 0 at least: nothing is cut off
_Z = float(ndtri(1.0 - TAIL))
_SHARES: FloatArray = (np.arange(EVEN) + 0.5) / EVEN
MIN_PACKETS = 100
PERCENTS = (50.0, 90.0, 99.0)
OTHER_SHAPE = 0.1  # Kolmogorov and Smirnov's distance from which on the delay is said not to be uniform
NOT_UNIFORM = 0.05  # that distance from which on other distributions are tried
KOLMOGOROV = 1.36  # 5 % of uniform samples are farther from their law than this over the root of their number
CLEARLY = 0.5


@dataclass(frozen=True)
class DelayFit:
    """A constant delay, and one that varies on top."""

    distribution: str  # as [radio.delays] calls it
    latency_s: EstimatedValue
    mean_s: EstimatedValue  # of the varying part
    deviation_s: EstimatedValue
    quantiles_s: FloatArray  # (EVEN,) of the whole delay
    apart: float  # Kolmogorov and Smirnov's distance between the packets and the fit, 0 to 1


@dataclass(frozen=True)
class _Law:
    latency_s: float
    mean_s: float
    deviation_s: float
    quantiles_s: FloatArray


def fit_delays(latency_s: FloatArray) -> DelayFit | None:
    """The distribution nearest to the latencies of packets (n,), all finite; None if none fits.

    Standard errors are by tenths of the packets; NaN where these are too few for a fit.
    """
    found: list[DelayFit] = []
    for distribution, fit in _LAWS.items():
        law = _fitted(fit, latency_s)
        if law is not None:
            apart = kolmogorov_smirnov(latency_s, law.quantiles_s)
            latency, mean, deviation = (
                EstimatedValue(value, math.nan) for value in (law.latency_s, law.mean_s, law.deviation_s)
            )
            found.append(DelayFit(distribution, latency, mean, deviation, law.quantiles_s, apart))
    if not found:
        return None
    best = min(found, key=lambda of: of.apart)
    parts = [_fitted(_LAWS[best.distribution], latency_s[fold::FOLDS]) for fold in range(FOLDS)]
    laws = [law for law in parts if law is not None]
    if len(laws) < FOLDS:
        return best

    def with_error(of: EstimatedValue, values: list[float]) -> EstimatedValue:
        return EstimatedValue(of.value, float(np.std(values, ddof=1)) / math.sqrt(FOLDS))

    return replace(
        best,
        latency_s=with_error(best.latency_s, [law.latency_s for law in laws]),
        mean_s=with_error(best.mean_s, [law.mean_s for law in laws]),
        deviation_s=with_error(best.deviation_s, [law.deviation_s for law in laws]),
    )


def _fitted(fit: Callable[[float, float, float], _Law | None], latency_s: FloatArray) -> _Law | None:
    low, middle, high = np.quantile(latency_s, (TAIL, 0.5, 1.0 - TAIL)).tolist()
    law = fit(low, middle, high) if 0.0 < low < middle < high else None
    # A sample cannot deviate by more than its largest value.
    return law if law is not None and law.deviation_s <= latency_s.max() else None


def _normal(low: float, middle: float, high: float) -> _Law | None:
    deviation_s = (high - low) / (2.0 * _Z)
    if middle < SYMMETRIC * deviation_s:
        return None
    return _Law(0.0, middle, deviation_s, middle + deviation_s * ndtri(_SHARES))


def _lognormal(low: float, middle: float, high: float) -> _Law | None:
    """Above the constant, the median is the geometric mean of the two other quantiles; with none below 0 it is 0."""
    skew = low + high - 2.0 * middle
    if skew <= 0.0:
        return None
    constant = max((low * high - middle**2) / skew, 0.0)
    ratio = (high - constant) / (low - constant) if low > constant else math.inf
    if math.isinf(ratio):
        return None
    spread = math.log(ratio) / (2.0 * _Z)
    mean_s = (middle - constant) * math.exp(0.5 * spread**2)
    deviation_s = mean_s * math.sqrt(math.expm1(spread**2))
    return _Law(constant, mean_s, deviation_s, constant + (middle - constant) * np.exp(spread * ndtri(_SHARES)))


def _pareto(low: float, middle: float, high: float) -> _Law | None:
    """The shape follows from the ratio of the quantiles' distances; with a constant below 0, of two quantiles."""

    def widths(shape: float) -> tuple[float, float]:
        of_low, of_middle, of_high = ((1.0 - share) ** (-1.0 / shape) for share in (TAIL, 0.5, 1.0 - TAIL))
        return of_middle - of_low, of_high - of_middle

    def excess(shape: float) -> float:
        lower, upper = widths(shape)
        return upper / lower - (high - middle) / (middle - low)

    if excess(MIN_SHAPE) * excess(MAX_SHAPE) > 0.0:
        return None
    shape = float(cast("Any", optimize).brentq(excess, MIN_SHAPE, MAX_SHAPE))
    least_s = (middle - low) / widths(shape)[0]
    constant = low - least_s * (1.0 - TAIL) ** (-1.0 / shape)
    if constant < 0.0:
        shape = math.log((1.0 - TAIL) / TAIL) / math.log(high / low)
        constant, least_s = 0.0, low * (1.0 - TAIL) ** (1.0 / shape)
        if shape < MIN_SHAPE:
            return None
    mean_s = least_s * shape / (shape - 1.0)
    deviation_s = mean_s / math.sqrt(shape * (shape - 2.0))
    return _Law(constant, mean_s, deviation_s, constant + least_s * (1.0 - _SHARES) ** (-1.0 / shape))


_LAWS = {"normal": _normal, "lognormal": _lognormal, "pareto": _pareto}


@dataclass(frozen=True)
class LatencyFit:
    """The delay of received packets."""

    latency_s: EstimatedValue
    jitter_s: EstimatedValue
    percentiles_s: tuple[float, ...]  # p50, p90, p99 of the packets
    apart: float  # Kolmogorov and Smirnov's distance between the packets and the fit, 0 to 1
    delays: DelayFit | None  # in place of the uniform delay, where it fits clearly better
    negative: float  # share of the packets that came before they were sent: clocks are apart


def fit_latency(latency_s: FloatArray) -> LatencyFit | str:
    """The fit to latencies of packets (n,), NaN: unknown; or a sentence on missing data.

    Of a delay uniform from a to a + j the quantiles q and 1 - q are j (1 - 2 q) apart, and the lower one is a + q j. A
    twentieth of the packets at either end is ignored. A negative constant, which no scenario takes, is 0.
    """
    known = latency_s[np.isfinite(latency_s)]
    if len(known) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets with latency_s, got {len(known)}"
    low, high = np.quantile(known, (TAIL, 1.0 - TAIL)).tolist()
    jitter_s = (high - low) / (1.0 - 2.0 * TAIL)
    constant_s = low - TAIL * jitter_s
    # Variances of quantiles of uniform delays (David and Nagaraja, Order Statistics (2003), section 2.3).
    one, both = TAIL * (1.0 - TAIL), TAIL * TAIL
    error_of_jitter_s = jitter_s * math.sqrt(2.0 * (one - both) / len(known)) / (1.0 - 2.0 * TAIL)
    error_s = math.sqrt(jitter_s**2 * one / len(known) + (TAIL * error_of_jitter_s) ** 2)
    even = max(constant_s, 0.0) + jitter_s * (np.arange(EVEN) + 0.5) / EVEN
    apart = kolmogorov_smirnov(known, even) if jitter_s > 0.0 else 0.0
    percentiles: list[float] = np.percentile(known, PERCENTS, method="inverted_cdf").tolist()
    return LatencyFit(
        EstimatedValue(max(constant_s, 0.0), error_s),
        EstimatedValue(jitter_s, error_of_jitter_s),
        tuple(percentiles),
        apart,
        _clearly_better(known, apart),
        float(np.mean(known < 0.0)),
    )


def _clearly_better(known: FloatArray, apart: float) -> DelayFit | None:
    """Another distribution, at most half as far from the packets as the uniform one, which chance does not explain."""
    if apart < max(NOT_UNIFORM, KOLMOGOROV / math.sqrt(len(known))):
        return None
    found = fit_delays(known)
    return found if found is not None and found.apart <= CLEARLY * apart else None
