"""A network's fit on one sheet: delivery over distance, latencies, and how long bursts are."""

from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.metrics.drawing.canvas import new_figure, save
from swarmwire.metrics.drawing.looks import CURVE, INK, LONG_SIDE_IN, SMALL_PT, SOFT, TITLE_PT
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.drawing.radio_fit_sheet import RUNS_TITLE, draw_bursts, say
from swarmwire.metrics.radio_fit.delay import LatencyFit
from swarmwire.metrics.radio_fit.fit import NetworkFit, RangeFit, delivery_over_distance
from swarmwire.metrics.radio_fit.losses import LossFit

_HEIGHT_IN = 4.6
_BINS, _LATENCY_BINS = 30, 60
_LATEST = 0.995  # of the latencies, that the axis reaches to


def draw_network_fit(fit: NetworkFit, title: str, to: Path, size_px: int) -> None:
    """Write the picture. BadInput for a path or a size that cannot be."""
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN, size_px)
    figure.text(0.025, 0.955, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    _draw_delivery(plain_axes(figure, (0.08, 0.54, 0.895, 0.34), "% of packets received over distance in m"), fit)
    _draw_latency(plain_axes(figure, (0.08, 0.08, 0.4, 0.34), "packets by latency in ms"), fit)
    draw_bursts(plain_axes(figure, (0.575, 0.08, 0.4, 0.34), RUNS_TITLE), fit.sequences, fit.losses)
    save(figure, to)


def _draw_delivery(axes: Any, fit: NetworkFit) -> None:
    if not isinstance(fit.range, RangeFit):
        say(axes, "distances are not known")
        return
    edges_m = np.linspace(0.0, 1.02 * float(np.nanmax(fit.log.distance_m)), _BINS + 1)
    share, sent = delivery_over_distance(fit.log, edges_m)
    middle_m = 0.5 * (edges_m[1:] + edges_m[:-1])
    size = 2.0 + 10.0 * np.sqrt(sent / max(int(sent.max()), 1))
    axes.scatter(middle_m, 100.0 * share, s=size**2 / 4.0, color=SOFT, lw=0, label="found")
    if isinstance(fit.losses, LossFit):
        kept = 100.0 * (1.0 - fit.losses.loss.value)
        range_m = fit.range.range_m.value
        axes.plot([0.0, range_m, range_m, edges_m[-1]], [kept, kept, 0.0, 0.0], color=CURVE, lw=1.4, label="fitted")
    axes.set_ylim(-3.0, 105.0)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="lower left")


def _draw_latency(axes: Any, fit: NetworkFit) -> None:
    if not isinstance(fit.latency, LatencyFit):
        say(axes, "too few latencies are known")
        return
    known_ms = 1e3 * fit.log.packets.latency_s[np.isfinite(fit.log.packets.latency_s)]
    ends_ms = float(known_ms.min()), max(float(np.quantile(known_ms, _LATEST)), float(known_ms.min()) + 1e-3)
    counts, edges_ms = np.histogram(known_ms, np.linspace(*ends_ms, _LATENCY_BINS + 1))
    axes.stairs(counts, edges_ms, fill=True, color=SOFT, alpha=0.5, label="found")
    if fit.latency.delays is not None:
        shares = np.histogram(1e3 * fit.latency.delays.quantiles_s, edges_ms)[0] / len(fit.latency.delays.quantiles_s)
        axes.plot(0.5 * (edges_ms[1:] + edges_ms[:-1]), len(known_ms) * shares, color=CURVE, lw=1.4, label="fitted")
        _finish_latency(axes, counts)
        return
    low_ms, jitter_ms = 1e3 * fit.latency.latency_s.value, 1e3 * fit.latency.jitter_s.value
    if jitter_ms > 0.0:
        high = len(known_ms) * (edges_ms[1] - edges_ms[0]) / jitter_ms
        corners_ms = [low_ms, low_ms, low_ms + jitter_ms, low_ms + jitter_ms]
        axes.plot(corners_ms, [0.0, high, high, 0.0], color=CURVE, lw=1.4, label="fitted")
    _finish_latency(axes, counts)


def _finish_latency(axes: Any, counts: Any) -> None:
    axes.set_ylim(0.0, 1.3 * float(counts.max()))
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")
