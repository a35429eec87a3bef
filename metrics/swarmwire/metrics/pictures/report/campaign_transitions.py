"""The section of transitions: the median of each response over numeric parameters, and its change points."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.report.campaign_data import (
    CampaignData,
    Levels,
    Samples,
    Slice,
    figure_name,
    response_title,
    rounding_of,
    slices_without,
)
from swarmwire.metrics.pictures.report.charts import HeatMap, Jump, MedianLine, heat_map, response_curve
from swarmwire.metrics.pictures.report.page import Figure, Part, ReportSection, ReportTable, drawn_figure
from swarmwire.metrics.records.campaign.campaign_json import Response
from swarmwire.metrics.statistics.summary import interval_text
from swarmwire.metrics.statistics.trends import ChangePoint, change_point
from swarmwire.metrics.text import listed, sentence

MAX_PARAMETERS = 3  # numeric parameters with maps, pair by pair
_MAX_OPEN_ROWS = 20  # a longer table is folded
_METHOD = (
    "Change points. Of all ways to divide the ordered values of a parameter in two, the one with the least sum "
    "of squares of all runs around two means (Hinkley, Biometrika 57, 1970), where the BIC is lower than those "
    "of one mean and of a straight line. It lies halfway between two values that were run; intervals are "
    "bootstrap percentiles over seeds, given that there is a step, and never finer than the values that were run."
)
_Row = tuple[str, ...]


def _parts(data: CampaignData) -> list[Part]:
    samples, folder = data.samples, data.samples.folder
    levels = list(map(samples.levels, folder.parameters))
    numbers = [each for each in levels if each.number is not None and len(each) > 1][:MAX_PARAMETERS]
    if not numbers or not data.shown:
        return []
    figures: list[Figure] = []
    rows: list[_Row] = []
    answers: list[str] = []
    for response in data.shown:
        if len(numbers) == 1:
            figures.append(_curve(samples, response, numbers[0], rows))
            answers.append(_answer(samples, response, numbers[0]))
        for x, y in combinations(numbers, 2):
            slices = slices_without(folder, (x.path, y.path), names_apart=len(numbers) == 2)
            figures += _maps(samples, response, x, y, slices, rows)
    return [*answers, *figures, _legend(len(numbers)), _table(rows)]


TRANSITIONS = ReportSection("Transitions", _parts, (_METHOD,))


def _answer(samples: Samples, response: Response, x: Levels) -> str:
    """Return a sentence on the change of the median along a parameter, over all values of the others."""
    cells = [tuple(x.points(level)) for level in range(len(x))]
    change, limit = _change(samples, response, x, cells), samples.limit(response)
    ends = [samples.quartiles(response, cells[end])[1] for end in (0, -1)]
    rounded = rounding_of(ends).text
    first, last = (
        f"> {rounding_of([limit]).text(limit)}" if np.isinf(end) and limit is not None else rounded(end) for end in ends
    )
    step = "no change point"
    if change is not None:
        step = f"a change point at {change.position:.4g} ({interval_text(change.position_interval)})"
    title = sentence(response_title(response))
    return f"{title}: median {first} at `{x.path}` {x.labels[0]}, {last} at {x.labels[-1]}; {step}."


def _legend(numbers: int) -> str:
    change = (
        "where a step of two levels explains the runs best, if it does so better, by BIC, than no change and than a "
        "straight line. A censored time counts as the time until its run ended."
    )
    if numbers == 1:
        return (
            "The line is the median, with its 95 % intervals; a band reaches from quartile to quartile; a triangle is "
            "a median beyond the time limit. The upright line across is the change point, with its 95 % interval: "
            f"{change}"
        )
    others = " Other numbers of a grid are at their middle value, other parameters are pooled." if numbers > 2 else ""
    return (
        f"Each cell is the median of its runs. The red mark in a row is its change point: {change} The thin line is "
        f"its 95 % interval; a cell with > has its median beyond the time limit.{others}"
    )


def _curve(samples: Samples, response: Response, x: Levels, rows: list[_Row]) -> Figure:
    slices = slices_without(samples.folder, (x.path,))
    lines: list[MedianLine] = []
    for each in slices:
        cells = [each.cell((x, level)) for level in range(len(x))]
        change = _change(samples, response, x, cells)
        rows.append(_change_cells(response, x, each.label, change))
        lines.append(_medians(samples, response, x, cells, each.short, change))
    name = figure_name("response", response.column, x.path)
    figure = response_curve(lines, response_title(response), x.title, samples.limit(response))
    return drawn_figure(name, figure, f"{sentence(response_title(response))} over `{x.path}`{_by(samples, x, slices)}.")


def _by(samples: Samples, x: Levels, slices: list[Slice]) -> str:
    """Return the end of a caption of several curves: the parameters by which they differ."""
    others = [f"`{path}`" for path in samples.folder.parameters if path != x.path]
    return f" by {listed(others)}; broken upright lines are change points" if len(slices) > 1 else ""


def _maps(
    samples: Samples, response: Response, x: Levels, y: Levels, slices: list[Slice], rows: list[_Row]
) -> list[Figure]:
    figures: list[Figure] = []
    for number, each in enumerate(slices):
        cells = [[each.cell((y, row), (x, column)) for column in range(len(x))] for row in range(len(y))]
        medians = np.array([[samples.quartiles(response, cell)[1] for cell in row] for row in cells])
        changes = [_change(samples, response, x, row) for row in cells]
        rows += [
            _change_cells(response, x, ", ".join(filter(None, (f"{y.path} {label}", each.label))), change)
            for label, change in zip(y.labels, changes, strict=True)
        ]
        positions = np.arange(len(x), dtype=np.float64)
        jumps = [None if change is None else _jump(change, x, positions) for change in changes]
        title = f"median {response_title(response)}"
        figure = heat_map(HeatMap(medians, x.short, y.short, jumps), title, x.title, y.title)
        name = figure_name("map", response.column, x.path, y.path, *([str(number)] if number else []))
        others = f", at {each.label}" if each.label else ""
        caption = f"{sentence(response_title(response))} over `{x.path}` and `{y.path}`{others}."
        figures.append(drawn_figure(name, figure, caption))
    return figures


def _change(samples: Samples, response: Response, x: Levels, cells: Sequence[tuple[int, ...]]) -> ChangePoint | None:
    assert x.number is not None
    return change_point(x.number, samples.table(response, cells))


def _jump(change: ChangePoint, x: Levels, positions: FloatArray) -> Jump:
    """Return the change point on an axis with the levels at these positions."""
    assert x.number is not None
    numbers = x.number
    low, high = change.position_interval
    center, low, high = (float(np.interp(value, numbers, positions)) for value in (change.position, low, high))
    return Jump(center, *((center, center) if np.isnan(low) else (low, high)))


def _medians(
    samples: Samples,
    response: Response,
    x: Levels,
    cells: list[tuple[int, ...]],
    label: str,
    change: ChangePoint | None,
) -> MedianLine:
    assert x.number is not None
    intervals = [samples.summary(response, cell).q50_interval for cell in cells]
    quartiles = np.array([samples.quartiles(response, cell) for cell in cells])
    low: FloatArray = np.array([interval.low for interval in intervals])
    high: FloatArray = np.array([interval.high for interval in intervals])
    if response.kind == "time":
        low = np.where(np.isnan(low) & np.isposinf(high), np.inf, low)
    jump = None if change is None else _jump(change, x, x.number)
    return MedianLine(label, x.number, quartiles[:, 1], low, high, quartiles[:, 0], quartiles[:, 2], jump)


def _change_cells(response: Response, x: Levels, others: str, change: ChangePoint | None) -> _Row:
    if change is None:
        return (response.column, x.path, others, "none", "", "", "", "")
    rounded = rounding_of((change.below, change.above)).text
    return (
        response.column,
        x.path,
        others,
        f"{change.position:.4g}",
        interval_text(change.position_interval),
        rounded(change.below),
        rounded(change.above),
        f"{rounded(change.effect_interval.low)} to {rounded(change.effect_interval.high)}",
    )


def _table(rows: list[_Row]) -> ReportTable:
    """Return the table of change points, without columns that are equal in all rows."""
    columns = (
        "response",
        "along",
        "at",
        "change point",
        "95 % interval",
        "mean below",
        "mean above",
        "95 % of the step",
    )
    along = {row[1] for row in rows}
    caption = f"Change points along `{along.pop()}`" if len(along) == 1 else "Change points"
    shown = [index for index in range(len(columns)) if index not in (1, 2) or len({row[index] for row in rows}) > 1]
    cells = tuple(tuple(row[index] for index in shown) for row in rows)
    return ReportTable(tuple(columns[index] for index in shown), cells, caption, folded=len(rows) > _MAX_OPEN_ROWS)
