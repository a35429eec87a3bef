"""A figure of a column's width with one pair of axes: what is measured at its top left, the parameter below."""

from typing import Any

from swarmwire.metrics.drawing.looks import INK, SMALL_PT, SOFT, TEXT_PT, Look
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.report.in_words import short
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

HEIGHT_IN, FOOT_IN = 2.25, 0.37
LETTERS_PT = SMALL_PT + 0.5
_LEFT_IN, _RIGHT_IN, _HEAD_IN = 0.46, 0.08, 0.3


def column_axes(
    title: str,
    x_label: str,
    height_in: float = HEIGHT_IN,
    right_in: float = _RIGHT_IN,
    foot_in: float = FOOT_IN,
    head_in: float = _HEAD_IN,
) -> tuple[Any, Any]:
    """The figure and its axes; room at the right, below and above as asked."""
    figure = blank_figure(COLUMN_IN, height_in)
    width, height = COLUMN_IN - _LEFT_IN - right_in, height_in - head_in - foot_in
    place = (_LEFT_IN / COLUMN_IN, foot_in / height_in, width / COLUMN_IN, height / height_in)
    axes = plain_axes(figure, place, "")
    axes.tick_params(which="both", labelsize=LETTERS_PT, labelcolor=INK, pad=2.5)
    axes.yaxis.set_major_formatter(short)
    said: Look = {"fontsize": TEXT_PT + 0.5, "color": INK, "ha": "left", "va": "top"}
    figure.text(0.06 / COLUMN_IN, 1.0 - 0.06 / height_in, title, **said)
    axes.set_xlabel(x_label, fontsize=TEXT_PT, color=SOFT, labelpad=3)
    return figure, axes


def plain_legend(axes: Any, **where: Any) -> None:
    """A legend without a frame."""
    axes.legend(fontsize=LETTERS_PT, frameon=False, labelcolor=INK, handlelength=1.6, borderaxespad=0.2, **where)
