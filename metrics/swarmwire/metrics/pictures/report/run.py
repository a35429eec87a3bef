"""The report of a run from its folder alone: its first section on scenario, course and machine, and that of metrics."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.registry import LINK_PDR
from swarmwire.metrics.pictures.drawing.film import Film
from swarmwire.metrics.pictures.drawing.metrics_strip import info_of, is_count
from swarmwire.metrics.pictures.report.page import Listing, Report, ReportTable, Section
from swarmwire.metrics.pictures.report.run_data import RunData, read_run
from swarmwire.metrics.pictures.report.run_radio import radio, real_time
from swarmwire.metrics.pictures.report.run_timeline import what_happened
from swarmwire.metrics.records.run_folder.layout import MetricInfo
from swarmwire.metrics.text import counted, number, share

_MAX_LINES = 300  # of the scenario
_ENDED = {
    "duration": "with its duration",
    "stopped": "stopped",
    "interrupted": "interrupted (Ctrl-C)",
    "left": "left by the program that stepped it",
    "failed": "failed",
}
STATISTICS = ("final", "mean", "min", "max")
_KINDS = {"level": "", "count": "adds up", "time": "a time"}
_ARENA_HEAD = ("ended", "time in s", "stopped since s", "packets sent", "link PDR", "trajectory")


def setup_section(run: RunData) -> Section:
    """The section: a table of facts, problems of the run, and the command that repeats it."""
    facts = [*_scenario(run), *_course(run), *_machine(run)]
    again = (
        "The folder alone is enough to run it again; on this CPU and with these versions bit for bit:"
        if run.started
        else "Without its `run.json` the run cannot be repeated."
    )
    return Section(
        "Setup",
        (
            ReportTable(("", ""), tuple(facts), ""),
            *_problems(run),
            *_hash(run),
            again,
            *([Listing(f"swarmwire repeat {run.shown_name}")] if run.started else []),
        ),
    )


def scenario_text(run: RunData) -> list[Section]:
    """The scenario as run, at the end of a report; nothing if the folder lacks it."""
    lines = run.scenario.splitlines()
    if not lines:
        return []
    rest = len(lines) - _MAX_LINES
    cut = (f"{counted(rest, 'more line')} in `scenario.toml`.",) if rest > 0 else ()
    return [Section("The scenario", (Listing("\n".join(lines[:_MAX_LINES])), *cut))]


def _scenario(run: RunData) -> list[tuple[str, str]]:
    static = run.static
    seeds = ", ".join(map(str, static.seeds[:12])) + (", …" if static.arenas > 12 else "")
    rows = [
        ("scenario", static.name),
        ("seed" if static.arenas == 1 else f"seeds of {static.arenas} arenas", seeds),
        ("robots", groups(static) + (" in each arena" if static.arenas > 1 else "")),
        ("arena", _arena(static)),
    ]
    if static.range_m is not None:
        rows.append(("radio", f"reaches {number(static.range_m)} m"))
    return rows


def groups(static: Static) -> str:
    """How many robots of which kind, group by group."""
    return ", ".join(f"{group.stop - group.start} {group.body.name} ({group.name})" for group in static.groups)


def _arena(static: Static) -> str:
    size = " × ".join(f"{side:g}" for side in static.arena_size_m)
    around = {"walls": "walls around", "open": "open", "torus": "a torus"}[static.boundary]
    things = [counted(len(static.obstacles[0]), "obstacle")] if static.obstacles[0] else []
    things += [counted(len(static.lights[0]), "light")] if static.lights and static.lights[0] else []
    return ", ".join([f"{size} m", around, *things])


def _course(run: RunData) -> list[tuple[str, str]]:
    summary = run.summary
    if summary is None:
        reached = f"recorded up to {number(float(run.film.time_s[-1]))} s" if isinstance(run.film, Film) else "no tick"
        planned = run.started.get("ticks")
        of_planned = f" of {number(planned / run.static.rate_hz)} s" if isinstance(planned, int) else ""
        return [("ended", f"no summary: it was killed or is running; {reached}{of_planned}")]
    runners = summary["runners"]
    backend = (
        "agents in the world's process" if not runners else f"agents in {counted(runners, 'process', 'processes')}"
    )
    return [
        ("engine", summary["engine"]),
        ("mode", f"{summary['mode']}, {backend}"),
        *([("stops at", "; ".join(summary["stop"]))] if summary["stop"] else []),
        ("ended", _ended(summary)),
        (
            "simulated",
            f"{number(summary['sim_time_s'])} s, {counted(summary['ticks'], 'tick')} at {run.static.rate_hz} Hz",
        ),
        ("took", _took(summary)),
    ]


def _ended(summary: dict[str, Any]) -> str:
    how = str(_ENDED.get(summary["ended"], summary["ended"]))
    arenas: list[dict[str, Any]] = summary["by_arena"]
    stopped = [arena for arena in arenas if arena["stopped_by"]]
    if len(arenas) > 1 and stopped:
        how += f"; {len(stopped)} of {len(arenas)} arenas by a stop condition"
    elif stopped:
        how += f": {stopped[0]['stopped_by']}, since {number(stopped[0]['stop_time_s'])} s"
    return f"{how}: {summary['error']}" if summary["error"] else how


def _took(summary: dict[str, Any]) -> str:
    return f"{number(summary['wall_time_s'])} s, {number(summary['realtime_factor'])} × real time"


def _hash(run: RunData) -> list[str]:
    """The hash by which a repetition is compared. A paragraph, since a cell this wide would be cut off on a phone."""
    if run.summary is None:
        return []
    of = "Trajectory" if run.static.arenas == 1 else "Trajectory of the first arena"
    same = "equal exactly where two runs moved and received the same"
    return [f"{of}: `{run.summary['trajectory_sha256'][0]}`; {same}."]


def _machine(run: RunData) -> list[tuple[str, str]]:
    known = run.summary or run.started
    versions: dict[str, str] = known.get("versions") or {}
    rows = [("CPU", str(known["cpu"]))] if "cpu" in known else []
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    return [*rows, ("versions", listed)] if listed else rows


def _problems(run: RunData) -> list[str]:
    """Paragraphs on problems of the run, which readers need to judge its results."""
    summary, arenas = run.summary, run.static.arenas
    problems: list[str] = []
    if arenas > 1:
        problems.append(
            f"Figures are of the first of {arenas} arenas, seed {run.static.seeds[0]}; sections on the others say so."
        )
    if summary is None:
        return problems
    counts = {name: value for name, value in summary["counts"].items() if value}
    if counts:
        problems.append(f"Not as it should be: {', '.join(f'`{name}` {value:,}' for name, value in counts.items())}.")
    lost: list[Any] = summary["lost_runners"]
    if lost:
        problems.append(f"Lost runners: {'; '.join(map(str, lost))}.")
    changes: list[dict[str, Any]] = summary["runner_events"]
    moved = [f"{of['runner']} {of['what']} in tick {of['tick']}" for of in changes if of["tick"] >= 0]
    if moved:
        problems.append(f"Runners that came and went: {'; '.join(moved)}.")
    dropped = {name: part["dropped"] for name, part in summary["record"].items() if part.get("dropped")}
    if dropped:
        rows = ", ".join(f"{value:,} of `{name}`" for name, value in dropped.items())
        problems.append(f"Rows that were dropped for want of time, which figures below lack: {rows}.")
    readings: dict[str, list[str]] = summary["global_sensors"]
    if readings:
        bodies = "; ".join(f"{body}: {', '.join(names)}" for body, names in readings.items())
        problems.append(f"Bodies that know more than their surroundings: {bodies}.")
    return problems


def run_report(folder: Path) -> Report:
    """The report of a run, also of one that was killed or is live: setup, course, radio, real time and metrics.

    Figures are of the first arena; tables cover all. A table that was not recorded, or is damaged, costs
    its figure, and the text says so. BadInput where there is no run folder, or its `static.json` or summary cannot be
    read, or without matplotlib.
    """
    run = read_run(folder)
    sections = (setup_section(run), what_happened(run), radio(run), *real_time(run), measured(run), *scenario_text(run))
    return Report(run.static.name, sections, _about(run))


def _about(run: RunData) -> str:
    static = run.static
    seeds = f"seed {static.seeds[0]}" if static.arenas == 1 else counted(static.arenas, "arena")
    time_s = "killed or running" if run.summary is None else f"{number(run.summary['sim_time_s'])} s"
    return f"A run of {groups(static)}, {seeds}, {time_s}."


def measured(run: RunData) -> Section:
    """The section: a row per metric of the first arena; of several arenas one per arena, too, and across them."""
    values, facts = of_metrics(run), run.folder.measured
    if not values:
        return Section("Metrics", ("No metric was recorded.",))
    rows = tuple(
        (name, *(number(found[key]) for key in STATISTICS), *_unit_and_help(info_of(name, facts)))
        for name, found in values.items()
        if any(found[key] is not None for key in STATISTICS)
    )
    none = [f"`{name}`" for name, found in values.items() if all(found[key] is None for key in STATISTICS)]
    of = ", first arena" if run.static.arenas > 1 else ""
    far = "" if run.summary else " that were recorded"
    table = ReportTable(
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


def _unit_and_help(of: MetricInfo) -> tuple[str, str]:
    """Its unit and description."""
    return of.unit, "; ".join(filter(None, (of.help or "the user's own", _KINDS.get(of.kind))))


def _arenas(run: RunData) -> list[str | ReportTable]:
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
        ReportTable(head, across, "Final values across the arenas."),
        ReportTable(
            ("seed", *_ARENA_HEAD), tuple(map(_arena_row(run), range(arenas))), "All arenas.", folded=arenas > 12
        ),
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
