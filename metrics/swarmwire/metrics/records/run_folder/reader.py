"""Reader of the run folders of runs that ended, were killed, or are live."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from types import NoneType
from typing import Any, TypeGuard, cast

import numpy as np
import polars as pl

from swarmwire.comms.base.config import check_format, from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import MetricInfo, metric_infos
from swarmwire.metrics.records.run_folder.layout import (
    DIGEST_BYTES,
    DIGESTS,
    RUN_FORMAT,
    RUN_JSON,
    STATIC,
    SUMMARY,
    SUMMARY_FORMAT,
    TABLES_FORMAT,
    VALUE,
)
from swarmwire.metrics.records.run_folder.tables import TABLES, read_static
from swarmwire.metrics.records.run_folder.ticks import movable_columns, robot_columns
from swarmwire.metrics.records.run_folder.writer import parts_of, scan_files, table_file
from swarmwire.metrics.records.table_file import corruption_errors

NUMBER, MAYBE_NUMBER = (int, float), (int, float, NoneType)
# Keys that are read from each item of a summary's `by_arena`, and from the summary.
ARENA_KINDS: Mapping[str, Any] = {
    "ended": str,
    "sim_time_s": NUMBER,
    "stop_time_s": MAYBE_NUMBER,
    "stopped_by": (str, NoneType),
    "ticks": int,
}
SUMMARY_KINDS: Mapping[str, Any] = {
    "arenas": int,
    "by_arena": list,
    "counts": dict,
    "cpu": str,
    "ended": str,
    "engine": str,
    "error": (str, NoneType),
    "events": list,
    "files": list,
    "global_sensors": dict,
    "inputs": (dict, NoneType),
    "live_events": (dict, NoneType),
    "lost_runners": list,
    "metrics": (dict, list),
    "mode": str,
    "radio": (dict, list, NoneType),
    "realtime_factor": NUMBER,
    "record": dict,
    "runner_events": list,
    "runners": int,
    "sim_time_s": NUMBER,
    "stop": list,
    "ticks": int,
    "trajectory_sha256": list,
    "versions": dict,
    "wall_time_s": NUMBER,
}
UNPROVEN_ROBOT_TICKS = 20_000_000  # largest number of ticks x robots to read without digests: about 1 GB
MAX_RETRIES = 3  # attempts to read the files of a live run, which may be joined meanwhile


class RunFolder:
    """Tables of a run as polars frames (`.to_pandas()` needs pyarrow, which the extra [view] installs).

    The tables of a killed or live run have the rows on disk; each call reads again. BadInput if a file is missing or
    damaged.
    """

    def __init__(self, path: Path | str) -> None:
        """Open a folder without reading it; BadInput if there is none."""
        self.path = Path(path)
        if not self.path.is_dir():
            raise BadInput(str(path), "", "expected a run folder: there is none")

    @property
    def summary(self) -> dict[str, Any] | None:
        """`summary.json`; None if the run has not ended, or was killed."""
        path = self.path / SUMMARY
        try:
            summary: object = from_json(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise BadInput(str(path), "", f"expected the summary of a run: {error}") from error
        check_format(summary, SUMMARY_FORMAT, str(path))
        if not _is_summary(summary):
            raise BadInput(str(path), "", "expected the summary of a run")
        return summary

    @cached_property
    def _static(self) -> Static:
        return read_static(self.path / STATIC)

    @property
    def static(self) -> Static:
        """Arena, bodies, groups and names."""
        return self._static

    @property
    def started(self) -> dict[str, Any]:
        """Content of `run.json`, the provenance of the run; empty if it is missing or damaged."""
        path = self.path / RUN_JSON
        try:
            content: object = from_json(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):  # callers that need the file report the fault
            return {}
        check_format(content, RUN_FORMAT, str(path))
        return cast("dict[str, Any]", content) if isinstance(content, dict) else {}

    @property
    def measured(self) -> dict[str, MetricInfo]:
        """Metrics that the run measured, by name; empty if `run.json` is missing or damaged."""
        try:
            return {info.name: info for info in metric_infos(self.started)}
        except (KeyError, TypeError, ValueError):
            return {}

    def table(
        self, name: str, arena: int | None = None, exclude: Sequence[str] = (), rows: pl.Expr | None = None
    ) -> pl.DataFrame:
        """Read a table by name, of one arena or of all, without the excluded columns; BadInput if there is none.

        `rows`: only the rows for which it is true.
        """
        self._refuse_other_format()
        for _ in range(MAX_RETRIES):
            files = self.files(name)
            if not files:
                break
            try:
                lazy = scan_files(files)
                self._refuse_size(name, lazy, files)
                if arena is not None:
                    lazy = lazy.filter(pl.col("arena") == arena)
                if rows is not None:
                    lazy = lazy.filter(rows)
                return lazy.drop(*exclude, strict=False).collect()
            except FileNotFoundError:
                continue  # the run ended just now, and its parts were joined
            except corruption_errors() as error:
                reason = str(error).splitlines()[0]
                expected = f"expected intact Parquet files ({reason}); see swarmwire verify"
                raise BadInput(self.where(name), "", expected) from error
        schema = TABLES[name].schema() if name in TABLES else {}
        if schema and (self.path / name).is_dir():  # a run that was killed before anything happened
            return pl.DataFrame(schema=schema)
        raise BadInput(str(self.path), name, "expected this table; the folder has no file of it")

    def scan(self, name: str) -> pl.LazyFrame | None:
        """Return a recorded table as a lazy frame; None if there is none.

        BadInput if its size or types cannot be those of the run.
        """
        files = self.files(name)
        if not files:
            return None
        lazy = scan_files(files)
        self._refuse_size(name, lazy, files)
        return lazy

    @property
    def max_ticks(self) -> int:
        """Upper bound of the ticks that tables can have rows of: from `run.json`, or else from `summary.json`.

        A manipulated file can claim any number, so a large one must be backed by the size of the digests. BadInput
        without `static.json`.
        """
        static, claimed = self.static, self.started.get("ticks")
        if not isinstance(claimed, int) and self.summary is not None:
            claimed = self.summary["ticks"]
        file = self.path / DIGESTS
        # The last tick's digest may not be written yet.
        digests = 1 + file.stat().st_size // DIGEST_BYTES if file.is_file() else 0
        limit = max(digests, UNPROVEN_ROBOT_TICKS // max(1, static.robots * static.arenas))
        return min(claimed, limit) if isinstance(claimed, int) else limit

    def size_fault(self, name: str, lazy: pl.LazyFrame, files: Sequence[Path]) -> str | None:
        """Return types or a number of rows that a run's table in `files` cannot have, in words; reads their footers."""
        if name not in TABLES:
            return None
        try:
            size_bytes = sum(file.stat().st_size for file in files)
            return TABLES[name].size_fault(lazy, self.static, self.max_ticks, size_bytes)
        except BadInput:  # another file is damaged; callers that need it report the fault
            lists = [kind.size for kind in lazy.collect_schema().values() if isinstance(kind, pl.Array)]
            rows, limit = lazy.select(pl.len()).collect().item(), UNPROVEN_ROBOT_TICKS // max([1, *lists])
            return f"{rows} rows, more than {limit}, and no {STATIC} that explains them" if rows > limit else None

    def _refuse_size(self, name: str, lazy: pl.LazyFrame, files: Sequence[Path]) -> None:
        fault = self.size_fault(name, lazy, files)
        if fault is not None:
            raise self._table_error(name, fault)

    def _table_error(self, name: str, fault: str) -> BadInput:
        return BadInput(self.where(name), "", f"expected a table as a run writes it, but {fault}; see swarmwire verify")

    def validated(self, name: str, arena: int | None = None, rows: pl.Expr | None = None) -> pl.DataFrame:
        """Read a table as `table` does, and check its values; BadInput for values that no run writes."""
        table = self.table(name, arena, rows=rows)
        fault = TABLES[name].fault(table.lazy(), self.static)
        if fault is not None:
            raise self._table_error(name, fault)
        return table

    def ticks(self, arena: int | None = None) -> pl.DataFrame:
        """Read a row per tick and arena, of one arena or of all; columns: see `ticks.Ticks`."""
        return self.table("ticks", arena)

    def robots(self, arena: int = 0) -> pl.DataFrame:
        """Read a row per tick and robot of one arena: tick, time_s, robot (name), group, the lists of `ticks`."""
        static, ticks = self.static, self.ticks(self._checked(arena))
        names = pl.Series(static.robot_names, dtype=pl.Enum(static.robot_names))
        group_names = [group.name for group in static.groups for _ in range(group.start, group.stop)]
        groups = pl.Series(group_names, dtype=pl.Enum([group.name for group in static.groups]))
        index = pl.Series(list(range(static.robots)) * len(ticks), dtype=pl.UInt32)
        return pl.DataFrame(
            [
                *(ticks[name].gather(_repeated(len(ticks), static.robots)) for name in ("tick", "time_s")),
                names.gather(index).alias("robot"),
                groups.gather(index).alias("group"),
                *(ticks[name].explode() for name in (*robot_columns(static), VALUE) if name in ticks.columns),
            ]
        )

    def metrics(self, arena: int = 0) -> pl.DataFrame:
        """Read a row per tick of one arena: tick, time_s, each metric, and the radio's counts."""
        lists = (*robot_columns(self.static), VALUE, *movable_columns(self.static))
        return self.table("ticks", self._checked(arena), [*lists, "arena", "seed"])

    def packets(self, arena: int | None = None) -> pl.DataFrame:
        """Read a row per packet and receiver within reach, of one arena or of all.

        Columns, and the packets without a row: see `packets.PacketsTable`.
        """
        return self.table("packets", arena)

    def events(self, arena: int | None = None) -> pl.DataFrame:
        """Read a row per event and arena, of one arena or of all; columns: see `events.Events`."""
        return self.table("events", arena)

    def radio_robots(self, arena: int | None = None) -> pl.DataFrame:
        """Read a row per robot, of one arena or of all, over the run; columns: see `radio_totals.RadioRobots`."""
        return self.table("radio_robots", arena)

    def radio_distances(self, arena: int | None = None) -> pl.DataFrame:
        """Read a row per bin of the distance between sender and receiver, of one arena or of all.

        Columns: see `distances.RadioDistances`.
        """
        return self.table("radio_distances", arena)

    def radio_links(self, arena: int | None = None) -> pl.DataFrame:
        """Read a row per link and fate that occurred on it, of one arena or of all; see `radio_totals.RadioLinks`."""
        return self.table("radio_links", arena)

    def files(self, name: str) -> list[Path]:
        """Return the files of a table: its file, else the parts on disk, else none."""
        file = table_file(self.path, name)
        return [file] if file.exists() else parts_of(self.path, name)

    def where(self, name: str) -> str:
        """Return the path of a table's file, or of the folder of its parts, for errors."""
        files = self.files(name)
        return str(files[0] if len(files) == 1 else self.path / name)

    def _refuse_other_format(self) -> None:
        """Raise BadInput if `static.json` states another format of the tables; without it they can still be read."""
        path = self.path / STATIC
        with suppress(OSError, ValueError):
            check_format(from_json(path.read_text(encoding="utf-8")), TABLES_FORMAT, str(path))

    def _checked(self, arena: int) -> int:
        if not 0 <= arena < self.static.arenas:
            raise BadInput(str(self.path), "arena", f"expected 0 to {self.static.arenas - 1}, got {arena}")
        return arena


def _repeated(rows: int, times: int) -> pl.Series:
    """Return 0 `times` times, then 1, and so on up to rows - 1."""
    return pl.Series(np.repeat(np.arange(rows, dtype=np.uint32), times))


def _is_summary(content: object) -> TypeGuard[dict[str, Any]]:
    """Return True if all keys that are read from a summary are present, with the right types."""
    if not _has_keys(content, SUMMARY_KINDS):
        return False
    hashes, ends = content["trajectory_sha256"], content["by_arena"]
    if content["ticks"] < 0 or not len(hashes) == len(ends) == content["arenas"]:
        return False
    return all(isinstance(item, str) for item in hashes) and all(_has_keys(end, ARENA_KINDS) for end in ends)


def _has_keys(content: object, kinds: Mapping[str, Any]) -> TypeGuard[dict[str, Any]]:
    """Return True for an object with all these keys, each of its type."""
    if not isinstance(content, dict):
        return False
    values = cast("dict[str, object]", content)
    return all(key in values and isinstance(values[key], kind) for key, kind in kinds.items())
