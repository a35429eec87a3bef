"""What is known of a run that is to be reported: its folder read, as far as there is something."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Static
from swarmwire.metrics.drawing.film import Film, film_of
from swarmwire.metrics.record.names import SCENARIO
from swarmwire.metrics.report.lanes import Lane, lanes_of
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.table_file import corruption_errors
from swarmwire.metrics.verify.sound_table import sound_table

if TYPE_CHECKING:
    import polars as pl

ARENA = 0  # whose pictures are drawn


@dataclass(frozen=True)
class RunData:
    """A run folder, and what most sections read of it."""

    folder: RunFolder
    static: Static
    summary: dict[str, Any] | None  # None: it was killed, or goes on
    started: dict[str, Any]  # run.json; empty: it is not there, or damaged
    scenario: str  # its text; empty: not there
    film: Film | str  # of the first arena, or why there is none
    lanes: list[Lane]  # its events
    events: "pl.DataFrame | None"

    @property
    def shown_name(self) -> str:
        """The folder's name, as a command takes it from beside the folder."""
        return shlex.quote(self.folder.path.resolve().name)

    @property
    def has_radio(self) -> bool:
        """Whether the robots have one."""
        return self.static.range_m is not None

    def record(self, name: str) -> dict[str, Any]:
        """What the summary says of a table that was recorded; empty without one."""
        return {} if self.summary is None else dict(self.summary["record"].get(name, {}))

    def of_arena(self, part: str, arena: int = ARENA) -> Any:
        """What the summary says of an arena: its `radio` or `metrics`; None without a summary."""
        found: Any = None if self.summary is None else self.summary[part]
        return cast("list[Any]", found)[arena] if isinstance(found, list) else found

    def table(self, name: str, arena: int | None = ARENA) -> "pl.DataFrame | str":
        """`events`, `radio_distances` or `radio_links`, or why it cannot be had: not recorded, or damaged."""
        if not self.folder.files(name) and not (self.folder.path / name).is_dir():
            return f"`{name}` was not recorded."
        read = {
            "events": self.folder.events,
            "radio_distances": self.folder.radio_distances,
            "radio_links": self.folder.radio_links,
        }[name]
        try:
            return sound_table(self.folder, name, read(arena))
        except BadInput as error:
            return f"{error}."

    def packets(self, columns: Sequence[str]) -> "pl.DataFrame | str":
        """These columns of the packets of the first arena that reached or missed a receiver, or why there are none."""
        import polars as pl

        files = self.folder.files("packets")
        if not files:
            return "`packets` was not recorded."
        try:
            own = pl.scan_parquet(files).filter((pl.col("arena") == ARENA) & pl.col("receiver").is_not_null())
            return own.select(*columns).drop_nulls().collect()
        except (OSError, *corruption_errors()) as error:
            return (
                f"{self.folder.where('packets')} cannot be read ({str(error).splitlines()[0]}); see `swarmwire verify`."
            )


def read_run(path: Path) -> RunData:
    """Read a run folder; BadInput where there is none, or its `static.json` or summary cannot be read."""
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
    return replace(data, lanes=lanes_of(events), events=events)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""
