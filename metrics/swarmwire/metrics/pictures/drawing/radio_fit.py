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
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit, correlogram, location_means

RUNS_TITLE = "runs of lost packets by length"
_HEIGHT_IN = 4.6
_DECADE = 10.0  # ratio of the farthest to the nearest distance above which the axis is logarithmic
_MAX_POINTS = 4000
_LAST_LENGTH_SHARE = 0.999  # quantile of lengths of bursts at the end of the axis
_BAND = 1.645  # standard deviations that cover nine of ten packets
_BINS, _LATENCY_BINS = 30, 60
_LAST_LATENCY_SHARE = 0.995  # quantile of latencies at the end of the axis


def draw_radio_fit(fit: RadioFit, title: str, to: Path) -> None:
    """Write the picture. BadInput for a path that cannot be written."""
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
        write_note(axes, "no packet was received")
        return
    step = max(1, len(distance_m) // _MAX_POINTS)
    if distance_m.max() >= _DECADE * distance_m.min():
        from matplotlib.ticker import LogLocator

        axes.set_xscale("log")
        # Powers of ten alone would leave little more than a decade with a single label.
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    axes.plot(distance_m[::step], rssi_dbm[::step], ".", ms=2.5, mew=0, color=SOFT, alpha=0.4, label="packets")
    if isinstance(fit.path_loss, PathLossFit):
        ends_m = np.exp(np.linspace(math.log(distance_m.min()), math.log(distance_m.max()), 50))
        line = fit.path_loss.rssi_dbm(ends_m)
        band_db = _BAND * _deviation_db(fit, ends_m)
        faint: Look = {"color": CURVE, "alpha": 0.15, "lw": 0}
        axes.fill_between(ends_m, line - band_db, line + band_db, label="9 of 10 by the fit", **faint)
        axes.plot(ends_m, line, color=CURVE, lw=1.4, label=f"exponent {fit.path_loss.exponent.value:.2f}")
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")


def _deviation_db(fit: RadioFit, distance_m: FloatArray) -> FloatArray:
    """Return the standard deviation of packets around the line: shadowing, which grows with distance, and noise."""
    if not isinstance(fit.shadowing, ShadowingFit):
        return np.full(len(distance_m), np.sqrt(np.mean(fit.residual_db**2)))
    share = fit.shadowing.correlation_m.value / distance_m
    field = fit.shadowing.deviation_db.value**2 * (1.0 - share * (1.0 - np.exp(-1.0 / share)))
    return np.sqrt(field + fit.shadowing.noise_db.value**2)


def _draw_correlogram(axes: Any, fit: RadioFit) -> None:
    if isinstance(fit.shadowing, str) or isinstance(fit.path_loss, str):
        write_note(axes, "shadowing was left out")
        return
    bins = correlogram(location_means(fit.log), fit.path_loss, fit.shadowing)
    axes.axhline(0.0, color=FAINT, lw=0.7)
    axes.plot(bins.separation_m, bins.measured_db2, "o", ms=3, color=SOFT, label="measured")
    axes.plot(bins.separation_m, bins.fitted_db2, color=CURVE, lw=1.4, label="fitted")
    axes.set_xlim(0.0, None)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")


def draw_bursts(axes: Any, sequences: LossSequences, losses: LossFit | str) -> None:
    """Draw the lengths of runs of lost packets, and those that the fit expects."""
    lengths = sequences.burst_lengths
    if not len(lengths) or isinstance(losses, str):
        write_note(axes, "too few packets were lost")
        return
    longest = max(int(np.quantile(lengths, _LAST_LENGTH_SHARE)), 5)
    counts = np.bincount(np.minimum(lengths, longest + 1), minlength=longest + 2)[1 : longest + 1]
    length = np.arange(1, longest + 1)
    axes.plot(length, np.where(counts > 0, counts, np.nan), "o", ms=3, color=SOFT, label="measured")
    single, bursts = losses.loss.value, losses.chosen.bursts
    # Runs of single losses are geometric: counts above their line are bursts.
    geometric = len(lengths) * (1.0 - single) * single ** (length - 1.0)
    axes.plot(length, geometric, color=FAINT, lw=1.2, label="single losses")
    if bursts is not None:
        expected = len(lengths) * expected_runs(bursts, sequences.interval_s, longest)
        axes.plot(length, expected, color=CURVE, lw=1.4, label="fitted bursts")
    axes.set_yscale("log")
    axes.set_ylim(0.5, None)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")


def write_note(axes: Any, text: str) -> None:
    """Write a text in place of a drawing."""
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=TEXT_PT, color=SOFT)


def draw_network_fit(fit: NetworkFit, title: str, to: Path) -> None:
    """Write the picture. BadInput for a path that cannot be written."""
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN)
    figure.text(0.025, 0.955, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    _draw_delivery(plain_axes(figure, (0.08, 0.54, 0.895, 0.34), "% of packets received over distance in m"), fit)
    _draw_latency(plain_axes(figure, (0.08, 0.08, 0.4, 0.34), "packets by latency in ms"), fit)
    draw_bursts(plain_axes(figure, (0.575, 0.08, 0.4, 0.34), RUNS_TITLE), fit.sequences, fit.losses)
    save(figure, to)


def _draw_delivery(axes: Any, fit: NetworkFit) -> None:
    if not isinstance(fit.range, RangeFit):
        write_note(axes, "distances are unknown")
        return
    edges_m = np.linspace(0.0, 1.02 * float(np.nanmax(fit.log.distance_m)), _BINS + 1)
    share, sent = delivery_over_distance(fit.log, edges_m)
    middle_m = 0.5 * (edges_m[1:] + edges_m[:-1])
    size = 2.0 + 10.0 * np.sqrt(sent / max(int(sent.max()), 1))
    axes.scatter(middle_m, 100.0 * share, s=size**2 / 4.0, color=SOFT, lw=0, label="measured")
    if isinstance(fit.losses, LossFit):
        received = 100.0 * (1.0 - fit.losses.loss.value)
        range_m = fit.range.range_m.value
        levels = [received, received, 0.0, 0.0]
        axes.plot([0.0, range_m, range_m, edges_m[-1]], levels, color=CURVE, lw=1.4, label="fitted")
    axes.set_ylim(-3.0, 105.0)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="lower left")


def _draw_latency(axes: Any, fit: NetworkFit) -> None:
    if not isinstance(fit.latency, LatencyFit):
        write_note(axes, "too few latencies are known")
        return
    latency_ms = 1e3 * fit.log.packets.latency_s[np.isfinite(fit.log.packets.latency_s)]
    ends_ms = (
        float(latency_ms.min()),
        max(float(np.quantile(latency_ms, _LAST_LATENCY_SHARE)), float(latency_ms.min()) + 1e-3),
    )
    counts, edges_ms = np.histogram(latency_ms, np.linspace(*ends_ms, _LATENCY_BINS + 1))
    axes.stairs(counts, edges_ms, fill=True, color=SOFT, alpha=0.5, label="measured")
    if fit.latency.delays is not None:
        shares = np.histogram(1e3 * fit.latency.delays.quantiles_s, edges_ms)[0] / len(fit.latency.delays.quantiles_s)
        axes.plot(0.5 * (edges_ms[1:] + edges_ms[:-1]), len(latency_ms) * shares, color=CURVE, lw=1.4, label="fitted")
        _finish_latency(axes, counts)
        return
    low_ms, jitter_ms = 1e3 * fit.latency.latency_s.value, 1e3 * fit.latency.jitter_s.value
    if jitter_ms > 0.0:
        high = len(latency_ms) * (edges_ms[1] - edges_ms[0]) / jitter_ms
        corners_ms = [low_ms, low_ms, low_ms + jitter_ms, low_ms + jitter_ms]
        axes.plot(corners_ms, [0.0, high, high, 0.0], color=CURVE, lw=1.4, label="fitted")
    _finish_latency(axes, counts)


def _finish_latency(axes: Any, counts: Any) -> None:
    axes.set_ylim(0.0, 1.3 * float(counts.max()))
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="upper right")
