"""What happened: metrics and events over time, and where the robots went."""

from typing import Any

import numpy as np

from swarmwire.metrics.drawing.film import Film
from swarmwire.metrics.drawing.metric_axes import Facts, titled, told_of
from swarmwire.metrics.registry import LINK_PDR, METRICS
from swarmwire.metrics.report.in_words import number
from swarmwire.metrics.report.lanes import Lane, Span
from swarmwire.metrics.report.run_data import ARENA, RunData
from swarmwire.metrics.report.run_figures.small_panels import MAX_PANELS, small_panels
from swarmwire.metrics.report.run_figures.timeline import Curve, timeline
from swarmwire.metrics.report.run_sections.where import where
from swarmwire.metrics.report.section import Figure, Section, Table
from swarmwire.metrics.report.svg import as_svg

MAIN = ("order", "components", LINK_PDR)  # in the panels of the timeline, as far as they have a value
SECOND = (  # small, where they have a value that changes
    "target_best",
    "target_mean",
    "largest_component",
    "age_of_information",
    "throughput",
    "collisions",
    "wall_contacts",
    "min_gap",
)
_WHOLE = ("components",)
_MAX_LANES = 8
_MAX_EVENTS = 200
_TITLES = {LINK_PDR: "link_pdr: received / in range"}


def what_happened(run: RunData) -> Section:
    """The section: the timeline, the ways of the robots, and small panels of the metrics that the scenario names."""
    if isinstance(run.film, str):
        return Section("What happened", (f"No tick can be shown: {run.film}",))
    film = run.film
    parts: list[Any] = []
    main = curves(film, MAIN)
    if main:
        lanes = [*_moments(run, film), *run.lanes]
        figure = timeline(film.time_s, main, lanes[:_MAX_LANES])
        parts.append(Figure("timeline", as_svg(figure, "timeline"), _caption(main, lanes)))
    parts += where(run)
    others = curves(film, second(film))
    if others:
        figure = small_panels(film.time_s, others)
        parts.append(Figure("metrics", as_svg(figure, "metrics"), _rest("The other metrics", len(others))))
    return Section("What happened", (*parts, *_events(run)))


def second(film: Film) -> list[str]:
    """The metrics for small panels: those that the scenario names but times, then some of the standard."""
    listed = [name for name in film.metrics if name not in METRICS or not METRICS[name].standard]
    listed = [name for name in listed if not _is_time(name, film.facts)]
    changing = [name for name in SECOND if name in film.metrics and np.unique(film.metrics[name]).size > 1]
    return [name for name in (*listed, *changing) if name not in MAIN]


def curves(film: Film, names: tuple[str, ...] | list[str]) -> list[Curve]:
    """The metrics of these names that ever had a value."""
    return [
        Curve(name, _TITLES.get(name, titled(name, film.facts)), film.metrics[name], name in _WHOLE, film.facts)
        for name in names
        if name in film.metrics and np.isfinite(film.metrics[name]).any()
    ]


def _is_time(name: str, facts: Facts) -> bool:
    return told_of(name, facts).kind == "time"


def _moments(run: RunData, film: Film) -> list[Lane]:
    """Since when what stopped the arena had held, and when what the metrics that are times wait for came about."""
    end: dict[str, Any] = run.summary["by_arena"][ARENA] if run.summary else {"stopped_by": None}
    moments: dict[str, float] = {}
    if end["stopped_by"]:
        moments[f"stop: {end['stopped_by']}, since"] = float(end["stop_time_s"])
    for name, value in film.metrics.items():
        if _is_time(name, film.facts) and np.isfinite(value[-1]):
            moments[f"{name.removesuffix('_s')}:"] = float(value[-1])
    return [Lane(f"{words} {number(at_s)} s", [Span(at_s, None)]) for words, at_s in moments.items()]


def _caption(main: list[Curve], lanes: list[Lane]) -> str:
    names = ", ".join(curve.name.replace("_", " ") for curve in main)
    text = f"{names[0].upper()}{names[1:]} over time"
    if not lanes:
        return f"{text}; no events."
    more = f" Of {len(lanes)} kinds of events the first {_MAX_LANES} are drawn." if len(lanes) > _MAX_LANES else ""
    return f"{text}, and above it what happened: a bar until it was over, a diamond where no end is recorded.{more}"


def _rest(what: str, there: int) -> str:
    return f"{what} over time" + (f"; of {there} the first {MAX_PANELS}." if there > MAX_PANELS else ".")


def _events(run: RunData) -> list[str | Table]:
    if run.events is None:
        return ["Events were not recorded, or cannot be read; see `swarmwire verify`."]
    if not len(run.events):
        return []
    rows = tuple(
        (
            number(row["time_s"]),
            f"{row['do']} {row['part']}".strip().replace("_", " ") + (" ended" if row["ended"] else ""),
            _names(row["robots"]),
        )
        for row in run.events.head(_MAX_EVENTS).iter_rows(named=True)
    )
    all_of = f"The first {_MAX_EVENTS} of {len(run.events)} events" if len(run.events) > _MAX_EVENTS else "All events"
    return [Table(("time in s", "event", "robots that it changed"), rows, f"{all_of}.", folded=True)]


def _names(robots: list[str]) -> str:
    return ", ".join(robots[:8]) + (f" and {len(robots) - 8} more" if len(robots) > 8 else "") if robots else "–"
