"""The section of transitions: the median of each response over numeric parameters, and its change points."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.report.campaign_data import (
    Levels,
    Samples,
    Slice,
    figure_name,
    response_title,
    rounding_of,
    slices_beside,
)
from swarmwire.metrics.pictures.report.charts import Jump, MedianLine, heat_map, response_curve
from swarmwire.metrics.pictures.report.page import Figure, ReportTable, Section, drawn_figure
from swarmwire.metrics.records.campaign.spec import Response
from swarmwire.metrics.statistics.summary import interval_text
from swarmwire.metrics.statistics.trends import ChangePoint, change_point
from swarmwire.metrics.text import listed, sentence

MAX_PARAMETERS = 3  # of which pairs are drawn
_MAX_OPEN_ROWS = 20
_Row = tuple[str, ...]


def transition_section(samples: Samples, responses: tuple[Response, ...]) -> Section | None:
    """The section; None unless a number is varied and something was measured."""
    folder = samples.folder
    levels = list(map(samples.levels, samples.folder.parameters))
    numbers = [each for each in levels if each.number is not None and len(each) > 1][:MAX_PARAMETERS]
    if not numbers or not responses:
        return None
    figures: list[Figure] = []
    rows: list[_Row] = []
    answers: list[str] = []
    for response in responses:
        if len(numbers) == 1:
            figures.append(_curve(samples, response, numbers[0], rows))
            answers.append(_answer(samples, response, numbers[0]))
        for x, y in combinations(numbers, 2):
            beside = slices_beside(folder, (x.path, y.path), names_apart=len(numbers) == 2)
            figures += _maps(samples, response, x, y, beside, rows)
    return Section("Transitions", (*answers, *figures, _how_to_read(len(numbers)), _table(rows)))


def _answer(samples: Samples, response: Response, x: Levels) -> str:
    """How the median changes along a parameter, over all values of the others, as a sentence."""
    cells = [tuple(x.points(level)) for level in range(len(x))]
    change, limit = _change(samples, response, x, cells), samples.limit(response)
    ends = [samples.quartiles(response, cells[end])[1] for end in (0, -1)]
    rounded = rounding_of(ends).text
    first, last = (
        f"> {rounding_of([limit]).text(limit)}" if np.isinf(end) and limit is not None else rounded(end) for end in ends
    )
    step = "no change point"
    if change is not None:
        step = f"a change point at {change.place:.4g} ({interval_text(change.place_interval)})"
    title = sentence(response_title(response))
    return f"{title}: median {first} at `{x.path}` {x.labels[0]}, {last} at {x.labels[-1]}; {step}."


def _how_to_read(numbers: int) -> str:
    change = (
        "where a step of two levels explains the runs best, if it does so better, by BIC, than no change and than a "
        "straight line. A time that was cut off counts as the time until then."
    )
    if numbers == 1:
        return (
            "The line is the median, with its 95 % intervals; a band reaches from quartile to quartile; a triangle is "
            "a median beyond the time limit. The upright line across is the change point, with its 95 % interval: "
            f"{change}"
        )
    others = " Other numbers of a grid are at their middle value, all else is taken together." if numbers > 2 else ""
    return (
        f"Each cell is the median of its runs. The red mark in a row is its change point: {change} The thin line is "
        f"its 95 % interval; a cell with > has its median beyond the time limit.{others}"
    )


def _curve(samples: Samples, response: Response, x: Levels, rows: list[_Row]) -> Figure:
    slices = slices_beside(samples.folder, (x.path,))
    lines: list[MedianLine] = []
    for each in slices:
        cells = [each.cell((x, level)) for level in range(len(x))]
        change = _change(samples, response, x, cells)
        rows.append(_words(response, x, each.label, change))
        lines.append(_medians(samples, response, x, cells, each.short, change))
    name = figure_name("response", response.column, x.path)
    figure = response_curve(lines, response_title(response), x.title, samples.limit(response))
    return drawn_figure(name, figure, f"{sentence(response_title(response))} over `{x.path}`{_by(samples, x, slices)}.")


def _by(samples: Samples, x: Levels, slices: list[Slice]) -> str:
    """The end of a caption of several curves: the parameters by which they differ."""
    beside = [f"`{path}`" for path in samples.folder.parameters if path != x.path]
    return f" by {listed(beside)}; broken upright lines are change points" if len(slices) > 1 else ""


def _maps(
    samples: Samples, response: Response, x: Levels, y: Levels, beside: list[Slice], rows: list[_Row]
) -> list[Figure]:
    figures: list[Figure] = []
    for number, each in enumerate(beside):
        cells = [[each.cell((y, row), (x, column)) for column in range(len(x))] for row in range(len(y))]
        medians = np.array([[samples.quartiles(response, cell)[1] for cell in row] for row in cells])
        changes = [_change(samples, response, x, row) for row in cells]
        rows += [
            _words(response, x, ", ".join(filter(None, (f"{y.path} {label}", each.label))), change)
            for label, change in zip(y.labels, changes, strict=True)
        ]
        figures.append(_map(response, x, y, medians, changes, each, number))
    return figures


def _map(
    response: Response,
    x: Levels,
    y: Levels,
    medians: FloatArray,
    changes: list[ChangePoint | None],
    of: Slice,
    number: int,
) -> Figure:
    name = figure_name("map", response.column, x.path, y.path, *([str(number)] if number else []))
    jumps = [None if change is None else _jump(change, x, np.arange(len(x), dtype=np.float64)) for change in changes]
    figure = heat_map(medians, x.short, y.short, f"median {response_title(response)}", x.title, y.title, jumps)
    at = f", at {of.label}" if of.label else ""
    return drawn_figure(name, figure, f"{sentence(response_title(response))} over `{x.path}` and `{y.path}`{at}.")


def _change(samples: Samples, response: Response, x: Levels, cells: Sequence[tuple[int, ...]]) -> ChangePoint | None:
    assert x.number is not None
    return change_point(x.number, samples.table(response, cells))


def _jump(change: ChangePoint, x: Levels, shown_at: FloatArray) -> Jump:
    """The change point on an axis with the levels at these places."""
    assert x.number is not None
    numbers = x.number
    low, high = change.place_interval
    at, low, high = (float(np.interp(place, numbers, shown_at)) for place in (change.place, low, high))
    return Jump(at, *((at, at) if np.isnan(low) else (low, high)))


def _medians(
    samples: Samples,
    response: Response,
    x: Levels,
    cells: list[tuple[int, ...]],
    label: str,
    change: ChangePoint | None,
) -> MedianLine:
    assert x.number is not None
    found = [samples.summary(response, cell) for cell in cells]
    quartiles = np.array([samples.quartiles(response, cell) for cell in cells])
    low: FloatArray = np.array([each.q50_interval.low for each in found])
    high: FloatArray = np.array([each.q50_interval.high for each in found])
    if response.kind == "time":
        low = np.where(np.isnan(low) & np.isposinf(high), np.inf, low)
    jump = None if change is None else _jump(change, x, x.number)
    return MedianLine(label, x.number, quartiles[:, 1], low, high, quartiles[:, 0], quartiles[:, 2], jump)


def _words(response: Response, x: Levels, where: str, change: ChangePoint | None) -> _Row:
    if change is None:
        return (response.column, x.path, where, "none", "", "", "", "")
    rounded = rounding_of((change.below, change.above)).text
    return (
        response.column,
        x.path,
        where,
        f"{change.place:.4g}",
        interval_text(change.place_interval),
        rounded(change.below),
        rounded(change.above),
        f"{rounded(change.effect_interval.low)} to {rounded(change.effect_interval.high)}",
    )


def _table(rows: list[_Row]) -> ReportTable:
    """The table of change points, without columns that are equal in all rows."""
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
    kept = [place for place in range(len(columns)) if place not in (1, 2) or len({row[place] for row in rows}) > 1]
    shown = tuple(tuple(row[place] for place in kept) for row in rows)
    return ReportTable(tuple(columns[place] for place in kept), shown, caption, folded=len(rows) > _MAX_OPEN_ROWS)
