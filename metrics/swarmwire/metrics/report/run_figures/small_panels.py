"""Many metrics over time, small, side by side in two columns."""

from collections.abc import Sequence
from typing import Any

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import SMALL_PT, SOFT
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.report.run_figures.timeline import Curve, draw_curve
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

MAX_PANELS = 24
_COLUMNS = 2
_TITLE_IN, _PANEL_IN, _TICKS_IN, _FOOT_IN = 0.26, 0.5, 0.2, 0.14
_LEFT_IN, _APART_IN, _RIGHT_IN = 0.38, 0.42, 0.08


def small_panels(time_s: FloatArray, curves: Sequence[Curve]) -> Any:
    """The figure of these curves over `time_s` (T,); of more than `MAX_PANELS` the first."""
    shown = list(curves)[:MAX_PANELS]
    rows = -(-len(shown) // _COLUMNS)
    row_in = _TITLE_IN + _PANEL_IN + _TICKS_IN
    height_in = rows * row_in + _FOOT_IN
    figure = blank_figure(COLUMN_IN, height_in)
    wide_in = (COLUMN_IN - _LEFT_IN - _RIGHT_IN - (_COLUMNS - 1) * _APART_IN) / _COLUMNS
    ends_s = float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1e-9)
    for place, curve in enumerate(shown):
        row, column = divmod(place, _COLUMNS)
        left_in = _LEFT_IN + column * (wide_in + _APART_IN)
        low_in = height_in - row * row_in - _TITLE_IN - _PANEL_IN
        box = left_in / COLUMN_IN, low_in / height_in, wide_in / COLUMN_IN, _PANEL_IN / height_in
        axes = plain_axes(figure, box, curve.title)
        draw_curve(axes, time_s, curve)
        axes.set_xlim(*ends_s)
        axes.locator_params(axis="x", nbins=4)
        if place + _COLUMNS >= len(shown):
            axes.set_xlabel("time in s", fontsize=SMALL_PT, color=SOFT, labelpad=1)
    return figure
