"""How delivery ratios are spread over links, of swarms with too many links for a matrix."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import CURVE, INK, SMALL_PT, SOFT
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.report.in_words import short
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

_BINS = 25


def link_histogram(link_pdr: FloatArray) -> Any:
    """The figure of how many links have which ratio, of ratios (k,)."""
    figure = blank_figure(COLUMN_IN, 2.0)
    axes = plain_axes(figure, (0.13, 0.21, 0.84, 0.65), "links by the share of their packets that was received")
    counts, edges = np.histogram(link_pdr, np.linspace(0.0, 1.0, _BINS + 1))
    axes.stairs(counts, edges, fill=True, color=CURVE, alpha=0.75)
    axes.axvline(float(np.median(link_pdr)), color=INK, lw=0.8, ls=(0, (4, 2)))
    axes.set_xlim(0.0, 1.0)
    axes.locator_params(axis="y", nbins=4, integer=True)
    axes.yaxis.set_major_formatter(short)
    axes.set_xlabel("share received of the packets in range", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    axes.set_ylabel("links (sender to receiver)", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    return figure
