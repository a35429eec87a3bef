"""Fading: power along a robot's way, its distribution over many pairs, and how soon it changes."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from scipy import special, stats

from docs.pictures.radio.sheet import legend, legend_below, line_color, panels, set_labels, write
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key, uniform
from swarmwire.comms.radio.config.phy import Fading
from swarmwire.comms.radio.propagation.decibels import to_db
from swarmwire.comms.radio.propagation.fading import fading_gain, fading_model, scattered_between
from swarmwire.metrics.pictures.drawing.canvas import INK

FREQUENCY_HZ = 2.44e9
KEY = np.uint64(derive_key("figure of fading"))
K, M = 4.0, 2.0
KINDS = {
    "Rayleigh": (Fading("rayleigh"), stats.expon()),
    f"Rician, K = {K:g}": (Fading("rician", k=K), stats.ncx2(2, 2.0 * K, scale=0.5 / (K + 1.0))),
    f"Nakagami, m = {M:g}": (Fading("nakagami", m=M), stats.gamma(M, scale=1.0 / M)),
}
WAY_M = np.linspace(0.0, 1.0, 301)
PAIRS, LAG_PAIRS = 20_000, 3000
LAGS = np.linspace(0.0, 2.0, 26)  # wavelengths


def draw() -> None:
    """Write fading.svg."""
    figure, (way, shares, lags) = panels(3, 2.75, (1.25, 1.0, 1.0))
    positions = 50.0 * uniform(int(KEY), np.arange(PAIRS)[:, None], np.arange(4), 0, 0)
    for index, (label, (fading, theory)) in enumerate(KINDS.items()):
        law = fading_model(fading, FREQUENCY_HZ)
        along = [to_db(fading_gain(law, KEY, 0, 1, 3.0, 4.0, x, 0.0)) for x in WAY_M]
        way.plot(WAY_M, along, color=line_color(index), lw=1.1, label=label)
        gains = np.sort([fading_gain(law, KEY, 0, pair + 1, *position) for pair, position in enumerate(positions)])
        below = (np.arange(PAIRS) + 0.5) / PAIRS
        every = np.unique(np.geomspace(20, PAIRS, 20).astype(int)) - 1
        shares.plot([to_db(g) for g in gains[every]], below[every], "o", ms=3, color=line_color(index))
        fine_db = np.linspace(-32.0, 8.0, 80)
        shares.plot(fine_db, theory.cdf(10.0 ** (fine_db / 10.0)), color=line_color(index), lw=1.2)
    set_labels(way, "power along 1 m of a robot's way", "way in m", "power in dB over the mean")
    shares.set_yscale("log")
    shares.set_xlim(-32.0, 10.0)
    shares.set_ylim(1e-3, 1.3)
    set_labels(shares, "its distribution", "power in dB over the mean", "share below (lines: theory)")
    fine = np.linspace(0.0, LAGS[-1], 120)
    lags.axhline(0.0, color=INK, lw=0.6)
    lags.plot(fine, special.j0(2.0 * np.pi * fine), color=line_color(0), lw=1.4, label="J₀(2π s / λ)")
    lags.plot(LAGS, correlation(), "o", ms=3, color=line_color(1), label=f"{LAG_PAIRS} pairs")
    set_labels(lags, "its autocorrelation", "way s in wavelengths", "correlation of amplitudes")
    legend(lags, "upper right")
    legend_below(figure, way, len(KINDS))
    write(figure, "fading")


def correlation() -> list[float]:
    """The mean of h(s) h*(0) over pairs, one end moved, relative to that of |h(0)|^2."""
    per_m = FREQUENCY_HZ / 299_792_458.0
    h = np.array([amplitudes(per_m, lag / per_m) for lag in LAGS])
    return [float(np.mean((row * h[0].conj()).real) / np.mean(abs(h[0]) ** 2)) for row in h]


def amplitudes(per_m: float, moved_m: float) -> FloatArray:
    """The amplitude h of each pair, (LAG_PAIRS,) complex."""
    position = 1.0, 2.0, 30.0 + moved_m, -7.0
    return np.array([complex(*scattered_between(KEY, per_m, 0, 1 + k, *position)) for k in range(LAG_PAIRS)])
