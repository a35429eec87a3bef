"""The particle swarms: samples of their campaigns, tables of their numbers and panels of their figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import INK, SMALL_PT, SOFT, TEXT_PT, Look, plain_axes
from swarmwire.metrics.pictures.report.axes import ordered_colors
from swarmwire.metrics.pictures.report.page import blank_figure
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import Interval, Sample, time_sample
from swarmwire.metrics.statistics.summary import Summary, summary

FIRST, HALF = "first_time_s", "find_time_s"  # to the first robot within NEAR_M of the light, to half of them
NEAR_M, RATE_HZ = 0.5, 10
EVERY_S = 10.0  # between two distances that a digest keeps
COMPARED = ("robots", "particles", "robots - particles, p")
LIMIT_S = 300.0


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """The times of each run, whether there were obstacles, and by radio range also the distances over time."""
    varied = runs.columns[runs.columns.index("seed") + 1 : runs.columns.index("ended")]
    digest = runs.select("run", "point", "seed", *varied, "ended", "sim_time_s", HALF, "timing_wall_s")
    digest = digest.join(_first_times(folder), on="run", how="left", maintain_order="left")
    if "arena.obstacles" in varied:
        digest = digest.with_columns(obstacles=pl.col("arena.obstacles") != "[]").drop("arena.obstacles")
    if folder.name.startswith("pso-range"):
        digest = digest.join(_distances(folder), on="run", how="left", maintain_order="left")
    return digest


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


def quartiles(statistics: Summary) -> str:
    """The median with both quartiles, and the censored share where there is one."""
    three = [
        f"> {statistics.limit:.0f}" if np.isnan(time) else f"{time:.0f}"
        for time in (statistics.q50, statistics.q25, statistics.q75)
    ]
    late = f", {100.0 * statistics.censored:.0f} % not" if statistics.censored > 0.0 else ""
    return f"{three[0]} ({three[1]} to {three[2]}{late})"


def difference_text(first: Sample, second: Sample) -> str:
    """Second less first: means of min(time, limit) with their interval, and p."""
    effect = difference(first, second)
    p = "< 0.001" if effect.p < 0.001 else f"{effect.p:.2g}"
    return f"{effect.mean:+.0f} ({_interval(effect.mean_interval)}), {p}"


def mean_text(sample: Sample) -> str:
    """Mean of min(time, limit) with its interval."""
    statistics = summary(sample)
    return f"{statistics.mean:.0f} ({_interval(statistics.mean_interval)})"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _interval(interval: Interval) -> str:
    return f"{interval.low:.0f} to {interval.high:.0f}"


def _first_times(folder: Path) -> pl.DataFrame:
    """By run: when the first robot was within NEAR_M of the light; runs in which none was are missing."""
    near = pl.scan_parquet(folder / "series" / "*.parquet").filter(pl.col("target_best") <= NEAR_M)
    return near.group_by("run").agg((pl.col("tick").min() / RATE_HZ).alias(FIRST)).collect()


def _distances(folder: Path) -> pl.DataFrame:
    """By run: mean distance to the light in m, each EVERY_S from the start on, a list."""
    ticks = int(EVERY_S * RATE_HZ)
    sampled = pl.scan_parquet(folder / "series" / "*.parquet").filter(pl.col("tick") % ticks == 0)
    return sampled.sort("run", "tick").group_by("run", maintain_order=True).agg(distance_m="target_mean").collect()


def against_model(robots: pl.DataFrame, model: pl.DataFrame, column: str, name: str) -> str:
    """Time to the first and to half by what a column says, robots beside point particles."""
    head = [name, *(f"{event}: {agent}" for event in ("first", "half") for agent in COMPARED)]
    rows: list[list[str]] = []
    for value in robots[column].unique(maintain_order=True):
        row = [f"{value:g}"]
        for response in (FIRST, HALF):
            model_times, robot_times = (
                times(runs.filter(pl.col(column) == value), response) for runs in (model, robots)
            )
            row += [
                quartiles(summary(robot_times)),
                quartiles(summary(model_times)),
                difference_text(model_times, robot_times),
            ]
        rows.append(row)
    return table(head, rows)


def steps_table(steps: Sequence[tuple[str, pl.DataFrame]], base: pl.DataFrame) -> str:
    """Time to half in each step, and what it is more than in the base."""
    rows = [
        [label, *(quartiles(summary(times(runs, response))) for response in (FIRST, HALF)),
         mean_text(times(runs, HALF)),
         "" if runs is base else difference_text(times(base, HALF), times(runs, HALF))]
        for label, runs in steps
    ]  # fmt: skip
    return table(["", "first", "half", "mean up to 300 s", "more than the first line, p"], rows)


def variants_table(runs: pl.DataFrame, columns: Mapping[str, str]) -> str:
    """Time to the first and to half at each point of a design, told by these columns and what they are called."""
    rows: list[list[str]] = []
    for values in runs.select(*columns).unique(maintain_order=True).iter_rows():
        selected = at(runs, **dict(zip(columns, values, strict=True)))
        cells = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
        rows.append(
            [
                *cells,
                *(quartiles(summary(times(selected, response))) for response in (FIRST, HALF)),
                mean_text(times(selected, HALF)),
            ]
        )
    return table([*columns.values(), "first", "half", "half, mean up to 300 s"], rows)


@dataclass(frozen=True)
class Kind:
    """Who searched: what their campaigns' names end with, what they are called, and their colour."""

    suffix: str
    label: str
    color: str

    @property
    def look(self) -> Look:
        """Of their curves."""
        return {"color": self.color, "marker": "o", "ms": 3, "lw": 1.3, "zorder": 4, "label": self.label}


def panels(titles: Sequence[tuple[str, str]]) -> tuple[Any, list[Any]]:
    """A figure of two rows of three axes at most, each with what stands above it and below."""
    figure = blank_figure(7.2, 4.6 if len(titles) > 3 else 2.3)
    rows = -(-len(titles) // 3)
    panel_axes: list[Any] = []
    for k, (title, below) in enumerate(titles):
        low, height = (0.6 - 0.5 * (k // 3), 0.32) if rows > 1 else (0.2, 0.64)
        axes = plain_axes(figure, (0.05 + 0.325 * (k % 3), low, 0.265, height), title)
        axes.set_xlabel(below, fontsize=TEXT_PT, color=SOFT)
        panel_axes.append(axes)
    return figure, panel_axes


def times_by(runs: pl.DataFrame, column: str) -> tuple[list[float], list[Sample]]:
    """The values of a column, and the times to half at each."""
    column_values = values(runs, column)
    return column_values, [times(runs.filter(pl.col(column) == value), HALF) for value in column_values]


def time_curve(axes: Any, x: Sequence[float], samples: Sequence[Sample], look: Look) -> None:
    """Median times with their intervals; what lies beyond the limit is a triangle at it."""
    statistics = [summary(sample) for sample in samples]
    median = np.array([entry.q50 for entry in statistics])
    ends = [np.array([getattr(entry.q50_interval, end) for entry in statistics]) for end in ("low", "high")]
    low, high = (np.where(np.isfinite(end), end, LIMIT_S) for end in ends)
    axes.vlines(x, low, high, color=look["color"], lw=0.9, zorder=3)
    axes.plot(x, median, **look)
    beyond = np.isnan(median)
    mark: Look = {"ls": "", "marker": "^", "ms": 4, "mfc": "white", "mec": look["color"], "zorder": 5, "clip_on": False}
    axes.plot(np.array(x)[beyond], np.full(int(beyond.sum()), LIMIT_S), **mark)


def share_curve(axes: Any, x: Sequence[float], samples: Sequence[Sample], look: Look) -> None:
    """Share of the runs that came to it within the limit."""
    axes.plot(x, [1.0 - sample.censored for sample in samples], **look)


def distance_curves(axes: Any, runs: pl.DataFrame, ranges: Sequence[float], look: Look) -> None:
    """Mean distance to the light over time, a curve for each radio range, named at its end if it is solid."""
    for range_m, color in zip(ranges, ordered_colors(len(ranges)), strict=True):
        distance_m = mean_distances(at(runs, radio__range_m=range_m))
        axes.plot(EVERY_S * np.arange(len(distance_m)), distance_m, color=color, **look)
        if look["ls"] == "-":
            where: Look = {"fontsize": SMALL_PT, "color": color, "va": "center"}
            axes.text(EVERY_S * len(distance_m), distance_m[-1], f"{range_m:g} m", **where)


def ladder(axes: Any, steps: Sequence[tuple[str, pl.DataFrame, Any]]) -> None:
    """Mean time to half, up to the limit, with its interval, for each step; the first at the top."""
    for row, (_, runs, color) in enumerate(steps):
        statistics = summary(times(runs, HALF))
        axes.plot([statistics.mean_interval.low, statistics.mean_interval.high], [-row] * 2, color=color, lw=1.4)
        axes.plot(statistics.mean, -row, "o", ms=4, color=color)
    axes.set_yticks([-row for row in range(len(steps))], [label for label, _, _ in steps])
    axes.tick_params(axis="y", length=0, labelsize=SMALL_PT, labelcolor=INK)
    axes.set_ylim(-len(steps) + 0.4, 0.8)
    axes.grid(axis="x", color=SOFT, lw=0.3, alpha=0.5)
