"""The section of tables: what each response came to at each design point."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.report.campaign.chosen_responses import ChosenResponses
from swarmwire.metrics.report.campaign.levels import levels_of
from swarmwire.metrics.report.campaign.rounding import Rounding, rounding_of
from swarmwire.metrics.report.campaign.samples import Samples
from swarmwire.metrics.report.campaign.words import listed, response_title, sentence, short_value
from swarmwire.metrics.report.section import Section, Table
from swarmwire.metrics.statistics.summary import Summary, number_text

MAX_POINTS = 60  # beyond which tables are by the values of each parameter
_MAX_OPEN_ROWS = 20  # of tables after the first that are not folded


@dataclass(frozen=True)
class _Group:
    """A row of each table: its first cells, and the design points that it is about."""

    cells: tuple[str, ...]
    points: tuple[int, ...]


def summary_section(samples: Samples, chosen: ChosenResponses) -> Section:
    """The section."""
    columns, groups = _groups(samples)
    parts: list[str | Table] = []
    if len(samples.folder.points) > MAX_POINTS:
        parts.append(
            f"There are {len(samples.folder.points):,} design points, so the tables are by the values of each "
            "parameter, over all values of the others. `summary.parquet` has every run."
        )
    for place, response in enumerate(chosen.shown):
        folded = place > 0 and len(groups) > _MAX_OPEN_ROWS
        parts.append(_table(samples, response, columns, groups, folded=folded))
    for what, responses in (
        ("The same in all runs that have a value", chosen.constant),
        ("Never there in any run", chosen.never),
    ):
        if responses:
            parts.append(f"{what}, and so left out: {listed([f'`{response.column}`' for response in responses])}.")
    if chosen.others:
        parts.append(_other_table(samples, chosen.others, columns, groups))
    return Section("Summary", tuple(parts))


def _groups(samples: Samples) -> tuple[tuple[str, ...], list[_Group]]:
    """The names of the first columns, and the rows."""
    points, parameters = samples.folder.points, samples.folder.parameters
    if len(points) <= MAX_POINTS:
        rows = [
            _Group(tuple(short_value(point[path]) for path in parameters), (number,))
            for number, point in enumerate(points)
        ]
        return parameters, rows
    rows: list[_Group] = []
    for path in parameters:
        levels = levels_of(path, points)
        rows += [_Group((path, label), tuple(levels.points(level))) for level, label in enumerate(levels.labels)]
    return ("parameter", "value"), rows


def _table(
    samples: Samples, response: Response, columns: tuple[str, ...], groups: list[_Group], *, folded: bool
) -> Table:
    summaries = [samples.summary(response, group.points) for group in groups]
    rounding = _rounding(summaries)
    some_undefined = any(found.undefined for found in summaries)
    header = [*columns, "n", "median", "quartiles", "95 % interval of the median"]
    header += ["not reached"] if response.kind == "time" else []
    header += ["undefined"] if some_undefined else []
    rows = [
        (
            *group.cells,
            str(found.n),
            *_figures(found, response, rounding),
            *([_share(found)] if response.kind == "time" else []),
            *([str(found.undefined)] if some_undefined else []),
        )
        for group, found in zip(groups, summaries, strict=True)
    ]
    what = f"{sentence(response_title(response))} (`{response.column}`): {response.help.rstrip('.')}."
    return Table(tuple(header), tuple(rows), what, folded=folded)


def _other_table(
    samples: Samples, responses: tuple[Response, ...], columns: tuple[str, ...], groups: list[_Group]
) -> Table:
    rows: list[tuple[str, ...]] = []
    for response in responses:
        summaries = [samples.summary(response, group.points) for group in groups]
        rounding = _rounding(summaries)
        rows += [
            (response.column, *group.cells, str(found.n), *_figures(found, response, rounding)[:2], _share(found))
            for group, found in zip(groups, summaries, strict=True)
        ]
    header = ("response", *columns, "n", "median", "quartiles", "not reached")
    return Table(header, tuple(rows), f"The other responses ({len(responses)})", folded=True)


def _figures(found: Summary, response: Response, rounding: Rounding) -> tuple[str, str, str]:
    """Median, quartiles and the median's interval."""
    # With digits of its own: rounded as the quartiles are, 2.6 s may read > 3 s, which nobody knows.
    beyond = f"> {number_text(found.limit)}{' ' + response.unit if response.unit else ''}"
    censored = response.kind == "time" and found.n > 0

    def text(value: float) -> str:
        return beyond if censored and not math.isfinite(value) else rounding.text(value)

    low, high = found.q50_interval
    return (
        text(found.q50),
        _span(text(found.q25), text(found.q75)),
        _span(text(low), text(high)),
    )


def _span(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"


def _share(found: Summary) -> str:
    return f"{100.0 * found.censored:.0f} %" if math.isfinite(found.censored) else "–"


def _rounding(summaries: Sequence[Summary]) -> Rounding:
    return rounding_of(
        [value for found in summaries for value in (found.q25, found.q50, found.q75)],
        [found.q75 - found.q25 for found in summaries],
    )
