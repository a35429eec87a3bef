"""Pictures of fits: of a radio to RSSI, and of a network to delivery and latency."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import (
    CURVE,
    FAINT,
    INK,
    LONG_SIDE_IN,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    TITLE_PT,
    Look,
    new_figure,
    plain_axes,
    save,
)
from swarmwire.metrics.real.radio_fit.delay import LatencyFit
from swarmwire.metrics.real.radio_fit.fit import NetworkFit, RadioFit, RangeFit, delivery_over_distance
from swarmwire.metrics.real.radio_fit.losses import LossFit, LossSequences, expected_runs
from swarmwire.metrics.real.radio_fit.path_loss import PathLossFit
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit, correlogram, places_of

RUNS_TITLE = "runs of lost packets by length"
_HEIGHT_IN = 4.6
_DECADE = 10.0  # of the farthest distance over the nearest, from which on the axis is logarithmic
_MAX_POINTS = 4000
_LONGEST_SHARE = 0.999  # of bursts, that the axis reaches to
_BAND = 1.645  # deviations: nine of ten packets
_BINS, _LATENCY_BINS = 30, 60
_LATEST = 0.995  # of the latencies, that the axis reaches to


def draw_radio_fit(fit: RadioFit, title: str, to: Path) -> None:
    """Write the picture. BadInput for a path that cannot be."""
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN)
    figure.text(0.025, 0.955, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    _draw_rssi(plain_axes(figure, (0.08, 0.54, 0.895, 0.34), "RSSI in dBm over distance in m"), fit)
    _draw_correlogram(
        plain_axes(figure, (0.08, 0.08, 0.4, 0.34), "residuals' correlogram in dB² over distance in m"), fit
    )
    draw_bursts(plain_axes(figure, (0.575, 0.08, 0.4, 0.34), RUNS_TITLE), fit.sequences, fit.losses)
    save(figure, to)


def _draw_rssi(axes: Any, fit: RadioFit) -> None:
    distance_m, rssi_dbm = fit.distance_m, fit.rssi_dbm
    if not len(distance_m):
        say(axes, "no packet was received")
        return
    every = max(1, len(distance_m) // _MAX_POINTS)
    if distance_m.max() >= _DECADE * distance_m.min():
        from matplotlib.ticker import LogLocator

        axes.set_xscale("log")
        # Powers of ten alone would leave little more than a decade with a single label.
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    axes.plot(distance_m[::every], rssi_dbm[::every], ".", ms=2.5, mew=0, color=SOFT, alpha=0.4, label="packets")
    if isinstance(fit.path_loss, PathLossFit):
        ends_m = np.exp(np.linspace(math.log(distance_m.min()), math.log(distance_m.max()), 50))
        line = fit.path_loss.rssi_dbm(ends_m)
        band_db = _BAND * _deviation_db(fit, ends_m)
        faint: Look = {"color": CURVE, "alpha": 0.15, "lw": 0}
        axes.fill_between(ends_m, line - band_db, line + band_db, label="9 of 10 by the fit", **faint)
        axes.plot(ends_m, line, color=CURVE, lw=1.4, label=f"exponent {fit.path_loss.exponent.value:.2f}")
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")


def _deviation_db(fit: RadioFit, distance_m: FloatArray) -> FloatArray:
    """Standard deviation of single packets around the line: shadowing, which grows with distance, and noise."""
    if not isinstance(fit.shadowing, ShadowingFit):
        return np.full(len(distance_m), np.sqrt(np.mean(fit.residual_db**2)))
    share = fit.shadowing.correlation_m.value / distance_m
    field = fit.shadowing.deviation_db.value**2 * (1.0 - share * (1.0 - np.exp(-1.0 / share)))
    return np.sqrt(field + fit.shadowing.noise_db.value**2)


def _draw_correlogram(axes: Any, fit: RadioFit) -> None:
    if isinstance(fit.shadowing, str) or isinstance(fit.path_loss, str):
        say(axes, "shadowing was left out")
        return
    found = correlogram(places_of(fit.log), fit.path_loss, fit.shadowing)
    axes.axhline(0.0, color=FAINT, lw=0.7)
    axes.plot(found.apart_m, found.found_db2, "o", ms=3, color=SOFT, label="found")
    axes.plot(found.apart_m, found.fitted_db2, color=CURVE, lw=1.4, label="the fitted field")
    axes.set_xlim(0.0, None)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")


def draw_bursts(axes: Any, sequences: LossSequences, losses: LossFit | str) -> None:
    """How long runs of lost packets are, and how long the fit expects them to be."""
    lengths = sequences.burst_lengths
    if not len(lengths) or isinstance(losses, str):
        say(axes, "too few packets were lost")
        return
    longest = max(int(np.quantile(lengths, _LONGEST_SHARE)), 5)
    counts = np.bincount(np.minimum(lengths, longest + 1), minlength=longest + 2)[1 : longest + 1]
    at = np.arange(1, longest + 1)
    axes.plot(at, np.where(counts > 0, counts, np.nan), "o", ms=3, color=SOFT, label="found")
    single, bursts = losses.loss.value, losses.chosen.bursts
    # Runs of single losses are geometric: counts above their line are bursts.
    axes.plot(at, len(lengths) * (1.0 - single) * single ** (at - 1.0), color=FAINT, lw=1.2, label="single losses")
    if bursts is not None:
        expected = len(lengths) * expected_runs(bursts, sequences.interval_s, longest)
        axes.plot(at, expected, color=CURVE, lw=1.4, label="the fitted bursts")
    axes.set_yscale("log")
    axes.set_ylim(0.5, None)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")


def say(axes: Any, text: str) -> None:
    """A text in place of a drawing."""
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=TEXT_PT, color=SOFT)


def draw_network_fit(fit: NetworkFit, title: str, to: Path) -> None:
    """Write the picture. BadInput for a path that cannot be."""
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN)
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
