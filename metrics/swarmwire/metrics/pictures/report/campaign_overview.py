"""The sections on the campaign's setup and on the distributions of its responses."""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence

import polars as pl

from swarmwire.metrics.pictures.report.campaign_data import (
    CampaignData,
    Levels,
    Samples,
    figure_name,
    response_title,
    short_value,
)
from swarmwire.metrics.pictures.report.charts import MAX_POINTS, GroupValues, distributions
from swarmwire.metrics.pictures.report.page import Figure, Listing, Part, ReportSection, ReportTable, drawn_figure
from swarmwire.metrics.records.campaign.campaign_json import FAILED, Campaign, Response, Value
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.text import counted, listed, sentence, shortened

_MAX_VALUES = 24  # longer lists of a parameter's values are abbreviated
_MAX_ERRORS = 20
_MAX_ERROR_LENGTH = 240
_MAX_POINTS = 6  # design points in a row of errors
_DURATION = "duration_s"  # path of a run's duration
MAX_PARAMETERS = 3  # parameters with figures of distributions


def _setup_parts(data: CampaignData) -> list[Part]:
    folder, about = data.samples.folder, data.samples.folder.about
    failed = folder.runs.filter(folder.runs["ended"] == FAILED)["run"].to_list()
    rows = [
        ("scenario", about.scenario if about.name == about.scenario else f"{about.scenario} ({about.name})"),
        ("design", _design(about)),
        *((path, _values(values)) for path, values in about.vary.items()),
        ("seeds", _seeds(about.seeds)),
        ("settings for all", ", ".join(about.overrides) or "none"),
        *([] if _DURATION in about.vary else [("a run lasts", f"{about.duration_s:g} s, unless it stops before")]),
        ("runs", _runs(folder, len(failed))),
        ("begun", _moment(about.began_utc)),
        ("versions", ", ".join(f"{name} {short_value(version)}" for name, version in about.versions.items())),
        ("CPU", listed(_machines(folder))),
    ]
    return [ReportTable(("", ""), tuple(rows), ""), *_commands(folder, failed), *_failures(folder)]


SETUP = ReportSection("Setup", _setup_parts)


def _commands(folder: CampaignFolder, failed: list[int]) -> list[str | Listing]:
    """Return the commands that start the campaign, repeat a run, and resume it."""
    name, runs = shlex.quote(str(folder.path)), folder.about.runs
    example = failed[0] if failed else runs // 2
    parts: list[str | Listing] = [
        f"The first line started the campaign; the second repeats run {example}, bit for bit.",
        Listing(f"{folder.about.command}\nswarmwire repeat {name} --run {example}"),
    ]
    if not folder.finished:
        parts.append(
            f"{counted(len(folder.missing), 'run')} of {runs:,} had not ended when this report was made; the "
            "following sections cover the others. This command runs the missing ones:"
        )
        parts.append(Listing(f"swarmwire sweep --resume {name}"))
    return parts


def _moment(utc: str) -> str:
    """Return a time in the basic format of ISO 8601 with separators; other texts unchanged."""
    match = re.fullmatch(r"(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)\d\dZ", utc)
    return "{}-{}-{} {}:{} UTC".format(*match.groups()) if match else utc


def _design(about: Campaign) -> str:
    points, seeds = len(about.points), len(about.seeds)
    return (
        f"{about.design}: {counted(points, 'point')} × {counted(seeds, 'seed')} = {counted(about.runs, 'run')}; "
        "every point has the same seeds"
    )


def _values(values: Sequence[Value] | Mapping[str, Value]) -> str:
    if isinstance(values, Mapping):
        return f"from {short_value(values['from'])} to {short_value(values['to'])}"
    texts = list(map(short_value, values))
    if len(texts) <= _MAX_VALUES:
        return ", ".join(texts)
    return f"{', '.join(texts[:3])}, … {texts[-1]} ({len(texts):,} values)"


def _seeds(seeds: tuple[int, ...]) -> str:
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"{seeds[0]} to {seeds[-1]}"
    return _values(seeds)


def _runs(folder: CampaignFolder, failed: int) -> str:
    ended = len(folder.runs)
    return f"{ended - failed:,} done, {failed:,} failed, {len(folder.missing):,} missing"


def _machines(folder: CampaignFolder) -> list[str]:
    """Return the CPUs of the machines that started the campaign and executed its runs."""
    cpus: Iterable[str] = (
        folder.runs["machine_cpu"].drop_nulls().unique().sort() if "machine_cpu" in folder.runs else ()
    )
    return list(dict.fromkeys([folder.about.cpu, *cpus]))


def _failures(folder: CampaignFolder) -> list[str | ReportTable]:
    """Return a table of errors and failed runs, the most frequent error first."""
    failed = folder.runs.filter(pl.col("ended") == FAILED)
    if not len(failed):
        return []
    groups = (
        failed.with_columns(pl.col("error").fill_null("no error was recorded").str.strip_chars())
        .group_by("error")
        .agg(
            pl.len().alias("count"), pl.col("run").min().alias("first"), pl.col("point").unique().sort().alias("points")
        )
        .sort("count", "first", descending=[True, False])
    )
    rows = [
        (shortened(" ".join(error.split()), _MAX_ERROR_LENGTH), str(count), str(first), _points(points))
        for error, count, first, points in groups.select("error", "count", "first", "points").head(_MAX_ERRORS).rows()
    ]
    more = f" {counted(len(groups) - len(rows), 'rarer error')} left out." if len(groups) > len(rows) else ""
    caption = f"Failed runs, by error. The following sections exclude them.{more}"
    return [ReportTable(("error", "runs", "first run", "design points"), tuple(rows), caption)]


def _points(points: list[int]) -> str:
    named = ", ".join(map(str, points[:_MAX_POINTS]))
    return named if len(points) <= _MAX_POINTS else f"{named}, … ({len(points)})"


def _distribution_parts(data: CampaignData) -> list[Part]:
    samples, responses = data.samples, data.shown
    parameters = samples.folder.parameters
    levels = list(map(samples.levels, parameters[:MAX_PARAMETERS]))
    levels = [each for each in levels if len(each) > 1]
    figures = [_figure(samples, response, each) for response in responses for each in levels]
    if not figures:
        return []
    parts: list[Part] = [_legend(samples, responses, levels)]
    omitted = parameters[MAX_PARAMETERS:]
    if omitted:
        parts.append(
            f"By the first {MAX_PARAMETERS} parameters; left out: {listed([f'`{path}`' for path in omitted])}."
        )
    return [*parts, *figures]


DISTRIBUTIONS = ReportSection("Distributions", _distribution_parts)


def _legend(samples: Samples, responses: tuple[Response, ...], levels: list[Levels]) -> str:
    text = (
        f"Dots are runs; where groups have more than {MAX_POINTS}, the blue shape is their density. The box reaches "
        "from the lower to the upper quartile, the bar is the median."
    )
    if any(samples.limit(response) is not None for response in responses):
        text += (
            " The dashed line is the time limit, the number above it the share of runs that reached it; a box that "
            "is open at the top has its upper quartile beyond."
        )
    if any(each.means for each in levels):
        text += (
            " Parameters with many values are grouped into ranges with equally many points; figures show their means."
        )
    return text


def _figure(samples: Samples, response: Response, levels: Levels) -> Figure:
    name = figure_name("distribution", response.column, levels.path)
    limit = samples.limit(response)
    groups = [_group(samples, response, levels, level) for level in range(len(levels))]
    figure = distributions(groups, response_title(response), levels.title, limit)
    pooled = " over all values of the others" if len(samples.folder.parameters) > 1 else ""
    caption = f"{sentence(response_title(response))} by `{levels.path}`{pooled}."
    return drawn_figure(name, figure, caption)


def _group(samples: Samples, response: Response, levels: Levels, level: int) -> GroupValues:
    points = tuple(levels.points(level))
    sample = samples.sample(response, points)
    censored = sample.censored if len(sample) else 0.0
    return GroupValues(
        levels.short[level], sample.value[sample.observed], censored, samples.quartiles(response, points)
    )
