"""How late packets were: histograms of both latencies on one axis, with p50, p90 and p99."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import CURVE, INK, LINK, SMALL_PT, SOFT
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.network.radio_tally import PERCENTS
from swarmwire.metrics.report.in_words import number
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

_BINS = 48
_WIDE = 30.0  # of the latest over the earliest, from which on the axis is logarithmic
_LATEST = 99.9  # percent: where the axis ends, since a single packet may be very late
_HEIGHT_IN = 2.75
_DASHES = ((0, ()), (0, (4, 2)), (0, (1.2, 1.6)))


def latency_histogram(air_s: FloatArray, agent_s: FloatArray) -> Any:
    """The figure of latencies on air (k,) and to the agent (k,), one at least."""
    figure = blank_figure(COLUMN_IN, _HEIGHT_IN)
    edges_ms = _edges(1e3 * np.concatenate([air_s, agent_s]))
    _draw(figure, 0.575, "on air", 1e3 * air_s, edges_ms, CURVE).tick_params(labelbottom=False)
    lower = _draw(figure, 0.14, "to the agent", 1e3 * agent_s, edges_ms, LINK)
    lower.set_xlabel("from sending in ms", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    return figure


def _draw(figure: Any, foot: float, name: str, latency_ms: FloatArray, edges_ms: FloatArray, color: str) -> Any:
    late_ms = percentiles(latency_ms)
    told = ", ".join(f"p{p:g} {number(ms)}" for p, ms in zip(PERCENTS, late_ms, strict=True))
    axes = plain_axes(figure, (0.11, foot, 0.86, 0.325), f"{name}: {told} ms")
    counts = np.histogram(np.clip(latency_ms, edges_ms[0], edges_ms[-1]), edges_ms)[0]
    axes.stairs(100.0 * counts / len(latency_ms), edges_ms, fill=True, color=color, alpha=0.75)
    if edges_ms[0] > 0.0:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    axes.set_xlim(edges_ms[0], edges_ms[-1])
    for ms, dashes in zip(late_ms, _DASHES, strict=True):
        axes.axvline(ms, color=INK, lw=0.8, ls=dashes)
    axes.locator_params(axis="y", nbins=3)
    axes.set_ylabel("% of receivers", fontsize=SMALL_PT, color=SOFT, labelpad=1)
    return axes


def percentiles(latency: FloatArray) -> list[float]:
    """p50, p90 and p99 by the nearest rank, as the summary has them."""
    return np.percentile(latency, PERCENTS, method="inverted_cdf").tolist()


def _edges(latency_ms: FloatArray) -> FloatArray:
    """Edges of the bins: of equal widths from 0 on, or of equal ratios if latencies differ by much."""
    low, high = float(latency_ms.min()), float(np.percentile(latency_ms, _LATEST))
    if low > 0.0 and high > _WIDE * low:
        return np.geomspace(low, high, _BINS + 1)
    return np.linspace(0.0, max(1.05 * high, 1e-3), _BINS + 1)
