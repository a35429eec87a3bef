"""Latency and jitter: a constant delay and a uniform one on top, as the emulator's radio has them, by quantiles."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.radio_fit.delay_fit import DelayFit, fit_delays
from swarmwire.metrics.radio_fit.estimate import Estimate
from swarmwire.metrics.statistics.distances import kolmogorov_smirnov

MIN_PACKETS = 100
TAIL = 0.05  # share of the packets at either end that may be unusual
PERCENTS = (50.0, 90.0, 99.0)
OTHER_SHAPE = 0.1  # Kolmogorov and Smirnov's distance from which on the delay is said not to be uniform
NOT_UNIFORM = 0.05  # that distance from which on other distributions are tried
KOLMOGOROV = 1.36  # 5 % of uniform samples are farther from their law than this over the root of their number
CLEARLY = 0.5
EVEN = 1000  # quantiles of the fitted delay that packets are held against


@dataclass(frozen=True)
class LatencyFit:
    """The delay of received packets."""

    latency_s: Estimate
    jitter_s: Estimate
    percentiles_s: tuple[float, ...]  # p50, p90, p99 of the packets
    apart: float  # Kolmogorov and Smirnov's distance between the packets and the fit, 0 to 1
    delays: DelayFit | None  # in place of the uniform delay, where it fits clearly better
    negative: float  # share of the packets that came before they were sent: clocks are apart


def fit_latency(latency_s: FloatArray) -> LatencyFit | str:
    """The fit to latencies of packets (n,), of which NaN are not known; or what they lack.

    Of a delay uniform from a to a + j the quantiles q and 1 - q are j (1 - 2 q) apart, and the lower one is a + q j. A
    twentieth of the packets at either end has no say. A negative constant, which no scenario takes, is 0.
    """
    known = latency_s[np.isfinite(latency_s)]
    if len(known) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets with latency_s, got {len(known)}"
    low, high = np.quantile(known, (TAIL, 1.0 - TAIL)).tolist()
    jitter_s = (high - low) / (1.0 - 2.0 * TAIL)
    constant_s = low - TAIL * jitter_s
    # Variances of quantiles of uniform delays (David and Nagaraja, Order Statistics (2003), section 2.3).
    one, both = TAIL * (1.0 - TAIL), TAIL * TAIL
    error_of_jitter_s = jitter_s * sqrt(2.0 * (one - both) / len(known)) / (1.0 - 2.0 * TAIL)
    error_s = sqrt(jitter_s**2 * one / len(known) + (TAIL * error_of_jitter_s) ** 2)
    even = max(constant_s, 0.0) + jitter_s * (np.arange(EVEN) + 0.5) / EVEN
    apart = kolmogorov_smirnov(known, even) if jitter_s > 0.0 else 0.0
    percentiles: list[float] = np.percentile(known, PERCENTS, method="inverted_cdf").tolist()
    return LatencyFit(
        Estimate(max(constant_s, 0.0), error_s),
        Estimate(jitter_s, error_of_jitter_s),
        tuple(percentiles),
        apart,
        _clearly_better(known, apart),
        float(np.mean(known < 0.0)),
    )


def _clearly_better(known: FloatArray, apart: float) -> DelayFit | None:
    """Another distribution, at most half as far from the packets as the uniform one, which chance does not explain."""
    if apart < max(NOT_UNIFORM, KOLMOGOROV / sqrt(len(known))):
        return None
    found = fit_delays(known)
    return found if found is not None and found.apart <= CLEARLY * apart else None
