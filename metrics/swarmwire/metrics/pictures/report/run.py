"""The report of a run from its folder alone: its sections in order, among them the setup and the metrics."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import MetricInfo
from swarmwire.metrics.measures.registry import LINK_PDR
from swarmwire.metrics.pictures.drawing.film import Film
from swarmwire.metrics.pictures.drawing.metrics_strip import info_of, is_count
from swarmwire.metrics.pictures.report.page import Listing, Part, Report, ReportSection, ReportTable, build_sections
from swarmwire.metrics.pictures.report.run_data import RunData, read_run
from swarmwire.metrics.pictures.report.run_radio import RADIO, REAL_TIME
from swarmwire.metrics.pictures.report.run_timeline import EVENTS
from swarmwire.metrics.text import counted, number, share

_MAX_LINES = 300  # lines of the scenario
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


def _setup_parts(run: RunData) -> list[Part]:
    """Return a table of facts, problems of the run, and the command that repeats it."""
    facts = [*_scenario(run), *_course(run), *_machine(run)]
    repetition: list[Part] = ["Without its `run.json` the run cannot be repeated."]
    if run.started:
        repetition = [
            "The folder alone is enough to repeat the run; with these versions bit for bit:",
            Listing(f"swarmwire repeat {run.shown_name}"),
        ]
    return [ReportTable(("", ""), tuple(facts), ""), *_problems(run), *_hash(run), *repetition]


def _scenario_parts(run: RunData) -> list[Part]:
    """Return the text of the scenario; nothing if the folder lacks it."""
    lines = run.scenario.splitlines()
    if not lines:
        return []
    omitted = len(lines) - _MAX_LINES
    note = [f"{counted(omitted, 'more line')} in `scenario.toml`."] if omitted > 0 else []
    return [Listing("\n".join(lines[:_MAX_LINES])), *note]


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
    """Return the number and kind of robots of each group."""
    return ", ".join(f"{group.stop - group.start} {group.body.name} ({group.name})" for group in static.groups)


def _arena(static: Static) -> str:
    size = " × ".join(f"{side:g}" for side in static.arena_size_m)
    boundary = {"walls": "with walls", "open": "open", "torus": "a torus"}[static.boundary]
    scenery = [counted(len(static.obstacles[0]), "obstacle")] if static.obstacles[0] else []
    scenery += [counted(len(static.lights[0]), "light")] if static.lights and static.lights[0] else []
    return ", ".join([f"{size} m", boundary, *scenery])


def _course(run: RunData) -> list[tuple[str, str]]:
    summary = run.summary
    if summary is None:
        extent = f"recorded up to {number(float(run.film.time_s[-1]))} s" if isinstance(run.film, Film) else "no tick"
        ticks = run.started.get("ticks")
        planned = f" of {number(ticks / run.static.rate_hz)} s" if isinstance(ticks, int) else ""
        return [("ended", f"no summary: it was killed or is running; {extent}{planned}")]
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
    text = str(_ENDED.get(summary["ended"], summary["ended"]))
    arenas: list[dict[str, Any]] = summary["by_arena"]
    stopped = [arena for arena in arenas if arena["stopped_by"]]
    if len(arenas) > 1 and stopped:
        text += f"; {len(stopped)} of {len(arenas)} arenas by a stop condition"
    elif stopped:
        text += f": {stopped[0]['stopped_by']}, since {number(stopped[0]['stop_time_s'])} s"
    return f"{text}: {summary['error']}" if summary["error"] else text


def _took(summary: dict[str, Any]) -> str:
    return f"{number(summary['wall_time_s'])} s, {number(summary['realtime_factor'])} × real time"


def _hash(run: RunData) -> list[str]:
    """Return the hash for comparison with a repetition, as a paragraph: a phone would cut off a cell this wide."""
    if run.summary is None:
        return []
    name = "Trajectory" if run.static.arenas == 1 else "Trajectory of the first arena"
    meaning = "two runs have the same hash if robots moved and received the same"
    return [f"{name}: `{run.summary['trajectory_sha256'][0]}`; {meaning}."]


def _machine(run: RunData) -> list[tuple[str, str]]:
    facts = run.summary or run.started
    versions: dict[str, str] = facts.get("versions") or {}
    rows = [("CPU", str(facts["cpu"]))] if "cpu" in facts else []
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    return [*rows, ("versions", listed)] if listed else rows


def _problems(run: RunData) -> list[str]:
    """Return paragraphs on problems of the run, which readers need to judge its results."""
    summary, arenas = run.summary, run.static.arenas
    problems: list[str] = []
    if arenas > 1:
        problems.append(
            f"Figures are of the first of {arenas} arenas, seed {run.static.seeds[0]}, unless their captions differ."
        )
    if summary is None:
        return problems
    counts = [f"`{name}` {value:,}" for name, value in summary["counts"].items() if value]
    if counts:
        problems.append(f"Counts that should be 0: {', '.join(counts)}.")
    lost: list[Any] = summary["lost_runners"]
    if lost:
        problems.append(f"Lost runners: {'; '.join(map(str, lost))}.")
    events: list[dict[str, Any]] = summary["runner_events"]
    changes = [f"{event['runner']} {event['what']} in tick {event['tick']}" for event in events if event["tick"] >= 0]
    if changes:
        problems.append(f"Changes of runners: {'; '.join(changes)}.")
    dropped = {name: part["dropped"] for name, part in summary["record"].items() if part.get("dropped")}
    if dropped:
        rows = ", ".join(f"{value:,} of `{name}`" for name, value in dropped.items())
        problems.append(f"Rows that were dropped for lack of time, which figures below do not include: {rows}.")
    readings: dict[str, list[str]] = summary["global_sensors"]
    if readings:
        bodies = "; ".join(f"{body}: {', '.join(names)}" for body, names in readings.items())
        problems.append(f"Bodies that know more than their surroundings: {bodies}.")
    return problems


def run_report(folder: Path) -> Report:
    """Return the report of a run, also of a killed or live one.

    Figures are of the first arena; tables cover all. A sentence replaces the figures of a table that was not recorded
    or is damaged. BadInput if this is no run folder, if its `static.json` or summary cannot be read, or without
    matplotlib.
    """
    run = read_run(folder)
    return Report(run.static.name, build_sections(SECTIONS, run)[0], _about(run))


def _about(run: RunData) -> str:
    static = run.static
    seeds = f"seed {static.seeds[0]}" if static.arenas == 1 else counted(static.arenas, "arena")
    time_s = "killed or running" if run.summary is None else f"{number(run.summary['sim_time_s'])} s"
    return f"A run of {groups(static)}, {seeds}, {time_s}."


def _metric_parts(run: RunData) -> list[Part]:
    """Return a row per metric of the first arena; of several arenas, tables across arenas and of each arena."""
    values, facts = metric_statistics(run), run.folder.measured
    if not values:
        return ["No metric was recorded."]
    rows = tuple(
        (name, *(number(statistics[key]) for key in STATISTICS), *_unit_and_help(info_of(name, facts)))
        for name, statistics in values.items()
        if any(statistics[key] is not None for key in STATISTICS)
    )
    undefined = [f"`{name}`" for name, statistics in values.items() if set(statistics.values()) == {None}]
    first_arena = ", first arena" if run.static.arenas > 1 else ""
    recorded = "" if run.summary else " that were recorded"
    table = ReportTable(
        ("metric", *STATISTICS, "unit", "what"),
        rows,
        f"Metrics over the ticks{recorded}{first_arena}. For a metric that adds up, final is the total and the others "
        "are per tick.",
    )
    note = [f"Without a value in this run: {', '.join(undefined)}."] if undefined else []
    return [table, *note, *_arenas(run)]


SECTIONS: tuple[ReportSection[RunData], ...] = (
    ReportSection("Setup", _setup_parts),
    EVENTS,
    RADIO,
    REAL_TIME,
    ReportSection("Metrics", _metric_parts),
    ReportSection("The scenario", _scenario_parts),
)


def metric_statistics(run: RunData) -> dict[str, dict[str, float | None]]:
    """Return final, mean, min and max by metric, from the summary, or without one from the recorded ticks."""
    summarized: dict[str, dict[str, float | None]] | None = run.of_arena("metrics")
    if summarized is not None:
        return summarized
    if isinstance(run.film, str):
        return {}
    return {
        name: _statistics(value, is_count(name, run.film.facts))
        for name, value in run.film.metrics.items()
        if name != LINK_PDR or name in run.film.facts
    }


def _statistics(value: FloatArray, adds_up: bool) -> dict[str, float | None]:
    """Return the statistics of a metric over ticks (T,), equal to those of `Metrics`."""
    finite = value[np.isfinite(value)]
    if not len(finite):
        return dict.fromkeys(STATISTICS)
    each = np.diff(finite, prepend=0.0) if adds_up else finite
    final = None if np.isnan(value[-1]) else float(value[-1])
    return {"final": final, "mean": float(each.mean()), "min": float(each.min()), "max": float(each.max())}


def _unit_and_help(metric: MetricInfo) -> tuple[str, str]:
    return metric.unit, "; ".join(filter(None, (metric.help or "custom", _KINDS.get(metric.kind))))


def _arenas(run: RunData) -> list[str | ReportTable]:
    """Return the results of several arenas: statistics across arenas by metric, and a row per arena."""
    arenas = run.static.arenas
    if run.summary is None or arenas < 2:
        return []
    finals = _finals([run.of_arena("metrics", arena) for arena in range(arenas)])
    across = tuple(
        (name, f"{len(values)}", *(number(q) for q in np.quantile(values, (0.0, 0.25, 0.5, 0.75, 1.0))))
        for name, values in finals.items()
        if len(values)
    )
    head = ("metric", "arenas with a value", "least", "lower quartile", "median", "upper quartile", "greatest")
    return [
        ReportTable(head, across, "Final values across the arenas."),
        ReportTable(
            ("seed", *_ARENA_HEAD), tuple(map(_arena_row(run), range(arenas))), "All arenas.", folded=arenas > 12
        ),
    ]


def _arena_row(run: RunData) -> Callable[[int], tuple[str, ...]]:
    """Return the function that makes the row of an arena by its index."""
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
        name: np.array([arena[name]["final"] for arena in arenas if arena[name]["final"] is not None], np.float64)
        for name in arenas[0]
    }
