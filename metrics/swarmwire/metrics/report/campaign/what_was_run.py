"""The section that says what was run, how to run it again, and what failed."""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence

from swarmwire.metrics.campaign.about import About, Value
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.campaign.formats import FAILED
from swarmwire.metrics.report.campaign.words import listed, short_value
from swarmwire.metrics.report.in_words import counted, shortened
from swarmwire.metrics.report.section import Listing, Section, Table

_MAX_VALUES = 24  # of a parameter, named one by one
_MAX_ERRORS = 20
_LONGEST_ERROR = 240
_MAX_POINTS = 6
_DURATION = "duration_s"  # the path of how long a run lasts


def what_was_run(folder: CampaignFolder) -> Section:
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
    parts = [Table(("", ""), tuple(rows), ""), *_commands(folder, failed), *_failures(folder)]
    return Section("What was run", tuple(parts))


def _commands(folder: CampaignFolder, failed: list[int]) -> list[str | Listing]:
    """How it was run, how to run one of its runs again, and what is missing."""
    name, runs = shlex.quote(str(folder.path)), folder.about.runs
    example = failed[0] if failed else runs // 2
    parts: list[str | Listing] = [
        f"The campaign was started by the first of these lines; the second repeats run {example}, bit for bit.",
        Listing(f"{folder.about.command}\nswarmwire repeat {name} --run {example}"),
    ]
    if not folder.finished:
        parts.append(
            f"{counted(len(folder.missing), 'run')} of {runs:,} had not ended when this report was made, and what "
            "follows is about the others. This does what is missing:"
        )
        parts.append(Listing(f"swarmwire sweep --resume {name}"))
    return parts


def _moment(utc: str) -> str:
    """ISO 8601 in its short form, as people read it; any other text as it is."""
    found = re.fullmatch(r"(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)\d\dZ", utc)
    return "{}-{}-{} {}:{} UTC".format(*found.groups()) if found else utc


def _design(about: About) -> str:
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


def _failures(folder: CampaignFolder) -> list[str | Table]:
    """Errors with the runs that they ended, the most frequent first."""
    import polars as pl

    failed = folder.runs.filter(pl.col("ended") == FAILED)
    if not len(failed):
        return []
    groups = (
        failed.with_columns(pl.col("error").fill_null("no error was told").str.strip_chars())
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
    caption = f"Runs that failed, by their error. They have no part in what follows.{more}"
    return [Table(("error", "runs", "first run", "design points"), tuple(rows), caption)]


def _points(points: list[int]) -> str:
    named = ", ".join(map(str, points[:_MAX_POINTS]))
    return named if len(points) <= _MAX_POINTS else f"{named}, … ({len(points)})"
