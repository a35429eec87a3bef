"""The data of a run's report: its folder, film, events by kind, and tables."""

import shlex
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, cast

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.pictures.drawing.film import Film, film_of
from swarmwire.metrics.records.run_folder.layout import SCENARIO
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.table_file import corruption_errors
from swarmwire.metrics.text import counted, number, shortened

MAX_POINTS = 800  # points of a curve, about the width of a figure in dots
_SEPARATE_KEYS = ("at_s", "do", "part", "robots", "for_s")  # keys of an event that are not in its detail
_MAX_TITLE_LENGTH = 48
ARENA = 0  # figures are of this arena


@dataclass(frozen=True)
class Span:
    """An occurrence of an event."""

    from_s: float
    until_s: float | None  # None: not recorded, since the event is instantaneous or lasts until the run ends


@dataclass
class Lane:
    """All events of a kind, in order."""

    kind: str  # action, part and detail
    spans: list[Span] = field(default_factory=list[Span])
    robots: set[str] = field(default_factory=set[str])  # names of the robots that the events changed

    @property
    def title(self) -> str:
        """Kind, number of events, and number of changed robots."""
        times = "" if len(self.spans) == 1 else f", {len(self.spans)} times"
        robots = f" ({counted(len(self.robots), 'robot')})" if self.robots else ""
        return f"{shortened(self.kind, _MAX_TITLE_LENGTH)}{times}{robots}"


def event_kind(row: Mapping[str, Any]) -> str:
    """Return the action of a row of `events`, with its part, and its detail if `with_details` has added one."""
    return " ".join(filter(None, (row["do"], row["part"], row.get("detail", ""))))


def with_details(events: pl.DataFrame, scenario: str) -> pl.DataFrame:
    """Add the column `detail` to the rows of one arena: the settings of the scenario's event of this time and action.

    The detail is empty for events that are not in the scenario's text.
    """
    with suppress(tomllib.TOMLDecodeError):
        table = tomllib.loads(scenario)
        details: dict[tuple[Any, ...], list[str]] = {}
        numbers = _numbers("radio", table.get("radio", {}))
        for event in sorted(table.get("events", []), key=itemgetter("at_s")):
            key = float(event["at_s"]), event["do"], str(event.get("part", ""))
            details.setdefault(key, []).append(_detail(event, numbers))
        rows: Counter[tuple[Any, ...]] = Counter()
        column: list[str] = []
        for row in events.iter_rows(named=True):
            key = row["at_s"], row["do"], row["part"]
            index = rows[*key, row["ended"]]
            rows[*key, row["ended"]] += 1
            column.append(dict(enumerate(details.get(key, []))).get(index, ""))
        return events.with_columns(pl.Series("detail", column, pl.String))
    return events


def _detail(event: Mapping[str, Any], numbers: dict[str, Any]) -> str:
    """Return the settings of a scenario's event; a ramp starts at its value in `numbers`, and updates it."""
    for_s = f"for {number(event['for_s'])} s" if "for_s" in event else ""
    if event["do"] == "ramp":
        before = f"from {numbers[event['what']]} " if event["what"] in numbers else ""
        numbers[event["what"]] = event["to"]
        over = f"over {number(event['over_s'])} s" if event.get("over_s") else ""
        return " ".join(filter(None, (f"{event['what']} {before}to {event['to']}", over, for_s)))
    settings = [_setting(key, value) for key, value in event.items() if key not in _SEPARATE_KEYS]
    return ", ".join(filter(None, (*settings, for_s)))


def _setting(key: str, value: Any) -> str:
    """Return a setting as text: `bridge flock-0 flock-1`, `one_way`, `power_dbm -10.0`."""
    values = cast("list[Any]", value) if isinstance(value, list) else [] if value is True else [value]
    return " ".join([key, *map(str, values)])


def _numbers(path: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a table of the scenario and of its sub-tables, by path."""
    values: dict[str, Any] = {}
    for key, value in table.items():
        values |= (
            _numbers(f"{path}.{key}", cast("dict[str, Any]", value))
            if isinstance(value, dict)
            else {f"{path}.{key}": value}
        )
    return values


def lanes_of(events: pl.DataFrame) -> list[Lane]:
    """Return the lanes of one arena's rows of `events`, by first occurrence.

    Rows of ends do not name their beginning: an end belongs to the first open span with the same robots, else to the
    first open span.
    """
    lanes: dict[str, Lane] = {}
    opened: dict[str, list[tuple[int, list[str]]]] = {}
    for row in events.iter_rows(named=True):
        kind = event_kind(row)
        lane, still_open = lanes.setdefault(kind, Lane(kind)), opened.setdefault(kind, [])
        lane.robots.update(row["robots"])
        if row["ended"]:
            _end(lane, still_open, row)
        else:
            still_open.append((len(lane.spans), row["robots"]))
            lane.spans.append(Span(row["time_s"], None))
    return [lane for lane in lanes.values() if lane.spans]


def _end(lane: Lane, still_open: list[tuple[int, list[str]]], row: dict[str, Any]) -> None:
    if not still_open:
        return
    same = [item for item in still_open if item[1] == row["robots"]]
    ended = (same or still_open)[0]
    still_open.remove(ended)
    index, _ = ended
    lane.spans[index] = Span(lane.spans[index].from_s, row["time_s"])


def thinned(value: FloatArray, max_points: int = MAX_POINTS) -> IntArray:
    """Return the indices to draw of a curve (T,), ascending: all, or the least and greatest value of each section.

    A section without a value contributes its first index, so that a gap remains a gap.
    """
    if len(value) <= max_points:
        return np.arange(len(value))
    indices: set[int] = {0, len(value) - 1}
    bounds = np.linspace(0, len(value), max_points // 2 + 1).astype(int).tolist()
    for first, end in pairwise(bounds):
        section = value[first:end]
        finite = np.flatnonzero(np.isfinite(section))
        if not len(finite):
            indices.add(first)
            continue
        indices |= {first + int(finite[section[finite].argmin()]), first + int(finite[section[finite].argmax()])}
    return np.array(sorted(indices))


@dataclass(frozen=True)
class RunData:
    """A run folder, and the data that most sections use."""

    folder: RunFolder
    static: Static
    summary: dict[str, Any] | None  # None: the run was killed or is live
    started: dict[str, Any]  # content of run.json; empty: missing or damaged
    scenario: str  # text of the scenario; empty: missing
    film: Film | str  # film of the first arena, or the reason for its absence
    lanes: list[Lane]  # events of the first arena
    events: pl.DataFrame | None

    @property
    def shown_name(self) -> str:
        """The folder's name, quoted for a command in its parent folder."""
        return shlex.quote(self.folder.path.resolve().name)

    @property
    def has_radio(self) -> bool:
        """True if the robots have radios."""
        return self.static.range_m is not None

    def record(self, name: str) -> dict[str, Any]:
        """Return the summary's entry of a recorded table; empty without one."""
        return {} if self.summary is None else dict(self.summary["record"].get(name, {}))

    def of_arena(self, part: str, arena: int = ARENA) -> Any:
        """Return the summary's `radio` or `metrics` of an arena; None without a summary."""
        value: Any = None if self.summary is None else self.summary[part]
        return cast("list[Any]", value)[arena] if isinstance(value, list) else value

    def table(self, name: str, arena: int | None = ARENA) -> pl.DataFrame | str:
        """Return `events`, `radio_distances` or `radio_links`, or the reason for its absence."""
        if not self.folder.files(name) and not (self.folder.path / name).is_dir():
            return f"`{name}` was not recorded."
        try:
            return self.folder.validated(name, arena)
        except BadInput as error:
            return f"{error}."

    def packets(self, columns: Sequence[str]) -> pl.DataFrame | str:
        """Return these columns of the first arena's packets with a receiver, or the reason for their absence."""
        try:
            packets = self.folder.scan("packets")
            if packets is None:
                return "`packets` was not recorded."
            intended = packets.filter((pl.col("arena") == ARENA) & pl.col("receiver").is_not_null())
            return intended.select(*columns).drop_nulls().collect()
        except BadInput as error:
            return f"{error}."
        except (OSError, *corruption_errors()) as error:
            return (
                f"{self.folder.where('packets')} cannot be read ({str(error).splitlines()[0]}); see `swarmwire verify`."
            )


def read_run(path: Path) -> RunData:
    """Read a run folder; BadInput if it is missing, or its `static.json` or summary cannot be read."""
    folder = RunFolder(path)
    static, summary = folder.static, folder.summary
    try:
        film: Film | str = film_of(folder, ARENA, str(path))
    except BadInput as error:
        film = f"{error}."
    data = RunData(folder, static, summary, folder.started, _text(path / SCENARIO), film, [], None)
    events = data.table("events")
    if isinstance(events, str):
        return data
    events = with_details(events, data.scenario)
    return replace(data, lanes=lanes_of(events), events=events)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""
