"""The columns of `summary.parquet`: their order and their types, whichever run came first."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from swarmwire.deploy.campaign.responses import STOP_TIME
from swarmwire.deploy.campaign.task import Row
from swarmwire.metrics.campaign.formats import FAILED

if TYPE_CHECKING:
    import polars as pl

KEYS = ("run", "point", "seed")
ENDS = ("ended", "error", "ticks", "sim_time_s", "trajectory_sha256")
STOPPED_BY = "stopped_by"
MACHINE = ("timing_wall_s", "machine_cpu", "machine_host", "machine_worker")
FIXED = {*KEYS, *ENDS, STOP_TIME, STOPPED_BY, *MACHINE}
COUNTS, FATES = "counts.", "radio.fates."
WHOLE = {*KEYS, "ticks", "radio.sent", "radio.intended", "radio.in_range"}
TEXTS = {"ended", "error", "trajectory_sha256", STOPPED_BY, "machine_cpu", "machine_host", "machine_worker"}
Values = Mapping[str, Sequence[Any]]  # by varied path: all the values that it takes


class Columns:
    """The columns of one campaign's rows."""

    def __init__(self, varied: Values, responses: Sequence[str]) -> None:
        """`responses` in order; a time of stopping among them brings its cause along."""
        self._varied = {path: _type_of(values) for path, values in varied.items()}
        after = [name for name in responses if name != STOP_TIME]
        stop = [STOP_TIME, STOPPED_BY] if STOP_TIME in responses else []
        self._known = [*KEYS, *varied, *ENDS, *stop, *after]

    def frame(self, rows: Sequence[Row]) -> "pl.DataFrame":
        """Rows as a table: all columns that are known, null where a row lacks them, and the counts of any row."""
        import polars as pl

        counts = sorted({name for row in rows for name in row if name.startswith(COUNTS)})
        names = [*self._known, *counts, *MACHINE]
        types = {"whole": pl.Int64(), "text": pl.String(), "number": pl.Float64(), "truth": pl.Boolean()}
        schema = {name: types[self._type(name)] for name in names}
        return pl.DataFrame([{name: self._cell(name, row.get(name)) for name in names} for row in rows], schema)

    def joined(self, frames: Iterable["pl.DataFrame"]) -> "pl.DataFrame":
        """The tables of several tasks as one, by run, of each run the last row; what was never counted was 0."""
        import polars as pl

        whole = pl.concat(frames, how="diagonal").unique(subset="run", keep="last").sort("run")
        counts = sorted(name for name in whole.columns if name.startswith(COUNTS))
        zero = pl.when(pl.col("ended") != FAILED).then(pl.col(counts).fill_null(0)).otherwise(pl.col(counts))
        return whole.with_columns(zero if counts else []).select(*self._known, *counts, *MACHINE)

    def _type(self, name: str) -> str:
        if name in self._varied:
            return self._varied[name]
        if name in WHOLE or name.startswith((COUNTS, FATES)):
            return "whole"
        return "text" if name in TEXTS else "number"

    def _cell(self, name: str, value: Any) -> Any:
        if value is None or self._type(name) in ("whole", "truth"):
            return value
        if self._type(name) == "number":
            return float(value)
        return value if isinstance(value, str) else json.dumps(value)


def _type_of(values: Sequence[Any]) -> str:
    """Of a varied path's column: texts hold what has no column type, as JSON."""
    kinds: set[type] = {type(value) for value in values}
    if kinds == {bool}:
        return "truth"
    if kinds <= {int, float}:
        return "whole" if kinds == {int} else "number"
    return "text"
