"""Medians over two parameters as colours, with the place in each row where they jump."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import ACCENT, FAINT, INK, SOFT, TEXT_PT, Look
from swarmwire.metrics.report.figures.category_axis import room_below_in, set_categories
from swarmwire.metrics.report.figures.column_axes import LETTERS_PT, column_axes
from swarmwire.metrics.report.figures.response_curve import Jump
from swarmwire.metrics.report.in_words import short, shortened

_COLORS = "cividis"  # as ordered for those who cannot tell red from green, and in print without colours
_ROW_IN, _MIN_IN, _MAX_IN, _HEAD_IN = 0.2, 1.0, 2.6, 0.42
_MAX_WRITTEN = 7  # columns and rows of cells into which values are written
_BEYOND, _NONE = "#f1e9f5", "#ffffff"


def heat_map(
    values: FloatArray,
    x_labels: Sequence[str],
    y_labels: Sequence[str],
    title: str,
    x_label: str,
    y_label: str,
    jumps: Sequence[Jump | None] = (),
) -> Any:
    """The figure of medians (rows, columns), the first row at the bottom; inf: beyond the limit, NaN: none.

    Jumps are one per row, in columns: 1.5 lies midway between the second and the third.
    """
    import matplotlib as mpl
    from matplotlib.colors import Normalize

    rows = len(y_labels)
    foot_in = room_below_in(x_labels)
    height_in = _HEAD_IN + foot_in + float(np.clip(rows * _ROW_IN, _MIN_IN, _MAX_IN))
    figure, axes = column_axes(title, x_label, height_in, right_in=0.55, foot_in=foot_in, head_in=_HEAD_IN)
    known = values[np.isfinite(values)]
    least, greatest = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    norm = Normalize(least, greatest)
    axes.grid(visible=False)
    axes.spines["bottom"].set_visible(False)
    colors = mpl.colormaps[_COLORS].with_extremes(over=_BEYOND, bad=_NONE)
    shown = np.ma.masked_invalid(np.where(np.isposinf(values), greatest + 1.0 + abs(greatest), values))
    edges = np.arange(len(x_labels) + 1) - 0.5, np.arange(rows + 1) - 0.5
    axes.pcolormesh(*edges, shown, cmap=colors, norm=norm, edgecolors="white", linewidth=0.4)
    written = max(len(x_labels), rows) <= _MAX_WRITTEN
    if written:
        _write_values(axes, values, norm)
    else:
        _mark_beyond(axes, values)
    _draw_jumps(axes, jumps, 0.38 if written else 0.0)
    set_categories(axes, x_labels)
    axes.set_xlim(-0.5, len(x_labels) - 0.5)
    every = max(1, -(-rows // 12))
    axes.set_yticks(range(0, rows, every), [shortened(label, 7) for label in y_labels[::every]])
    axes.set_ylim(-0.5, rows - 0.5)
    axes.set_title(y_label, loc="left", fontsize=TEXT_PT, color=SOFT, pad=2, x=-0.12)
    _draw_bar(figure, axes, colors, norm)
    return figure


def _write_values(axes: Any, values: FloatArray, norm: Any) -> None:
    middle: Look = {"ha": "center", "va": "center", "fontsize": LETTERS_PT - 1.0}
    for (row, column), value in np.ndenumerate(values):
        if np.isnan(value):
            continue
        light = not np.isfinite(value) or norm(value) > 0.55
        axes.text(
            column,
            row,
            short(float(f"{value:.3g}")) if np.isfinite(value) else ">",
            color=INK if light else "white",
            **middle,
        )


def _mark_beyond(axes: Any, values: FloatArray) -> None:
    for row, column in np.argwhere(np.isposinf(values)).tolist():
        axes.text(column, row, ">", color=INK, ha="center", va="center", fontsize=LETTERS_PT)


def _draw_jumps(axes: Any, jumps: Sequence[Jump | None], above: float) -> None:
    """Each in its row, with its interval so much above the row's middle, where it hides no number."""
    outlined: Look = {"zorder": 5, "solid_capstyle": "butt"}
    for row, jump in enumerate(jumps):
        if jump is None:
            continue
        axes.plot([jump.low, jump.high], [row + above] * 2, color="white", lw=2.6, **outlined)
        axes.plot([jump.low, jump.high], [row + above] * 2, color=INK, lw=1.0, **outlined)
        axes.plot([jump.at] * 2, [row - 0.5, row + 0.5], color="white", lw=3.4, **outlined)
        axes.plot([jump.at] * 2, [row - 0.5, row + 0.5], color=ACCENT, lw=1.8, zorder=6, solid_capstyle="butt")


def _draw_bar(figure: Any, axes: Any, colors: Any, norm: Any) -> None:
    from matplotlib.cm import ScalarMappable

    at = axes.get_position()
    beside = figure.add_axes((at.x1 + 0.02, at.y0, 0.03, at.height))
    bar = figure.colorbar(ScalarMappable(norm, colors), cax=beside)
    bar.outline.set(edgecolor=FAINT, linewidth=0.5)
    beside.tick_params(labelsize=LETTERS_PT, labelcolor=INK, length=0, pad=2)
    beside.locator_params(nbins=5)
    beside.yaxis.set_major_formatter(short)
