"""Times and distances of the particle swarms' runs, as samples and in words."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import Interval, Sample, time_sample
from swarmwire.metrics.statistics.summary import Summary, summary

FIRST, HALF = "first_time_s", "find_time_s"  # to the first robot within NEAR_M of the light, to half of them
NEAR_M, RATE_HZ = 0.5, 10
EVERY_S = 10.0  # between two distances that a digest keeps


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """The times of each run, whether there were obstacles, and by radio range also the distances over time."""
    varied = runs.columns[runs.columns.index("seed") + 1 : runs.columns.index("ended")]
    kept = runs.select("run", "point", "seed", *varied, "ended", "sim_time_s", HALF, "timing_wall_s")
    kept = kept.join(_first_times(folder), on="run", how="left", maintain_order="left")
    if "arena.obstacles" in varied:
        kept = kept.with_columns(obstacles=pl.col("arena.obstacles") != "[]").drop("arena.obstacles")
    if folder.name.startswith("pso-range"):
        kept = kept.join(_distances(folder), on="run", how="left", maintain_order="left")
    return kept


def at(runs: pl.DataFrame, **values: Any) -> pl.DataFrame:
    """Runs whose columns have these values; `__` in a name stands for a dot."""
    for name, value in values.items():
        runs = runs.filter(pl.col(name.replace("__", ".")) == value)
    return runs


def times(runs: pl.DataFrame, column: str) -> Sample:
    """The times of a column, right-censored at the run's end."""
    observed = runs[column].is_not_null().to_numpy()
    return time_sample(runs[column].fill_null(runs["sim_time_s"]).to_numpy(), observed, runs["seed"].to_numpy())


def values(runs: pl.DataFrame, column: str) -> list[float]:
    """What a column takes, in the order of the runs."""
    return runs[column].unique(maintain_order=True).to_list()


def mean_distances(runs: pl.DataFrame) -> FloatArray:
    """Mean over runs of their distances, (times,)."""
    return np.mean(np.array(runs["distance_m"].to_list()), axis=0)


def quartiles(of: Summary) -> str:
    """The median with both quartiles, and the censored share where there is one."""
    three = [f"> {of.limit:.0f}" if np.isnan(time) else f"{time:.0f}" for time in (of.q50, of.q25, of.q75)]
    late = f", {100.0 * of.censored:.0f} % not" if of.censored > 0.0 else ""
    return f"{three[0]} ({three[1]} to {three[2]}{late})"


def difference_text(first: Sample, second: Sample) -> str:
    """Second less first: means of min(time, limit) with their interval, and p."""
    found = difference(first, second)
    p = "< 0.001" if found.p < 0.001 else f"{found.p:.2g}"
    return f"{found.mean:+.0f} ({_interval(found.mean_interval)}), {p}"


def mean_text(sample: Sample) -> str:
    """Mean of min(time, limit) with its interval."""
    of = summary(sample)
    return f"{of.mean:.0f} ({_interval(of.mean_interval)})"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _interval(of: Interval) -> str:
    return f"{of.low:.0f} to {of.high:.0f}"


def _first_times(folder: Path) -> pl.DataFrame:
    """By run: when the first robot was within NEAR_M of the light; runs in which none was are missing."""
    there = pl.scan_parquet(folder / "series" / "*.parquet").filter(pl.col("target_best") <= NEAR_M)
    return there.group_by("run").agg((pl.col("tick").min() / RATE_HZ).alias(FIRST)).collect()


def _distances(folder: Path) -> pl.DataFrame:
    """By run: mean distance to the light in m, each EVERY_S from the start on, a list."""
    ticks = int(EVERY_S * RATE_HZ)
    some = pl.scan_parquet(folder / "series" / "*.parquet").filter(pl.col("tick") % ticks == 0)
    return some.sort("run", "tick").group_by("run", maintain_order=True).agg(distance_m="target_mean").collect()
