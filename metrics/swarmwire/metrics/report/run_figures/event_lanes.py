"""Lanes of events over time: a bar for what ended, a mark for what did not."""

from collections.abc import Sequence
from typing import Any

from swarmwire.metrics.drawing.looks import ACCENT, GRID, INK, SMALL_PT
from swarmwire.metrics.report.lanes import Lane

LANE_IN = 0.29  # height of each
_BAR = (0.12, 0.3)  # low and high, in shares of a lane


def draw_lanes(axes: Any, lanes: Sequence[Lane], ends_s: tuple[float, float]) -> None:
    """Draw them on axes, the first on top, from the first to the last second."""
    axes.set_axis_off()
    axes.set(xlim=ends_s, ylim=(0.0, len(lanes)))
    low, high = _BAR
    for row, lane in enumerate(lanes):
        foot = len(lanes) - 1 - row
        title = lane.title.replace("_", " ")
        axes.text(ends_s[0], foot + 0.44, title, fontsize=SMALL_PT, color=INK, va="bottom")
        axes.hlines(foot + 0.5 * (low + high), *ends_s, color=GRID, lw=0.8, zorder=1)
        ended = [(span.from_s, min(span.until_s, ends_s[1]) - span.from_s) for span in lane.spans if span.until_s]
        axes.broken_barh(ended, (foot + low, high - low), facecolors=ACCENT, alpha=0.55, linewidth=0, zorder=2)
        lasting = [span.from_s for span in lane.spans if span.until_s is None]
        axes.plot(
            lasting, [foot + 0.5 * (low + high)] * len(lasting), marker="D", ms=3.0, mew=0, ls="none", color=ACCENT
        )
