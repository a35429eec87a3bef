"""Emulated runs that a log is held against: each tick's metrics of a run folder's arenas, or of a campaign's point."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.select import Selection
from swarmwire.metrics.campaign.spec import SERIES
from swarmwire.metrics.run_folder.reader import RunFolder
from swarmwire.metrics.table_file import corruption_errors, refuse_corrupt

if TYPE_CHECKING:
    import polars as pl

Radio = Mapping[str, Any]  # as in a summary: sent, intended, fates, latency_air_s, latency_agent_s
COUNTS = ("sent", "received", "in_range")  # the radio's, since the tick before, which run folders keep


@dataclass(frozen=True)
class EmulatedRun:
    """One arena with one seed."""

    seed: int
    series: Mapping[str, FloatArray]  # by metric: (ticks,) as `Metrics.values`; NaN: undefined
    radio: Radio | None  # None: no radio, or the run was killed
    duration_s: float
    counts: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])  # of COUNTS, (ticks,) each


@dataclass(frozen=True)
class EmulatedRuns:
    """Runs that differ in their seeds alone."""

    name: str
    runs: tuple[EmulatedRun, ...]
    rate_hz: int
    robots: int


def runs_of_folder(path: Path, metrics: tuple[str, ...]) -> EmulatedRuns:
    """The arenas of a run folder; BadInput where it has no table of ticks."""
    folder = RunFolder(path)
    static, summary = folder.static, folder.summary
    runs: list[EmulatedRun] = []
    for arena, seed in enumerate(static.seeds):
        table = folder.metrics(arena)
        radio = None if summary is None else _arena(summary["radio"], arena)
        series = {name: _floats(table[name]) for name in metrics if name in table.columns}
        counts = {name: _floats(table[name]) for name in COUNTS if name in table.columns}
        runs.append(EmulatedRun(seed, series, radio, len(table) / static.rate_hz, counts))
    return EmulatedRuns(path.name, tuple(runs), static.rate_hz, static.robots)


def runs_of_campaign(of: Selection, metrics: tuple[str, ...], rate_hz: int, robots: int) -> EmulatedRuns:
    """The runs of one design point that ended well.

    BadInput where several points are meant, the campaign kept no series, or no run ended well.
    """
    import polars as pl

    if len(of.points) != 1:
        paths = "".join(f"@{path}=VALUE" for path in of.campaign.parameters)
        raise BadInput(of.text, "", f"expected one design point of {len(of.points)}: {of.campaign.path}{paths}")
    files = sorted(of.campaign.path.joinpath(SERIES).glob("*.parquet"))
    if not files:
        raise BadInput(of.text, SERIES, "expected the metrics of each tick, which --no-series leaves out")
    rows = of.campaign.runs.filter((pl.col("point") == of.points[0]) & (pl.col("ended") != "failed"))
    wanted = rows["run"].to_list()
    try:
        table = pl.concat([pl.scan_parquet(file) for file in files], how="diagonal")
        table = table.filter(pl.col("run").is_in(wanted)).collect()
    except (OSError, *corruption_errors()) as error:
        refuse_corrupt(files)
        raise BadInput(of.text, SERIES, f"expected whole Parquet files: {str(error).splitlines()[0]}") from None
    by_run = {int(key[0]): ticks for key, ticks in table.partition_by("run", as_dict=True).items()}
    runs = tuple(
        EmulatedRun(
            int(row["seed"]),
            {name: _floats(by_run[row["run"]][name]) for name in metrics if name in table.columns},
            _radio_of(row),
            len(by_run[row["run"]]) / rate_hz,
        )
        for row in rows.iter_rows(named=True)
        if row["run"] in by_run
    )
    if not runs:
        raise BadInput(of.text, "", "expected a run that ended well, with its series")
    return EmulatedRuns(of.campaign.about.name, runs, rate_hz, robots)


def _radio_of(row: dict[str, Any]) -> Radio | None:
    """The columns of a campaign's row as a summary has them."""
    if row.get("radio.sent") is None:
        return None
    latencies = {
        name: {p: row.get(f"radio.{name}.{p}") for p in ("p50", "p90", "p99")}
        for name in ("latency_air_s", "latency_agent_s")
    }
    fates = {key.removeprefix("radio.fates."): n for key, n in row.items() if key.startswith("radio.fates.")}
    return {"sent": row["radio.sent"], "intended": row["radio.intended"], "fates": fates, **latencies}


def _arena(radio: Any, arena: int) -> Radio:
    return cast("list[Radio]", radio)[arena] if isinstance(radio, list) else radio


def _floats(column: "pl.Series") -> FloatArray:
    import polars as pl

    return column.cast(pl.Float64).fill_null(float("nan")).to_numpy().astype(np.float64)
