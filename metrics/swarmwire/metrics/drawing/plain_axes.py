"""Axes with nothing on them that is not needed: a line below, faint lines across, the title at the left."""

from typing import Any

from swarmwire.metrics.drawing.looks import FAINT, GRID, SMALL_PT, SOFT, TEXT_PT


def plain_axes(figure: Any, place: tuple[float, float, float, float], title: str) -> Any:
    """Axes at left, low, width and height, in shares of the figure."""
    axes = figure.add_axes(place)
    axes.set_facecolor("none")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set(color=FAINT, linewidth=0.7)
    axes.grid(axis="y", color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    axes.set_title(title, loc="left", fontsize=TEXT_PT, color=SOFT, pad=4)
    return axes
