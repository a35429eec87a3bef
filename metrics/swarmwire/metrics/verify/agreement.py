"""Whether the tables of a run folder hold what its summary says."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.metrics.record.part_files import scan_files
from swarmwire.metrics.verify.finding import State

Verdict = tuple[State, str] | None  # None: they agree, or there is nothing to compare
BROKEN_OFF = ("interrupted", "left", "failed")  # ends of runs that may come amid a tick, which no observer sees
NO_ROWS = ("out_of_range", "in_flight")  # fates that have no row among the packets


def ticks_agree(files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
    """Every tick once in every arena, from 0 to the last; the last row's metrics are the final ones."""
    import polars as pl

    table = scan_files(files)
    arenas = 1 if summary is None else int(summary["arenas"])
    by_arena = table.group_by("arena").agg(pl.len().alias("rows"), pl.col("tick").n_unique().alias("ticks"))
    counted = by_arena.join(table.group_by("arena").agg(pl.col("tick").max().alias("last")), on="arena").collect()
    for arena, rows, ticks, last in counted.sort("arena").iter_rows():
        if not rows == ticks == last + 1:
            return State.PARTIAL, f"{last + 1 - ticks} ticks before the last are not there (arena {arena})"
    if summary is None or not (summary["ticks"] or len(counted)):  # it may end before its first tick
        return None
    if len(counted) != arenas:
        return State.DIFFERS, f"{len(counted)} arenas; the summary has {arenas}"
    for arena, (found, expected) in enumerate(zip(counted.sort("arena")["ticks"], arena_ticks(summary), strict=True)):
        if found != expected:
            return State.DIFFERS, f"{found} ticks; the summary has {expected} (arena {arena})"
    last = table.filter(pl.col("tick") == pl.col("tick").max().over("arena"))
    return _finals_agree(last.sort("arena").collect(), summary)


def _finals_agree(last: Any, summary: Mapping[str, Any]) -> Verdict:
    measured: list[dict[str, Any]] = per_arena(summary, "metrics")
    for arena, metrics in enumerate(measured):
        for name, statistics in metrics.items():
            found = last[name][arena] if name in last.columns else "no column"
            if found != statistics["final"]:
                return State.DIFFERS, f"{name} ends at {found} (arena {arena}); the summary has {statistics['final']}"
    return None


def packets_agree(files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
    """If all packets of a run that ended by itself were recorded: as many receivers of each fate."""
    import polars as pl

    recorded: dict[str, Any] = {} if summary is None else summary["record"].get("packets", {})
    if summary is None or recorded.get("share") != 1.0 or recorded["dropped"] or summary["ended"] in BROKEN_OFF:
        return None
    counted = scan_files(files).group_by("arena", "fate").agg(pl.col("receivers").sum()).collect()
    found = {(arena, fate): receivers for arena, fate, receivers in counted.iter_rows()}
    radios: list[dict[str, Any] | None] = per_arena(summary, "radio")
    for arena, radio in enumerate(radios):
        fates: dict[str, int] = radio["fates"] if radio else {}
        for fate, expected in fates.items():
            rows = found.get((arena, fate), 0)
            if fate not in NO_ROWS and rows != expected:
                return State.DIFFERS, f"{rows} {fate} (arena {arena}); the summary has {expected}"
    return None


def events_agree(files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
    """A row for each event of the summary in each arena that it concerns."""
    import polars as pl

    if summary is None:
        return None
    rows, events = scan_files(files).select(pl.len()).collect().item(), summary["events"]
    expected = sum(_arenas_of(event, arena_ticks(summary)) for event in events)
    if rows != expected:
        return State.DIFFERS, f"{rows} rows; the summary has {len(events)} events, {expected} rows by their arenas"
    return None


def _arenas_of(event: Mapping[str, Any], ticks: list[int]) -> int:
    """In how many arenas, of so many ticks, an event of the summary has a row."""
    if not event["singly"]:
        return sum(event["tick"] < done for done in ticks)
    return 1 if len(ticks) == 1 else sum(bool(robots) for robots in event["robots"])


def arena_ticks(summary: Mapping[str, Any]) -> list[int]:
    """How many ticks each arena took part in."""
    return [end["ticks"] for end in summary["by_arena"]]


def per_arena(summary: Mapping[str, Any], key: str) -> list[Any]:
    """What the summary says under this key, an item per arena: of a single arena it is no list."""
    return [summary[key]] if summary["arenas"] == 1 else summary[key]
