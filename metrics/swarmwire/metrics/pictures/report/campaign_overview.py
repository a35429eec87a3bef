"""The sections on the campaign itself and on the distributions of its responses."""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence

import polars as pl

from swarmwire.metrics.pictures.report.campaign_data import Levels, Samples, figure_name, response_title, short_value
from swarmwire.metrics.pictures.report.charts import MAX_POINTS, GroupValues, distributions
from swarmwire.metrics.pictures.report.page import Figure, Listing, ReportTable, Section, drawn_figure
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.campaign.spec import FAILED, Campaign, Response, Value
from swarmwire.metrics.text import counted, listed, sentence, shortened

_MAX_VALUES = 24  # of a parameter, named one by one
_MAX_ERRORS = 20
_LONGEST_ERROR = 240
_MAX_POINTS = 6
_DURATION = "duration_s"  # the path of how long a run lasts
MAX_PARAMETERS = 3


def setup_section(folder: CampaignFolder) -> Section:
    """The section."""
    about = folder.about
    failed = folder.runs.filter(folder.runs["ended"] == FAILED)["run"].to_list()
    rows = [
        ("scenario", about.scenario if about.name == about.scenario else f"{about.scenario} ({about.name})"),
        ("design", _design(about)),
        *((path, _values(wanted)) for path, wanted in about.vary.items()),
        ("seeds", _seeds(about.seeds)),
        ("settings for all", ", ".join(about.overrides) or "none"),
        *([] if _DURATION in about.vary else [("a run lasts", f"{about.duration_s:g} s, unless it stops before")]),
        ("runs", _runs(folder, len(failed))),
        ("begun", _moment(about.began_utc)),
        ("versions", ", ".join(f"{name} {short_value(version)}" for name, version in about.versions.items())),
        ("CPU", listed(_machines(folder))),
    ]
    parts = [ReportTable(("", ""), tuple(rows), ""), *_commands(folder, failed), *_failures(folder)]
    return Section("Setup", tuple(parts))


def _commands(folder: CampaignFolder, failed: list[int]) -> list[str | Listing]:
    """The commands that start the campaign, repeat one of its runs, and resume it."""
    name, runs = shlex.quote(str(folder.path)), folder.about.runs
    example = failed[0] if failed else runs // 2
    parts: list[str | Listing] = [
        f"The campaign was started by the first of these lines; the second repeats run {example}, bit for bit.",
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
    """A time in the short form of ISO 8601, readable; any other text unchanged."""
    found = re.fullmatch(r"(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)\d\dZ", utc)
    return "{}-{}-{} {}:{} UTC".format(*found.groups()) if found else utc


def _design(about: Campaign) -> str:
    points, seeds = len(about.points), len(about.seeds)
    return (
        f"{about.design}: {counted(points, 'point')} × {counted(seeds, 'seed')} = {counted(about.runs, 'run')}; "
        "every point has the same seeds"
    )


def _values(wanted: Sequence[Value] | Mapping[str, Value]) -> str:
    if isinstance(wanted, Mapping):
        return f"from {short_value(wanted['from'])} to {short_value(wanted['to'])}"
    values = list(map(short_value, wanted))
    if len(values) <= _MAX_VALUES:
        return ", ".join(values)
    return f"{', '.join(values[:3])}, … {values[-1]} ({len(values):,} values)"


def _seeds(seeds: tuple[int, ...]) -> str:
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"{seeds[0]} to {seeds[-1]}"
    return _values(seeds)


def _runs(folder: CampaignFolder, failed: int) -> str:
    ended = len(folder.runs)
    return f"{ended - failed:,} done, {failed:,} failed, {len(folder.missing):,} missing"


def _machines(folder: CampaignFolder) -> list[str]:
    """The CPUs that it began on and that runs were made on."""
    found: Iterable[str] = (
        folder.runs["machine_cpu"].drop_nulls().unique().sort() if "machine_cpu" in folder.runs else ()
    )
    return list(dict.fromkeys([folder.about.cpu, *found]))


def _failures(folder: CampaignFolder) -> list[str | ReportTable]:
    """Errors with the runs that they ended, the most frequent first."""
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
        (shortened(" ".join(error.split()), _LONGEST_ERROR), str(count), str(first), _points(points))
        for error, count, first, points in groups.select("error", "count", "first", "points").head(_MAX_ERRORS).rows()
    ]
    more = f" {counted(len(groups) - len(rows), 'rarer error')} left out." if len(groups) > len(rows) else ""
    caption = f"Failed runs, by error. The following sections exclude them.{more}"
    return [ReportTable(("error", "runs", "first run", "design points"), tuple(rows), caption)]


def _points(points: list[int]) -> str:
    named = ", ".join(map(str, points[:_MAX_POINTS]))
    return named if len(points) <= _MAX_POINTS else f"{named}, … ({len(points)})"


def distribution_section(samples: Samples, responses: tuple[Response, ...]) -> Section | None:
    """The section; None if nothing is varied or nothing was measured."""
    parameters = samples.folder.parameters
    levels = list(map(samples.levels, parameters[:MAX_PARAMETERS]))
    levels = [each for each in levels if len(each) > 1]
    figures = [_figure(samples, response, each) for response in responses for each in levels]
    if not figures:
        return None
    parts: list[str | Figure] = [_how_to_read(samples, responses, levels)]
    left_out = parameters[MAX_PARAMETERS:]
    if left_out:
        parts.append(
            f"By the first {MAX_PARAMETERS} parameters; left out: {listed([f'`{path}`' for path in left_out])}."
        )
    return Section("Distributions", (*parts, *figures))


def _how_to_read(samples: Samples, responses: tuple[Response, ...], levels: list[Levels]) -> str:
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
            " Parameters of many values are put together into ranges, equally full, which figures call by their means."
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
