"""Charts of a response: distributions by group, the median over a parameter, and a map over two."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, FAINT, INK, SOFT, TEXT_PT, Look
from swarmwire.metrics.pictures.report.axes import (
    LETTERS_PT,
    column_axes,
    fits_log,
    ordered_colors,
    plain_legend,
    room_below_in,
    set_categories,
    set_log,
)
from swarmwire.metrics.text import short, shortened

MAX_POINTS = 40  # of a group, beyond which shapes are drawn
_FEWEST_IN_SHAPE = 10
_HALF_WIDTH = 0.36  # of a group, in groups
_BOX_HALF_WIDTH = 0.11
_GRID = 64  # values at which a density is taken
_GOLDEN = 0.6180339887498949
_APART = 0.012  # of the axis, between the points of several lines
_COLORS = "cividis"  # an ordered scale, also for colour-blind readers and in grey print
_ROW_IN, _MIN_IN, _MAX_IN, _HEAD_IN = 0.2, 1.0, 2.6, 0.42
_NUMBER_LEFT_FROM = 0.8  # of the axis: from there on the number of a change point stands left of its line
_MAX_WRITTEN = 7  # columns and rows of cells into which values are written
_BEYOND, _NONE = "#f1e9f5", "#ffffff"


@dataclass(frozen=True)
class GroupValues:
    """The values of one group, (n,), and their quartiles."""

    label: str
    values: FloatArray  # those that were observed
    censored: float  # share of the runs whose value lies beyond the limit
    quartiles: tuple[float, float, float]  # inf: beyond the limit; NaN: none


def distributions(groups: Sequence[GroupValues], title: str, x_label: str, limit: float | None = None) -> Any:
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


def _runs(group: GroupValues) -> float:
    return len(group.values) / (1.0 - group.censored) if group.censored < 1.0 else 0.0


def _draw_points(axes: Any, place: int, values: FloatArray) -> None:
    aside = (np.arange(1, len(values) + 1) * _GOLDEN) % 1.0 - 0.5  # spread evenly
    axes.plot(place + 1.4 * _HALF_WIDTH * aside, values, ".", ms=4.5, mew=0, color=CURVE, alpha=0.6, zorder=2)


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


def _draw_box(axes: Any, place: int, group: GroupValues, limit: float | None) -> None:
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


def _draw_limit(axes: Any, groups: Sequence[GroupValues], limit: float) -> None:
    axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
    above: Look = {"xytext": (0, 5), "textcoords": "offset points", "ha": "center", "va": "bottom"}
    for place, group in enumerate(groups):
        if group.censored > 0.0:
            axes.plot([place], [limit], "^", ms=4, mfc="white", mec=INK, mew=0.8, zorder=5, clip_on=False)
            share = f"{100.0 * group.censored:.0f} %" if group.censored >= 0.01 else "<1 %"
            axes.annotate(share, (place, limit), fontsize=LETTERS_PT, color=INK, **above)
    if any(group.censored > 0.0 for group in groups):
        axes.margins(y=0.12)


@dataclass(frozen=True)
class Jump:
    """Where the response changes most, and the interval in which that place lies."""

    at: float
    low: float
    high: float


@dataclass(frozen=True)
class MedianLine:
    """Medians over the values of a parameter; arrays (k,), inf where it lies beyond the limit, NaN where none is."""

    label: str
    x: FloatArray  # ascending
    median: FloatArray
    low: FloatArray  # of the median's interval
    high: FloatArray
    q25: FloatArray
    q75: FloatArray
    jump: Jump | None = None


def response_curve(lines: Sequence[MedianLine], title: str, x_label: str, limit: float | None = None) -> Any:
    """The figure; of one line with its quartiles, of several with a legend.

    `limit`: up to where a censored value was followed, None where nothing is censored.
    """
    figure, axes = column_axes(title, x_label)
    alone, log = len(lines) == 1, fits_log(lines[0].x)
    if limit is not None:
        axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
    colors = [CURVE] if alone else ordered_colors(len(lines))
    for place, (line, color) in enumerate(zip(lines, colors, strict=True)):
        x = _aside(line.x, place - 0.5 * (len(lines) - 1), log=log)
        if line.jump is not None and not alone:
            axes.axvline(line.jump.at, color=color, lw=0.9, ls=(place, (3, len(lines))), zorder=1)
        if alone:
            low, high = _within(line.q25, limit), _within(line.q75, limit)
            axes.fill_between(x, low, high, color=color, alpha=0.18, lw=0)
        low, high = _within(line.low, limit), _within(line.high, limit)
        axes.vlines(x, low, high, color=color, lw=1.0, zorder=3)
        _draw_medians(axes, x, line, limit, color)
    if log:
        set_log(axes.xaxis)
    reached = [quartile for line in lines for quartile in (line.q25, line.q75)]
    if fits_log(np.concatenate(reached + ([] if limit is None else [np.array([limit])]))):
        set_log(axes.yaxis)
    if not alone:
        plain_legend(axes, loc="best")
    elif lines[0].jump is not None:
        _draw_jump(axes, lines[0].jump)
    return figure


def _aside(x: FloatArray, places: float, *, log: bool) -> FloatArray:
    """Beside one another, so that none hides another's interval."""
    along = np.log(x) if log else x
    moved: FloatArray = along + _APART * places * np.ptp(along)
    return np.exp(moved) if log else moved


def _within(edge: FloatArray, limit: float | None) -> FloatArray:
    """The edge, clipped to the limit."""
    return np.where(np.isposinf(edge), np.nan if limit is None else limit, edge)


def _draw_medians(axes: Any, x: FloatArray, line: MedianLine, limit: float | None, color: Any) -> None:
    known = np.isfinite(line.median)
    # NaN where the median is censored: the line breaks there.
    medians = np.where(known, line.median, np.nan)
    axes.plot(x, medians, "o-", color=color, lw=1.3, ms=3, zorder=4, label=line.label)
    beyond = np.isposinf(line.median)
    if limit is not None and beyond.any():
        mark: Look = {"ms": 4, "mfc": "white", "mec": INK, "mew": 0.8, "zorder": 5, "clip_on": False, "ls": ""}
        axes.plot(x[beyond], np.full(int(beyond.sum()), limit), "^", **mark)


def _draw_jump(axes: Any, jump: Jump) -> None:
    """Draw it on axes whose limits are known, with its number on the side that has room."""
    axes.axvspan(jump.low, jump.high, color=ACCENT, alpha=0.12, lw=0, zorder=0)
    axes.axvline(jump.at, color=ACCENT, lw=1.0, zorder=1)
    at: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "va": "top", "color": ACCENT}
    low, high = axes.get_xlim()
    at_px, low_px, high_px = axes.transData.transform([(x, axes.get_ylim()[1]) for x in (jump.at, low, high)])[:, 0]
    is_right = at_px > low_px + _NUMBER_LEFT_FROM * (high_px - low_px)
    beside: Look = {"xytext": (-3, 7), "ha": "right"} if is_right else {"xytext": (3, 7), "ha": "left"}
    axes.annotate(f"{jump.at:.3g}", (jump.at, 1.0), fontsize=LETTERS_PT, **beside, **at)


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
    """Each in its row, with its interval above the middle of the row, so that numbers stay readable."""
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
