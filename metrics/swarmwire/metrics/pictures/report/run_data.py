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

MAX_POINTS = 800  # of a curve: about the width of a figure in dots
_NO_SETTINGS = ("at_s", "do", "part", "robots", "for_s")  # of an event: shown in columns of their own
_LONGEST = 48  # words above a lane
ARENA = 0  # whose pictures are drawn


@dataclass(frozen=True)
class Span:
    """Something that happened; where its end is not recorded, it was of a moment, or lasted to the run's end."""

    from_s: float
    until_s: float | None


@dataclass
class Lane:
    """All that happened of one kind, in order."""

    words: str  # the action, with its part if it has one
    spans: list[Span] = field(default_factory=list[Span])
    robots: set[str] = field(default_factory=set[str])  # names of all that it changed

    @property
    def title(self) -> str:
        """The kind, how often it happened, and to how many robots."""
        times = "" if len(self.spans) == 1 else f", {len(self.spans)} times"
        words = shortened(self.words, _LONGEST)
        return f"{words}{times} ({counted(len(self.robots), 'robot')})" if self.robots else f"{words}{times}"


def event_words(row: Mapping[str, Any]) -> str:
    """The action of a row of `events`, with its part, and its detail where `with_details` has added one."""
    return " ".join(filter(None, (row["do"], row["part"], row.get("detail", ""))))


def with_details(events: pl.DataFrame, scenario: str) -> pl.DataFrame:
    """The rows of one arena, with the column `detail`: what the scenario's event of this time and action changes.

    Empty for events that are not in the scenario's text.
    """
    with suppress(tomllib.TOMLDecodeError):
        table = tomllib.loads(scenario)
        details: dict[tuple[Any, ...], list[str]] = {}
        numbers = _numbers("radio", table.get("radio", {}))
        for event in sorted(table.get("events", []), key=itemgetter("at_s")):
            key = float(event["at_s"]), event["do"], str(event.get("part", ""))
            details.setdefault(key, []).append(_detail(event, numbers))
        turns: Counter[tuple[Any, ...]] = Counter()
        column: list[str] = []
        for row in events.iter_rows(named=True):
            key = row["at_s"], row["do"], row["part"]
            turn = turns[*key, row["ended"]]
            turns[*key, row["ended"]] += 1
            column.append(dict(enumerate(details.get(key, []))).get(turn, ""))
        return events.with_columns(pl.Series("detail", column, pl.String))
    return events


def _detail(event: Mapping[str, Any], numbers: dict[str, Any]) -> str:
    """The settings of a scenario's event; of a ramp from where to where, by the `numbers` before it."""
    for_s = f"for {number(event['for_s'])} s" if "for_s" in event else ""
    if event["do"] == "ramp":
        before = f"from {numbers[event['what']]} " if event["what"] in numbers else ""
        numbers[event["what"]] = event["to"]
        over = f"over {number(event['over_s'])} s" if event.get("over_s") else ""
        return " ".join(filter(None, (f"{event['what']} {before}to {event['to']}", over, for_s)))
    settings = [_setting(key, value) for key, value in event.items() if key not in _NO_SETTINGS]
    return ", ".join(filter(None, (*settings, for_s)))


def _setting(key: str, value: Any) -> str:
    """`bridge flock-0 flock-1`, `one_way`, `power_dbm -10.0`."""
    values = cast("list[Any]", value) if isinstance(value, list) else [] if value is True else [value]
    return " ".join([key, *map(str, values)])


def _numbers(path: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a table of the scenario and of those within it, by path."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= (
            _numbers(f"{path}.{key}", cast("dict[str, Any]", value))
            if isinstance(value, dict)
            else {f"{path}.{key}": value}
        )
    return found


def lanes_of(events: pl.DataFrame) -> list[Lane]:
    """The lanes of one arena's rows of `events`, by first occurrence.

    Rows of ends do not name their beginning: an end belongs to the first open one with the same robots, else to the
    first open one.
    """
    lanes: dict[str, Lane] = {}
    opened: dict[str, list[tuple[int, list[str]]]] = {}
    for row in events.iter_rows(named=True):
        words = event_words(row)
        lane, still_open = lanes.setdefault(words, Lane(words)), opened.setdefault(words, [])
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
    place, _ = ended
    lane.spans[place] = Span(lane.spans[place].from_s, row["time_s"])


def thinned(value: FloatArray, most: int = MAX_POINTS) -> IntArray:
    """The places to draw of a curve (T,), rising: all, or of each stretch the least and the greatest value.

    A stretch without any value keeps its first place, so that a gap stays one.
    """
    if len(value) <= most:
        return np.arange(len(value))
    kept: set[int] = {0, len(value) - 1}
    bounds = np.linspace(0, len(value), most // 2 + 1).astype(int).tolist()
    for first, after in pairwise(bounds):
        stretch = value[first:after]
        known = np.flatnonzero(np.isfinite(stretch))
        if not len(known):
            kept.add(first)
            continue
        kept |= {first + int(known[stretch[known].argmin()]), first + int(known[stretch[known].argmax()])}
    return np.array(sorted(kept))


@dataclass(frozen=True)
class RunData:
    """A run folder, and the data that most sections use."""

    folder: RunFolder
    static: Static
    summary: dict[str, Any] | None  # None: it was killed, or goes on
    started: dict[str, Any]  # run.json; empty: it is not there, or damaged
    scenario: str  # its text; empty: not there
    film: Film | str  # of the first arena, or why there is none
    lanes: list[Lane]  # its events
    events: pl.DataFrame | None

    @property
    def shown_name(self) -> str:
        """The folder's name, as a command takes it from beside the folder."""
        return shlex.quote(self.folder.path.resolve().name)

    @property
    def has_radio(self) -> bool:
        """Whether the robots have one."""
        return self.static.range_m is not None

    def record(self, name: str) -> dict[str, Any]:
        """The summary's entry of a recorded table; empty without one."""
        return {} if self.summary is None else dict(self.summary["record"].get(name, {}))

    def of_arena(self, part: str, arena: int = ARENA) -> Any:
        """The summary's `radio` or `metrics` of an arena; None without a summary."""
        found: Any = None if self.summary is None else self.summary[part]
        return cast("list[Any]", found)[arena] if isinstance(found, list) else found

    def table(self, name: str, arena: int | None = ARENA) -> pl.DataFrame | str:
        """`events`, `radio_distances` or `radio_links`, or why it cannot be had: not recorded, or damaged."""
        if not self.folder.files(name) and not (self.folder.path / name).is_dir():
            return f"`{name}` was not recorded."
        try:
            return self.folder.validated(name, arena)
        except BadInput as error:
            return f"{error}."

    def packets(self, columns: Sequence[str]) -> pl.DataFrame | str:
        """These columns of the packets of the first arena that reached or missed a receiver, or why there are none."""
        try:
            packets = self.folder.scan("packets")
            if packets is None:
                return "`packets` was not recorded."
            own = packets.filter((pl.col("arena") == ARENA) & pl.col("receiver").is_not_null())
            return own.select(*columns).drop_nulls().collect()
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
