"""The delivery ratio over distance, in a column of a page."""

from typing import TYPE_CHECKING, Any

from swarmwire.metrics.drawing.delivery_over_distance import draw_intended, draw_ratio
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.report.in_words import short
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

if TYPE_CHECKING:
    import polars as pl

_HEIGHT_IN = 2.75


def delivery_by_distance(table: "pl.DataFrame", range_m: float | None) -> Any:
    """The figure of the rows of one arena's `radio_distances` that are worth showing, one at least."""
    figure = blank_figure(COLUMN_IN, _HEIGHT_IN)
    upper = plain_axes(figure, (0.11, 0.5, 0.86, 0.41), "share of the receivers that received")
    lower = plain_axes(figure, (0.11, 0.14, 0.86, 0.2), "receivers that packets were meant for")
    draw_ratio(upper, table, range_m)
    draw_intended(lower, table)
    upper.tick_params(labelbottom=False)
    lower.yaxis.set_major_formatter(short)
    return figure
