"""Delays: how four distributions of equal mean and deviation are spread, and how long their tails are."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from docs.pictures.radio.sheet import legend, line_color, panels, set_labels, write
from swarmwire.comms.radio.config.impairments import DISTRIBUTIONS, Delays
from swarmwire.comms.radio.stages.delays import delay_distribution, varying_delay_ns

MEAN_S, DEVIATION_S = 0.02, 0.008
DRAWS = (np.arange(40_000) + 0.5) / 40_000  # evenly, so that the picture shows the law and not its draws
TAIL = np.geomspace(1e-5, 1.0, 120)
BINS_MS = np.linspace(0.0, 60.0, 61)


def draw() -> None:
    """Write delays.svg."""
    figure, (spread, tails) = panels(2, 2.6)
    for index, distribution in enumerate(DISTRIBUTIONS):
        law = delay_distribution(Delays(distribution, MEAN_S, DEVIATION_S))
        delay_ms = 1e-6 * np.array([varying_delay_ns(law, u) for u in DRAWS])
        share, _ = np.histogram(delay_ms, BINS_MS)
        spread.stairs(share / len(DRAWS), BINS_MS, color=line_color(index), lw=1.3, label=distribution)
        late_ms = 1e-6 * np.array([varying_delay_ns(law, 1.0 - above) for above in TAIL])
        tails.plot(late_ms, TAIL, color=line_color(index), lw=1.4)
    set_labels(spread, "mean 20 ms, standard deviation 8 ms", "delay in ms", "share in each ms")
    legend(spread, "upper right")
    tails.set_yscale("log")
    tails.set_xlim(0.0, 250.0)
    set_labels(tails, "how many are later than that", "delay in ms", "share of packets")
    write(figure, "delays")
