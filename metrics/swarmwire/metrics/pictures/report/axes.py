"""Axes of charts: one column wide, logarithmic or with categories; and colours of ordered curves."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import INK, SMALL_PT, SOFT, TEXT_PT, Look, plain_axes
from swarmwire.metrics.pictures.report.page import COLUMN_IN, blank_figure
from swarmwire.metrics.text import short, shortened

HEIGHT_IN, FOOT_IN = 2.25, 0.37
LETTERS_PT = SMALL_PT + 0.5
_LEFT_IN, _RIGHT_IN, _HEAD_IN = 0.46, 0.08, 0.3
_DECADES = 2.0  # an axis is logarithmic if its 5th and 95th percentiles are at least this far apart
_MAX_LETTERS = 44  # letters of horizontal labels across a column's figure
_MIN_GROUPS = 5  # an axis has room for at least this many groups, so that two do not look like barrels
_MAX_LABEL_LENGTH = 14
_MAX_ROTATED = 18  # rotated labels of an axis
_FAR_FROM_ZERO = 0.5  # an axis of shares that are all above it does not start at 0
_FIRST_COLOR, _LAST_COLOR = 0.05, 0.82  # positions in the colour map, whose end is too light for lines on white


def column_axes(
    title: str,
    x_label: str,
    height_in: float = HEIGHT_IN,
    right_in: float = _RIGHT_IN,
    foot_in: float = FOOT_IN,
    head_in: float = _HEAD_IN,
) -> tuple[Any, Any]:
    """Return a figure and its axes with these margins."""
    figure = blank_figure(COLUMN_IN, height_in)
    width, height = COLUMN_IN - _LEFT_IN - right_in, height_in - head_in - foot_in
    box = (_LEFT_IN / COLUMN_IN, foot_in / height_in, width / COLUMN_IN, height / height_in)
    axes = plain_axes(figure, box, "")
    axes.tick_params(which="both", labelsize=LETTERS_PT, labelcolor=INK, pad=2.5)
    axes.yaxis.set_major_formatter(short)
    style: Look = {"fontsize": TEXT_PT + 0.5, "color": INK, "ha": "left", "va": "top"}
    figure.text(0.06 / COLUMN_IN, 1.0 - 0.06 / height_in, title, **style)
    axes.set_xlabel(x_label, fontsize=TEXT_PT, color=SOFT, labelpad=3)
    return figure, axes


def plain_legend(axes: Any, **options: Any) -> None:
    """Add a legend without a frame."""
    axes.legend(fontsize=LETTERS_PT, frameon=False, labelcolor=INK, handlelength=1.6, borderaxespad=0.2, **options)


def fits_log(values: FloatArray) -> bool:
    """Return True if values (n,) are all above 0 and span at least two decades."""
    finite = values[np.isfinite(values)]
    if not len(finite) or finite.min() <= 0.0:
        return False
    low, high = np.quantile(finite, (0.05, 0.95))
    return bool(np.log10(high / low) >= _DECADES)


def set_log(axis: Any) -> None:
    """Make an axis logarithmic, with decimal labels; call it after everything is drawn."""
    from matplotlib.ticker import LogLocator

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    # Powers of ten alone would leave two decades with hardly a label.
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high < 1000.0 * max(low, 1e-300) else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=8))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def set_share_limits(axes: Any, least: float, greatest: float) -> None:
    """Limit the y axis to shares from the least to the greatest: from 0, or from just below shares above one half."""
    low = min(0.0, least) if least < _FAR_FROM_ZERO else least - 0.08 * (max(greatest, 1.0) - least)
    high = max(greatest, 1.0)
    axes.set_ylim(low, high + 0.03 * (high - low))


def room_below_in(labels: Sequence[str]) -> float:
    """Return the margin of `column_axes` below the axes for these labels."""
    if not _need_rotation(labels):
        return FOOT_IN
    return FOOT_IN + 0.035 * min(max(map(len, labels)), _MAX_LABEL_LENGTH)


def set_categories(axes: Any, labels: Sequence[str]) -> None:
    """Label the groups at 0, 1, 2 and so on."""
    margin = 0.6 + 0.5 * max(0, _MIN_GROUPS - len(labels))
    axes.set_xlim(-margin, len(labels) - 1 + margin)
    if not _need_rotation(labels):
        step = -(-_letters(labels) // _MAX_LETTERS)
        axes.set_xticks(range(0, len(labels), step), labels[::step])
        return
    step = -(-len(labels) // _MAX_ROTATED)
    texts = [shortened(label, _MAX_LABEL_LENGTH) for label in labels[::step]]
    axes.set_xticks(range(0, len(labels), step), texts, rotation=30, ha="right", rotation_mode="anchor")


def _need_rotation(labels: Sequence[str]) -> bool:
    """Return True for too many letters, unless the labels are numbers, of which some may be omitted."""
    return _letters(labels) > _MAX_LETTERS and not all(_is_number(label) for label in labels)


def _letters(labels: Sequence[str]) -> int:
    return sum(len(label) + 2 for label in labels)


def _is_number(label: str) -> bool:
    try:
        float(label)
    except ValueError:
        return False
    return True


def ordered_colors(count: int) -> list[Any]:
    """Return `count` colours, from dark to light."""
    import matplotlib as mpl

    colors = mpl.colormaps["viridis"]
    return [colors(share) for share in np.linspace(_FIRST_COLOR, _LAST_COLOR, count)]
