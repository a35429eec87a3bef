"""What all pictures share: colours, sizes of letters, plain axes and columns of short facts."""

from collections.abc import Sequence
from typing import Any

from swarmwire.metrics.palette import Color

Look = dict[str, Any]  # matplotlib's keyword arguments for colours, widths and the like

LONG_SIDE_IN = 6.4  # pictures are laid out in inches for this long side; pixels only scale them
TITLE_PT, TEXT_PT, SMALL_PT = 9.5, 7.5, 6.5

INK, SOFT, FAINT, GRID = "#20242b", "#69707d", "#b9bfc9", "#e6e9ee"
PAPER, FLOOR = "#ffffff", "#f4f6f9"  # so far apart that a GIF's palette keeps both
WALL, OBSTACLE, OBSTACLE_EDGE = "#5c6370", "#d3d8df", "#8f97a3"
MOVABLE, MOVABLE_EDGE = "#ead9bd", "#94743c"  # obstacles that robots push
LIGHT, LIGHT_EDGE = "#ffd23f", "#c98f00"
LINK = "#7d8aa5"
MOVABLE_DASHES = (0, (2.5, 1.5))
DEAD: Color = (176, 180, 188)
CURVE = "#2f6fae"
ACCENT = "#c2502e"  # highlights; distinct from the curves' blue also for colour-blind readers
STATE_COLORS: tuple[Color, ...] = (
    (76, 120, 168),
    (245, 133, 24),
    (84, 162, 75),
    (228, 87, 86),
    (178, 121, 162),
    (238, 202, 59),
    (114, 183, 178),
    (157, 117, 93),
)
OTHER_STATE: Color = (205, 208, 214)  # of robots in none of the states that have a colour

_SHADE = 0.58  # how dark a colour's outline is beside it
ROW_IN = 0.185


def rgb(color: Color) -> tuple[float, float, float]:
    """A colour as matplotlib has it, 0 to 1."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255


def shade(color: Color) -> tuple[float, float, float]:
    """The darker colour of the same hue, for outlines and thin lines on light ground."""
    red, green, blue = rgb(color)
    return red * _SHADE, green * _SHADE, blue * _SHADE


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


def add_facts(
    figure: Any, facts: Sequence[tuple[str, str]], left: float, top: float, height_in: float, across: float
) -> float:
    """Write name and value in rows from these shares of the figure down; returns the share below the last row.

    `across` is the share of the figure's width from a name to its value; a fact without a name goes on with the one
    above it.
    """
    step = ROW_IN / height_in
    for name, value in facts:
        figure.text(left, top, name, fontsize=TEXT_PT, color=SOFT, va="top")
        figure.text(left + across, top, value, fontsize=TEXT_PT, color=INK, va="top")
        top -= step
    return top
