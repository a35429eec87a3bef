"""The section of metrics: each with its value at the end and its statistics over the run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.metrics_strip import info_of, is_count
from swarmwire.metrics.registry import LINK_PDR
from swarmwire.metrics.report.page import Section, Table
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.run_folder.layout import MetricInfo
from swarmwire.metrics.text import number, share

STATISTICS = ("final", "mean", "min", "max")
_KINDS = {"level": "", "count": "adds up", "time": "a time"}
_ARENA_HEAD = ("ended", "time in s", "stopped since s", "packets sent", "link PDR", "trajectory")


def measured(run: RunData) -> Section:
    """The section: a row per metric of the first arena; of several arenas one per arena, too, and across them."""
    values, facts = of_metrics(run), run.folder.measured
    if not values:
        return Section("Metrics", ("No metric was recorded.",))
    rows = tuple(
        (name, *(number(found[key]) for key in STATISTICS), *_about(info_of(name, facts)))
        for name, found in values.items()
        if any(found[key] is not None for key in STATISTICS)
    )
    none = [f"`{name}`" for name, found in values.items() if all(found[key] is None for key in STATISTICS)]
    of = ", first arena" if run.static.arenas > 1 else ""
    far = "" if run.summary else " that were recorded"
    table = Table(
        ("metric", *STATISTICS, "unit", "what"),
        rows,
        f"Metrics over the ticks{far}{of}. Of one that adds up, final is the total and the others are per tick.",
    )
    undefined = [f"Never had a value in this run: {', '.join(none)}."] if none else []
    return Section("Metrics", (table, *undefined, *_arenas(run)))


def of_metrics(run: RunData) -> dict[str, dict[str, float | None]]:
    """final, mean, min and max by metric: of the summary, or of a run without one from its ticks."""
    summed: dict[str, dict[str, float | None]] | None = run.of_arena("metrics")
    if summed is not None:
        return summed
    if isinstance(run.film, str):
        return {}
    return {
        name: _statistics(value, is_count(name, run.film.facts))
        for name, value in run.film.metrics.items()
        if name != LINK_PDR or name in run.film.facts
    }


def _statistics(value: FloatArray, adds_up: bool) -> dict[str, float | None]:
    """The statistics of a metric over ticks (T,), as `Metrics` has them."""
    known = value[np.isfinite(value)]
    if not len(known):
        return dict.fromkeys(STATISTICS)
    each = np.diff(known, prepend=0.0) if adds_up else known
    final = None if np.isnan(value[-1]) else float(value[-1])
    return {"final": final, "mean": float(each.mean()), "min": float(each.min()), "max": float(each.max())}


def _about(of: MetricInfo) -> tuple[str, str]:
    """Its unit and description."""
    return of.unit, "; ".join(filter(None, (of.help or "the user's own", _KINDS.get(of.kind))))


def _arenas(run: RunData) -> list[str | Table]:
    """The results of all arenas: by metric across them, and one by one."""
    arenas = run.static.arenas
    if run.summary is None or arenas < 2:
        return []
    finals = _finals([run.of_arena("metrics", arena) for arena in range(arenas)])
    across = tuple(
        (name, f"{len(known)}", *(number(q) for q in np.quantile(known, (0.0, 0.25, 0.5, 0.75, 1.0))))
        for name, known in finals.items()
        if len(known)
    )
    head = ("metric", "arenas with a value", "least", "lower quartile", "median", "upper quartile", "greatest")
    return [
        Table(head, across, "Final values across the arenas."),
        Table(("seed", *_ARENA_HEAD), tuple(map(_arena_row(run), range(arenas))), "All arenas.", folded=arenas > 12),
    ]


def _arena_row(run: RunData) -> Callable[[int], tuple[str, ...]]:
    """A row of the table of arenas, by its place."""
    assert run.summary is not None
    hashes: list[str] = run.summary["trajectory_sha256"]
    ends: list[dict[str, Any]] = run.summary["by_arena"]

    def row(arena: int) -> tuple[str, ...]:
        radio = run.of_arena("radio", arena)
        packets = (f"{radio['sent']:,}", share(radio["link_pdr"])) if radio else ("–", "–")
        end = ends[arena]
        ended = (end["ended"], number(end["sim_time_s"]), number(end["stop_time_s"]))
        return (str(run.static.seeds[arena]), *ended, *packets, f"{hashes[arena][:16]}…")

    return row


def _finals(arenas: list[dict[str, dict[str, float | None]]]) -> dict[str, FloatArray]:
    return {
        name: np.array([one[name]["final"] for one in arenas if one[name]["final"] is not None], np.float64)
        for name in arenas[0]
    }
