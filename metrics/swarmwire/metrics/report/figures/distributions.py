"""How values are distributed in each group: every value of few, the shape of many, and the quartiles over them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import CURVE, INK, SOFT, Look
from swarmwire.metrics.report.figures.category_axis import room_below_in, set_categories
from swarmwire.metrics.report.figures.column_axes import LETTERS_PT, column_axes
from swarmwire.metrics.report.figures.log_axis import fits_log, set_log

MAX_POINTS = 40  # of a group, beyond which shapes are drawn
_FEWEST_IN_SHAPE = 10
_HALF_WIDTH = 0.36  # of a group, in groups
_BOX_HALF_WIDTH = 0.11
_GRID = 64  # values at which a density is taken
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Group:
    """The values of one group, (n,), and what they come to."""

    label: str
    values: FloatArray  # those that were observed
    censored: float  # share of the runs whose value lies beyond the limit
    quartiles: tuple[float, float, float]  # inf: beyond the limit; NaN: none


def distributions(groups: Sequence[Group], title: str, x_label: str, limit: float | None = None) -> Any:
    """The figure of at least one group. `limit`: up to where censored values were followed, None if nothing is."""
    labels = [group.label for group in groups]
    figure, axes = column_axes(title, x_label, foot_in=room_below_in(labels))
    everything = np.concatenate([group.values for group in groups])
    log = fits_log(everything if limit is None else np.append(everything, limit))
    shapes = max(map(_runs, groups)) > MAX_POINTS
    for place, group in enumerate(groups):
        if shapes and len(group.values) >= _FEWEST_IN_SHAPE:
            _draw_shape(axes, place, group.values, log)
        else:
            _draw_points(axes, place, group.values)
        _draw_box(axes, place, group, limit)
    if limit is not None:
        _draw_limit(axes, groups, limit)
    if log:
        set_log(axes.yaxis)
    set_categories(axes, labels)
    return figure


def _runs(group: Group) -> float:
    return len(group.values) / (1.0 - group.censored) if group.censored < 1.0 else 0.0


def _draw_points(axes: Any, place: int, values: FloatArray) -> None:
    aside = (np.arange(1, len(values) + 1) * _GOLDEN) % 1.0 - 0.5  # spread evenly, whatever the number
    axes.plot(place + 1.4 * _HALF_WIDTH * aside, values, ".", ms=3.2, mew=0, color=CURVE, alpha=0.35, zorder=2)


def _draw_shape(axes: Any, place: int, values: FloatArray, log: bool) -> None:
    """The density by a Gaussian kernel, cut off at the least and the greatest value."""
    scaled: FloatArray = np.log(values) if log else values
    spread = min(float(np.std(scaled)), float(np.subtract(*np.quantile(scaled, (0.75, 0.25)))) / 1.34)
    if spread <= 0.0:
        spread = float(np.std(scaled))
    if spread <= 0.0:
        return
    width = 0.9 * spread * len(scaled) ** -0.2  # Silverman's rule of thumb
    grid: FloatArray = np.linspace(float(scaled.min()), float(scaled.max()), _GRID)
    density = np.exp(-0.5 * ((grid[:, None] - scaled) / width) ** 2).sum(axis=1)
    half = _HALF_WIDTH * density / density.max()
    shown: FloatArray = np.exp(grid) if log else grid
    axes.fill_betweenx(shown, place - half, place + half, color=CURVE, alpha=0.25, lw=0, zorder=2)


def _draw_box(axes: Any, place: int, group: Group, limit: float | None) -> None:
    low, middle, high = group.quartiles
    if np.isnan(low) or (np.isinf(low) and limit is None):
        return
    top = high if np.isfinite(high) else limit
    if np.isfinite(low) and top is not None:
        left, right = place - _BOX_HALF_WIDTH, place + _BOX_HALF_WIDTH
        outline: Look = {"color": INK, "lw": 0.8, "zorder": 3, "solid_capstyle": "butt"}
        sides = [right, right, left, left] if np.isfinite(high) else [left, left, np.nan, right, right]
        ends = [low, top, top, low] if np.isfinite(high) else [top, low, np.nan, low, top]
        axes.plot([left, *sides, right], [low, *ends, low], **outline)
        if not np.isfinite(high):  # open at the top: the quartile lies beyond
            axes.plot([left, right], [low, low], **outline)
    if np.isfinite(middle):
        wide = 1.6 * _BOX_HALF_WIDTH
        axes.plot([place - wide, place + wide], [middle] * 2, color=INK, lw=2.0, zorder=4, solid_capstyle="butt")


def _draw_limit(axes: Any, groups: Sequence[Group], limit: float) -> None:
    axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
    above: Look = {"xytext": (0, 5), "textcoords": "offset points", "ha": "center", "va": "bottom"}
    for place, group in enumerate(groups):
        if group.censored > 0.0:
            axes.plot([place], [limit], "^", ms=4, mfc="white", mec=INK, mew=0.8, zorder=5, clip_on=False)
            share = f"{100.0 * group.censored:.0f} %" if group.censored >= 0.01 else "<1 %"
            axes.annotate(share, (place, limit), fontsize=LETTERS_PT, color=INK, **above)
    if any(group.censored > 0.0 for group in groups):
        axes.margins(y=0.12)
