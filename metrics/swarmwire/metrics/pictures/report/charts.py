"""Charts of a response: distributions by group, the median over a parameter, and a map over two."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy import stats

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

MAX_POINTS = 40  # larger groups are drawn as densities
_MIN_DENSITY_POINTS = 10
_HALF_WIDTH = 0.36  # half the width of a group, relative to the distance of groups
_BOX_HALF_WIDTH = 0.11
_GRID = 64  # values at which a density is computed
_GOLDEN = 0.6180339887498949
_LINE_OFFSET = 0.012  # offset between the points of several lines, as a share of the axis
_COLORS = "cividis"  # an ordered scale, also for colour-blind readers and in grey print
_ROW_IN, _MIN_IN, _MAX_IN, _HEAD_IN = 0.2, 1.0, 2.6, 0.42
_LABEL_LEFT_FROM = 0.8  # beyond this share of the axis, the label of a change point is left of its line
_MAX_LABELLED = 7  # cells have texts in maps of at most this many columns and rows
_BEYOND, _NONE = "#f1e9f5", "#ffffff"


@dataclass(frozen=True)
class GroupValues:
    """The values of one group, (n,), and their quartiles."""

    label: str
    values: FloatArray  # observed values
    censored: float  # share of the runs whose value lies beyond the limit
    quartiles: tuple[float, float, float]  # inf: beyond the limit; NaN: none


def distributions(groups: Sequence[GroupValues], title: str, x_label: str, limit: float | None = None) -> Any:
    """Draw the values of at least one group. `limit`: greatest censored value; None: no value is censored."""
    labels = [group.label for group in groups]
    figure, axes = column_axes(title, x_label, foot_in=room_below_in(labels))
    values = np.concatenate([group.values for group in groups])
    log = fits_log(values if limit is None else np.append(values, limit))
    densities = max(map(_runs, groups)) > MAX_POINTS
    for position, group in enumerate(groups):
        if densities and len(group.values) >= _MIN_DENSITY_POINTS:
            _draw_density(axes, position, group.values, log)
        else:
            _draw_points(axes, position, group.values)
        _draw_box(axes, position, group, limit)
    if limit is not None:
        _draw_limit(axes, groups, limit)
    if log:
        set_log(axes.yaxis)
    set_categories(axes, labels)
    return figure


def _runs(group: GroupValues) -> float:
    return len(group.values) / (1.0 - group.censored) if group.censored < 1.0 else 0.0


def _draw_points(axes: Any, position: int, values: FloatArray) -> None:
    offset = (np.arange(1, len(values) + 1) * _GOLDEN) % 1.0 - 0.5  # spread evenly
    axes.plot(position + 1.4 * _HALF_WIDTH * offset, values, ".", ms=4.5, mew=0, color=CURVE, alpha=0.6, zorder=2)


def _draw_density(axes: Any, position: int, values: FloatArray, log: bool) -> None:
    """Draw the kernel density estimate between the least and the greatest value; nothing for equal values."""
    scaled: FloatArray = np.log(values) if log else values
    if not np.std(scaled) > 0.0:
        return
    grid: FloatArray = np.linspace(float(scaled.min()), float(scaled.max()), _GRID)
    density: FloatArray = cast("Any", stats).gaussian_kde(scaled, bw_method="silverman")(grid)
    half = _HALF_WIDTH * density / density.max()
    shown: FloatArray = np.exp(grid) if log else grid
    axes.fill_betweenx(shown, position - half, position + half, color=CURVE, alpha=0.25, lw=0, zorder=2)


def _draw_box(axes: Any, position: int, group: GroupValues, limit: float | None) -> None:
    low, middle, high = group.quartiles
    if np.isnan(low) or (np.isinf(low) and limit is None):
        return
    top = high if np.isfinite(high) else limit
    if np.isfinite(low) and top is not None:
        left, right = position - _BOX_HALF_WIDTH, position + _BOX_HALF_WIDTH
        outline: Look = {"color": INK, "lw": 0.8, "zorder": 3, "solid_capstyle": "butt"}
        sides = [right, right, left, left] if np.isfinite(high) else [left, left, np.nan, right, right]
        ends = [low, top, top, low] if np.isfinite(high) else [top, low, np.nan, low, top]
        axes.plot([left, *sides, right], [low, *ends, low], **outline)
        if not np.isfinite(high):  # open at the top: the quartile exceeds the limit
            axes.plot([left, right], [low, low], **outline)
    if np.isfinite(middle):
        half = 1.6 * _BOX_HALF_WIDTH
        axes.plot([position - half, position + half], [middle] * 2, color=INK, lw=2.0, zorder=4, solid_capstyle="butt")


def _draw_limit(axes: Any, groups: Sequence[GroupValues], limit: float) -> None:
    axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
    above: Look = {"xytext": (0, 5), "textcoords": "offset points", "ha": "center", "va": "bottom"}
    for position, group in enumerate(groups):
        if group.censored > 0.0:
            axes.plot([position], [limit], "^", ms=4, mfc="white", mec=INK, mew=0.8, zorder=5, clip_on=False)
            share = f"{100.0 * group.censored:.0f} %" if group.censored >= 0.01 else "<1 %"
            axes.annotate(share, (position, limit), fontsize=LETTERS_PT, color=INK, **above)
    if any(group.censored > 0.0 for group in groups):
        axes.margins(y=0.12)


@dataclass(frozen=True)
class Jump:
    """A change point of a response on an axis, with its interval."""

    center: float
    low: float
    high: float


@dataclass(frozen=True)
class MedianLine:
    """Medians over the values of a parameter; arrays (k,), inf beyond the limit, NaN without a value."""

    label: str
    x: FloatArray  # ascending
    median: FloatArray
    low: FloatArray  # ends of the median's interval
    high: FloatArray
    q25: FloatArray
    q75: FloatArray
    jump: Jump | None = None


def response_curve(lines: Sequence[MedianLine], title: str, x_label: str, limit: float | None = None) -> Any:
    """Draw a line with its quartiles, or several with a legend.

    `limit`: greatest censored value; None: no value is censored.
    """
    figure, axes = column_axes(title, x_label)
    single, log = len(lines) == 1, fits_log(lines[0].x)
    if limit is not None:
        axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
    colors = [CURVE] if single else ordered_colors(len(lines))
    for index, (line, color) in enumerate(zip(lines, colors, strict=True)):
        x = _shifted(line.x, index - 0.5 * (len(lines) - 1), log=log)
        if line.jump is not None and not single:
            axes.axvline(line.jump.center, color=color, lw=0.9, ls=(index, (3, len(lines))), zorder=1)
        if single:
            low, high = _clipped(line.q25, limit), _clipped(line.q75, limit)
            axes.fill_between(x, low, high, color=color, alpha=0.18, lw=0)
        low, high = _clipped(line.low, limit), _clipped(line.high, limit)
        axes.vlines(x, low, high, color=color, lw=1.0, zorder=3)
        _draw_medians(axes, x, line, limit, color)
    if log:
        set_log(axes.xaxis)
    quartiles = [quartile for line in lines for quartile in (line.q25, line.q75)]
    if fits_log(np.concatenate(quartiles + ([] if limit is None else [np.array([limit])]))):
        set_log(axes.yaxis)
    if not single:
        plain_legend(axes, loc="best")
    elif lines[0].jump is not None:
        _draw_jump(axes, lines[0].jump)
    return figure


def _shifted(x: FloatArray, offsets: float, *, log: bool) -> FloatArray:
    """Return x shifted by a number of offsets, so that the intervals of lines do not overlap."""
    scaled = np.log(x) if log else x
    shifted: FloatArray = scaled + _LINE_OFFSET * offsets * np.ptp(scaled)
    return np.exp(shifted) if log else shifted


def _clipped(edge: FloatArray, limit: float | None) -> FloatArray:
    """Return the edge clipped to the limit."""
    return np.where(np.isposinf(edge), np.nan if limit is None else limit, edge)


def _draw_medians(axes: Any, x: FloatArray, line: MedianLine, limit: float | None, color: Any) -> None:
    # NaN breaks the line at a censored median.
    medians = np.where(np.isfinite(line.median), line.median, np.nan)
    axes.plot(x, medians, "o-", color=color, lw=1.3, ms=3, zorder=4, label=line.label)
    beyond = np.isposinf(line.median)
    if limit is not None and beyond.any():
        mark: Look = {"ms": 4, "mfc": "white", "mec": INK, "mew": 0.8, "zorder": 5, "clip_on": False, "ls": ""}
        axes.plot(x[beyond], np.full(int(beyond.sum()), limit), "^", **mark)


def _draw_jump(axes: Any, jump: Jump) -> None:
    """Draw the change point on axes with final limits, with its value on the side that has room."""
    axes.axvspan(jump.low, jump.high, color=ACCENT, alpha=0.12, lw=0, zorder=0)
    axes.axvline(jump.center, color=ACCENT, lw=1.0, zorder=1)
    look: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "va": "top", "color": ACCENT}
    xs = (jump.center, *axes.get_xlim())
    center_px, low_px, high_px = axes.transData.transform([(x, axes.get_ylim()[1]) for x in xs])[:, 0]
    is_right = center_px > low_px + _LABEL_LEFT_FROM * (high_px - low_px)
    side: Look = {"xytext": (-3, 7), "ha": "right"} if is_right else {"xytext": (3, 7), "ha": "left"}
    axes.annotate(f"{jump.center:.3g}", (jump.center, 1.0), fontsize=LETTERS_PT, **side, **look)


@dataclass(frozen=True)
class HeatMap:
    """Medians over the levels of two parameters."""

    values: FloatArray  # (rows, columns) inf: beyond the limit, NaN: no value
    x_labels: Sequence[str]
    y_labels: Sequence[str]  # the first row is at the bottom
    jumps: Sequence[Jump | None] = ()  # one per row, in columns: 1.5 is midway between the second and the third


def heat_map(data: HeatMap, title: str, x_label: str, y_label: str) -> Any:
    """Draw the map, with a colour bar and the change points of its rows."""
    import matplotlib as mpl
    from matplotlib.colors import Normalize

    values, x_labels, y_labels = data.values, data.x_labels, data.y_labels
    rows = len(y_labels)
    foot_in = room_below_in(x_labels)
    height_in = _HEAD_IN + foot_in + float(np.clip(rows * _ROW_IN, _MIN_IN, _MAX_IN))
    figure, axes = column_axes(title, x_label, height_in, right_in=0.55, foot_in=foot_in, head_in=_HEAD_IN)
    finite = values[np.isfinite(values)]
    least, greatest = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    norm = Normalize(least, greatest)
    axes.grid(visible=False)
    axes.spines["bottom"].set_visible(False)
    colors = mpl.colormaps[_COLORS].with_extremes(over=_BEYOND, bad=_NONE)
    shown = np.ma.masked_invalid(np.where(np.isposinf(values), greatest + 1.0 + abs(greatest), values))
    edges = np.arange(len(x_labels) + 1) - 0.5, np.arange(rows + 1) - 0.5
    axes.pcolormesh(*edges, shown, cmap=colors, norm=norm, edgecolors="white", linewidth=0.4)
    labelled = max(len(x_labels), rows) <= _MAX_LABELLED
    if labelled:
        _write_values(axes, values, norm)
    else:
        _mark_beyond(axes, values)
    _draw_jumps(axes, data.jumps, 0.38 if labelled else 0.0)
    set_categories(axes, x_labels)
    axes.set_xlim(-0.5, len(x_labels) - 0.5)
    step = max(1, -(-rows // 12))
    axes.set_yticks(range(0, rows, step), [shortened(label, 7) for label in y_labels[::step]])
    axes.set_ylim(-0.5, rows - 0.5)
    axes.set_title(y_label, loc="left", fontsize=TEXT_PT, color=SOFT, pad=2, x=-0.12)
    _draw_bar(figure, axes, colors, norm)
    return figure


def _write_values(axes: Any, values: FloatArray, norm: Any) -> None:
    look: Look = {"ha": "center", "va": "center", "fontsize": LETTERS_PT - 1.0}
    for (row, column), value in np.ndenumerate(values):
        if np.isnan(value):
            continue
        light = not np.isfinite(value) or norm(value) > 0.55
        axes.text(
            column,
            row,
            short(float(f"{value:.3g}")) if np.isfinite(value) else ">",
            color=INK if light else "white",
            **look,
        )


def _mark_beyond(axes: Any, values: FloatArray) -> None:
    for row, column in np.argwhere(np.isposinf(values)).tolist():
        axes.text(column, row, ">", color=INK, ha="center", va="center", fontsize=LETTERS_PT)


def _draw_jumps(axes: Any, jumps: Sequence[Jump | None], raised: float) -> None:
    """Draw each change point in its row, with its interval raised above the texts of the cells."""
    look: Look = {"zorder": 5, "solid_capstyle": "butt"}
    for row, jump in enumerate(jumps):
        if jump is None:
            continue
        axes.plot([jump.low, jump.high], [row + raised] * 2, color="white", lw=2.6, **look)
        axes.plot([jump.low, jump.high], [row + raised] * 2, color=INK, lw=1.0, **look)
        axes.plot([jump.center] * 2, [row - 0.5, row + 0.5], color="white", lw=3.4, **look)
        axes.plot([jump.center] * 2, [row - 0.5, row + 0.5], color=ACCENT, lw=1.8, zorder=6, solid_capstyle="butt")


def _draw_bar(figure: Any, axes: Any, colors: Any, norm: Any) -> None:
    from matplotlib.cm import ScalarMappable

    box = axes.get_position()
    bar_axes = figure.add_axes((box.x1 + 0.02, box.y0, 0.03, box.height))
    bar = figure.colorbar(ScalarMappable(norm, colors), cax=bar_axes)
    bar.outline.set(edgecolor=FAINT, linewidth=0.5)
    bar_axes.tick_params(labelsize=LETTERS_PT, labelcolor=INK, length=0, pad=2)
    bar_axes.locator_params(nbins=5)
    bar_axes.yaxis.set_major_formatter(short)
