"""The section of the summary: per design point, the quartiles of each response with their intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.metrics.pictures.report.campaign_data import (
    CampaignData,
    Rounding,
    Samples,
    response_title,
    rounding_of,
    short_value,
)
from swarmwire.metrics.pictures.report.page import Part, ReportSection, ReportTable
from swarmwire.metrics.records.campaign.campaign_json import Response
from swarmwire.metrics.statistics.summary import Summary
from swarmwire.metrics.text import listed, number_text, sentence

MAX_POINTS = 60  # limit of design points for tables by point; larger campaigns have tables by value of each parameter
_MAX_OPEN_ROWS = 20  # longer tables are folded, except the first


@dataclass(frozen=True)
class _Group:
    """A row of each table: its first cells, and its design points."""

    cells: tuple[str, ...]
    points: tuple[int, ...]


def _parts(data: CampaignData) -> list[Part]:
    samples, chosen = data.samples, data.chosen
    columns, groups = _groups(samples)
    parts: list[Part] = []
    if len(samples.folder.points) > MAX_POINTS:
        parts.append(
            f"There are {len(samples.folder.points):,} design points, so the tables are by the values of each "
            "parameter, over all values of the others. Quartiles are those of all these runs. Intervals are about "
            "other seeds at the same design points: whole seeds are resampled, so they do not shrink with the number "
            "of points. `summary.parquet` has every run."
        )
    for index, response in enumerate(chosen.shown):
        folded = index > 0 and len(groups) > _MAX_OPEN_ROWS
        parts.append(_table(samples, response, columns, groups, folded=folded))
    for reason, responses in (
        ("equal in all runs that have a value", chosen.constant),
        ("without a value in any run", chosen.undefined),
    ):
        if responses:
            parts.append(f"Left out ({reason}): {listed([f'`{response.column}`' for response in responses])}.")
    if chosen.others:
        parts.append(_other_table(samples, chosen.others, columns, groups))
    return parts


SUMMARY = ReportSection("Summary", _parts)


def _groups(samples: Samples) -> tuple[tuple[str, ...], list[_Group]]:
    """Return the names of the first columns, and the rows."""
    points, parameters = samples.folder.points, samples.folder.parameters
    if len(points) <= MAX_POINTS:
        rows = [
            _Group(tuple(short_value(point[path]) for path in parameters), (number,))
            for number, point in enumerate(points)
        ]
        return parameters, rows
    rows: list[_Group] = []
    for path in parameters:
        levels = samples.levels(path)
        rows += [_Group((path, label), tuple(levels.points(level))) for level, label in enumerate(levels.labels)]
    return ("parameter", "value"), rows


def _table(
    samples: Samples, response: Response, columns: tuple[str, ...], groups: list[_Group], *, folded: bool
) -> ReportTable:
    summaries = [samples.summary(response, group.points) for group in groups]
    rounding = _rounding(summaries)
    any_undefined = any(summary.undefined for summary in summaries)
    pooled = any(summary.seeds < summary.n for summary in summaries)
    any_stopped = any(summary.stopped_first for summary in summaries)
    header = [*columns, *(["runs", "seeds"] if pooled else ["n"]), "median", "quartiles", "95 % interval of the median"]
    header += ["not reached"] if response.kind == "time" else []
    header += ["stopped first"] if any_stopped else []
    header += ["undefined"] if any_undefined else []
    rows = [
        (
            *group.cells,
            str(summary.n),
            *([str(summary.seeds)] if pooled else []),
            *_figures(summary, response, rounding),
            *([_share(summary)] if response.kind == "time" else []),
            *([_stopped_first(summary)] if any_stopped else []),
            *([str(summary.undefined)] if any_undefined else []),
        )
        for group, summary in zip(groups, summaries, strict=True)
    ]
    caption = f"{sentence(response_title(response))} (`{response.column}`): {response.help.rstrip('.')}."
    return ReportTable(tuple(header), tuple(rows), caption, folded=folded)


def _other_table(
    samples: Samples, responses: tuple[Response, ...], columns: tuple[str, ...], groups: list[_Group]
) -> ReportTable:
    rows: list[tuple[str, ...]] = []
    for response in responses:
        summaries = [samples.summary(response, group.points) for group in groups]
        rounding = _rounding(summaries)
        rows += [
            (response.column, *group.cells, str(summary.n), *_figures(summary, response, rounding)[:2], _share(summary))
            for group, summary in zip(groups, summaries, strict=True)
        ]
    header = ("response", *columns, "n", "median", "quartiles", "not reached")
    return ReportTable(header, tuple(rows), f"The other responses ({len(responses)})", folded=True)


def _figures(summary: Summary, response: Response, rounding: Rounding) -> tuple[str, str, str]:
    """Return the texts of median, quartiles and the median's interval."""
    # Not rounded like the quartiles: a limit of 2.6 s would read > 3 s, which no run has shown.
    beyond = f"> {number_text(summary.limit)}{' ' + response.unit if response.unit else ''}"
    censored = response.kind == "time" and summary.n > 0

    def text(value: float) -> str:
        return beyond if censored and not math.isfinite(value) else rounding.text(value)

    low, high = summary.q50_interval
    return (
        text(summary.q50),
        _span(text(summary.q25), text(summary.q75)),
        _span(text(low), text(high)),
    )


def _span(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"


def _share(summary: Summary) -> str:
    return f"{100.0 * summary.censored:.0f} %" if math.isfinite(summary.censored) else "–"


def _stopped_first(summary: Summary) -> str:
    """Return how many runs a stop condition ended before the event, and the shortest observation of these."""
    return (
        f"{summary.stopped_first} of {summary.n}, from {number_text(summary.shortest)} s"
        if summary.stopped_first
        else "–"
    )


def _rounding(summaries: Sequence[Summary]) -> Rounding:
    return rounding_of(
        [value for summary in summaries for value in (summary.q25, summary.q50, summary.q75)],
        [summary.q75 - summary.q25 for summary in summaries],
    )
