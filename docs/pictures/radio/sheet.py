"""What the figures of the radio share: a row of panels in the pictures' colours, and where they are written."""

from pathlib import Path
from typing import Any

from swarmwire.metrics.pictures.drawing.canvas import (
    FAINT,
    GRID,
    INK,
    LONG_SIDE_IN,
    SOFT,
    new_figure,
    rgb,
    robot_color,
    save,
)

FOLDER = Path(__file__).parents[2] / "radio"
SIZE_PX = 1280
TEXT_PT, SMALL_PT = 8.0, 7.0
DARKER = 0.82  # the palette is made for areas: lines on white are drawn darker


def panels(count: int, height_in: float, widths: tuple[float, ...] | None = None) -> tuple[Any, list[Any]]:
    """A figure and its panels, side by side."""
    figure = new_figure(LONG_SIDE_IN, height_in, SIZE_PX)
    figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.05, wspace=0.04)
    row = figure.subplots(1, count, squeeze=False, width_ratios=widths)[0]
    for axes in row:
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["bottom", "left"]].set(color=FAINT, linewidth=0.7)
        axes.grid(color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(which="both", labelsize=SMALL_PT, colors=SOFT, length=0, pad=3)
    return figure, list(row)


def set_labels(axes: Any, title: str, x: str, y: str) -> None:
    """The panel's title and the quantities on its axes, with their units."""
    axes.set_title(title, loc="left", fontsize=TEXT_PT, color=INK, pad=6)
    axes.set_xlabel(x, fontsize=SMALL_PT, color=SOFT)
    axes.set_ylabel(y, fontsize=SMALL_PT, color=SOFT)


def legend(axes: Any, corner: str = "best", **more: Any) -> None:
    """The panel's legend, without a frame."""
    axes.legend(fontsize=SMALL_PT, labelcolor=SOFT, loc=corner, frameon=False, handlelength=1.6, **more)


def legend_below(figure: Any, axes: Any, columns: int) -> None:
    """One panel's legend under all of them."""
    look = {"fontsize": SMALL_PT, "labelcolor": SOFT, "frameon": False, "handlelength": 1.6}
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns, **look)


def scale(figure: Any, image: Any, axes: Any, title: str, location: str = "right") -> None:
    """The colours of a map."""
    bar = figure.colorbar(image, ax=axes, shrink=0.9, pad=0.02, location=location)
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0)
    bar.set_label(title, fontsize=SMALL_PT, color=SOFT)


def line_color(index: int) -> tuple[float, float, float]:
    """The colour of a line, from the palette of robots."""
    red, green, blue = rgb(robot_color(index))
    return red * DARKER, green * DARKER, blue * DARKER


def write(figure: Any, name: str) -> None:
    """Save it among the pages."""
    FOLDER.mkdir(exist_ok=True)
    save(figure, FOLDER / f"{name}.svg")
