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

TAIL = 0.05  # fits use the quantiles TAIL, 0.5 and 1 - TAIL
EVEN = 1000  # quantiles of a fitted delay for the comparison with packets
FOLDS = 10  # parts of the packets, for standard errors
MIN_SHAPE, MAX_SHAPE = 2.01, 100.0  # Pareto shapes: below, it has no deviation; above, it is exponential
SYMMETRIC = 3.0  # least mean of a normal delay in deviations, so that hardly a delay is negative
_Z = float(ndtri(1.0 - TAIL))
_SHARES: FloatArray = (np.arange(EVEN) + 0.5) / EVEN
MIN_PACKETS = 100
PERCENTS = (50.0, 90.0, 99.0)
OTHER_SHAPE = 0.1  # Kolmogorov-Smirnov distance above which a note says that the delay is not uniform
NOT_UNIFORM = 0.05  # Kolmogorov-Smirnov distance above which other distributions are tried
KOLMOGOROV = 1.36  # 5 % critical value of the distance, times the root of the number of packets
MAX_DISTANCE_RATIO = 0.5  # another distribution is preferred at most at this distance relative to the uniform delay's


@dataclass(frozen=True)
class DelayFit:
    """A constant delay, and one that varies on top."""

    distribution: str  # name in [radio.delays]
    latency_s: EstimatedValue
    mean_s: EstimatedValue  # mean of the varying part
    deviation_s: EstimatedValue
    quantiles_s: FloatArray  # (EVEN,) quantiles of the sum
    ks_distance: float  # Kolmogorov-Smirnov distance between packets and fit, 0 to 1


@dataclass(frozen=True)
class _Law:
    latency_s: float
    mean_s: float
    deviation_s: float
    quantiles_s: FloatArray


def fit_delays(latency_s: FloatArray) -> DelayFit | None:
    """Return the distribution nearest to the latencies of packets (n,), all finite; None if no distribution fits.

    Standard errors come from tenths of the packets; NaN if these are too few for a fit.
    """
    fits: list[DelayFit] = []
    for distribution, fit in _LAWS.items():
        law = _fitted(fit, latency_s)
        if law is not None:
            ks_distance = kolmogorov_smirnov(latency_s, law.quantiles_s)
            latency, mean, deviation = (
                EstimatedValue(value, math.nan) for value in (law.latency_s, law.mean_s, law.deviation_s)
            )
            fits.append(DelayFit(distribution, latency, mean, deviation, law.quantiles_s, ks_distance))
    if not fits:
        return None
    best = min(fits, key=lambda fit: fit.ks_distance)
    parts = [_fitted(_LAWS[best.distribution], latency_s[fold::FOLDS]) for fold in range(FOLDS)]
    laws = [law for law in parts if law is not None]
    if len(laws) < FOLDS:
        return best

    def with_error(estimate: EstimatedValue, values: list[float]) -> EstimatedValue:
        return EstimatedValue(estimate.value, float(np.std(values, ddof=1)) / math.sqrt(FOLDS))

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
    """Fit a constant, at least 0, above which the median is the geometric mean of the two other quantiles."""
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
    """Fit the shape to the ratio of the quantiles' distances, or without a constant to two quantiles."""

    def widths(shape: float) -> tuple[float, float]:
        lower, median, upper = ((1.0 - share) ** (-1.0 / shape) for share in (TAIL, 0.5, 1.0 - TAIL))
        return median - lower, upper - median

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
    percentiles_s: tuple[float, ...]  # p50, p90, p99
    ks_distance: float  # Kolmogorov-Smirnov distance between packets and fit, 0 to 1
    delays: DelayFit | None  # a distribution that fits clearly better than the uniform delay
    negative: float  # share of packets with a negative latency, since clocks differ


def fit_latency(latency_s: FloatArray) -> LatencyFit | str:
    """Fit latencies of packets (n,), NaN: unknown; or return a sentence on missing data.

    The quantiles q and 1 - q of a delay that is uniform from a to a + j differ by j (1 - 2 q), and the lower one is
    a + q j. A twentieth of the packets at either end is ignored. A negative constant, invalid in scenarios, becomes 0.
    """
    latency_s = latency_s[np.isfinite(latency_s)]
    if len(latency_s) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets with latency_s, got {len(latency_s)}"
    low, high = np.quantile(latency_s, (TAIL, 1.0 - TAIL)).tolist()
    jitter_s = (high - low) / (1.0 - 2.0 * TAIL)
    constant_s = low - TAIL * jitter_s
    # Variances of quantiles of uniform delays (David and Nagaraja, Order Statistics (2003), section 2.3).
    variance, covariance = TAIL * (1.0 - TAIL), TAIL * TAIL
    jitter_error_s = jitter_s * math.sqrt(2.0 * (variance - covariance) / len(latency_s)) / (1.0 - 2.0 * TAIL)
    error_s = math.sqrt(jitter_s**2 * variance / len(latency_s) + (TAIL * jitter_error_s) ** 2)
    even = max(constant_s, 0.0) + jitter_s * (np.arange(EVEN) + 0.5) / EVEN
    ks_distance = kolmogorov_smirnov(latency_s, even) if jitter_s > 0.0 else 0.0
    percentiles: list[float] = np.percentile(latency_s, PERCENTS, method="inverted_cdf").tolist()
    return LatencyFit(
        EstimatedValue(max(constant_s, 0.0), error_s),
        EstimatedValue(jitter_s, jitter_error_s),
        tuple(percentiles),
        ks_distance,
        _clearly_better(latency_s, ks_distance),
        float(np.mean(latency_s < 0.0)),
    )


def _clearly_better(latency_s: FloatArray, ks_distance: float) -> DelayFit | None:
    """Return a distribution at most half as far from the packets as the uniform delay; None if chance explains that."""
    if ks_distance < max(NOT_UNIFORM, KOLMOGOROV / math.sqrt(len(latency_s))):
        return None
    fit = fit_delays(latency_s)
    return fit if fit is not None and fit.ks_distance <= MAX_DISTANCE_RATIO * ks_distance else None
