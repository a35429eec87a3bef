"""The events of an arena as lanes: for each kind when it began, and when each occurrence was over."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from swarmwire.metrics.report.in_words import counted

if TYPE_CHECKING:
    import polars as pl


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
        return f"{self.words}{times} ({counted(len(self.robots), 'robot')})" if self.robots else f"{self.words}{times}"


def lanes_of(events: "pl.DataFrame") -> list[Lane]:
    """The lanes of one arena's rows of `events`, by first occurrence.

    Rows do not say which of several occurrences an end belongs to: it is the first that is open and changed the same
    robots, else the first that is open.
    """
    lanes: dict[str, Lane] = {}
    opened: dict[str, list[tuple[int, list[str]]]] = {}
    for row in events.iter_rows(named=True):
        words = f"{row['do']} {row['part']}".strip()
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
