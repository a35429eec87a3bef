"""Resilience: efficiency of coverage and of search over the share of dead robots, on a line or exponentially."""

# pyright: basic, reportUnknownMemberType=false

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SMALL_PT, SOFT, TEXT_PT, plain_axes
from swarmwire.metrics.pictures.report.page import blank_figure
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import number_sample
from swarmwire.metrics.statistics.summary import summary
from swarmwire.metrics.statistics.trends import Degradation, Fit, degradation, relative_to_unharmed

COVERAGE, SEARCH = "resilience-coverage", "resilience-search"
CAMPAIGNS = (COVERAGE, SEARCH)
COLUMNS = ()  # `digested` chooses

AGENT = "robots.swarm.agent"
TIMES = {COVERAGE: "coverage_time_s", SEARCH: "find_time_s"}
RATES_HZ = {COVERAGE: 5, SEARCH: 10}  # ticks, as in the scenarios
AREA_AT_S = {COVERAGE: 30.0, SEARCH: 20.0}  # when hardly any run is over
NEAR_M = 0.5  # of the light
UPDATE_S = 10.0  # of a particle's velocity: who starts beside the light has not searched


@dataclass(frozen=True)
class Reading:
    """One way to say how much a swarm does."""

    label: str
    campaign: str
    column: str
    agent: str = ""  # of the campaign's agents; "": it has one
    is_time: bool = True  # efficiency is its reciprocal
    floor_s: float = 0.1  # a shorter time counts as this


READINGS = (
    Reading("Coverage: 1 / time to 90 %", COVERAGE, "time_s", "Coverage"),
    Reading("Coverage: area in 30 s", COVERAGE, "area", "Coverage", is_time=False),
    Reading("RandomWalk: 1 / time to 90 %", COVERAGE, "time_s", "RandomWalk"),
    Reading("RandomWalk: area in 30 s", COVERAGE, "area", "RandomWalk", is_time=False),
    Reading("PsoSearch: 1 / time to half", SEARCH, "time_s"),
    Reading("PsoSearch: 1 / time to the first", SEARCH, "first_s", floor_s=UPDATE_S),
    Reading("PsoSearch: area in 20 s", SEARCH, "area", is_time=False),
)


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """By run: the share disabled, who they were, and what they did: times in s, null if not, and the area covered."""
    campaign = _campaign(runs)
    series = pl.scan_parquet(folder / "series" / "*.parquet")
    at = series.filter(pl.col("tick") == int(AREA_AT_S[campaign] * RATES_HZ[campaign]))
    columns = [pl.col("run", "point", "seed"), _disabled(runs), pl.col(TIMES[campaign]).alias("time_s")]
    if AGENT in runs.columns:
        columns.append(pl.col(AGENT).str.split(":").list.last().alias("agent"))
    digest = runs.select(*columns, "ended", "sim_time_s", "timing_wall_s")
    tables = [at.select("run", area="coverage")]
    if campaign == SEARCH:
        near = series.filter(pl.col("target_best") <= NEAR_M)
        tables.append(near.group_by("run").agg(first_s=pl.col("tick").min() / RATES_HZ[campaign]))
    for table in tables:
        digest = digest.join(table.collect(), on="run", how="left", maintain_order="left")
    return digest


def _campaign(runs: pl.DataFrame) -> str:
    return next(name for name, column in TIMES.items() if column in runs.columns)


def _disabled(runs: pl.DataFrame) -> pl.Series:
    events = [json.loads(text) for text in runs["events"]]
    return pl.Series(
        "disabled", [run_events[0]["robots"]["share"] if run_events else 0.0 for run_events in events], pl.Float64
    )


def efficiency(runs: Mapping[str, pl.DataFrame], reading: Reading) -> tuple[FloatArray, FloatArray]:
    """Shares disabled (k,), and efficiency relative to the mean with none (k, seeds); NaN: no value.

    A time that a run did not come to counts as the run's length, which makes it look better than it was.
    """
    selected = runs[reading.campaign].filter(pl.col("ended") != "failed")
    selected = selected.filter(pl.col("agent") == reading.agent) if reading.agent else selected
    value = pl.col(reading.column)
    value = 1.0 / value.fill_null(pl.col("sim_time_s")).clip(reading.floor_s) if reading.is_time else value
    table = (
        selected.select("disabled", "seed", value=value)
        .pivot("seed", index="disabled", values="value")
        .sort("disabled")
    )
    share = table["disabled"].to_numpy()
    return share, relative_to_unharmed(share, table.drop("disabled").to_numpy().astype(np.float64))


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """A panel for each pair: 1 / time and area, of both coverers and of the search; lines are the better fits."""
    figure = blank_figure(7.2, 2.6)
    panels = (READINGS[:2], READINGS[2:4], READINGS[4:])
    for k, readings in enumerate(panel for panel in panels if panel[0].campaign in runs):
        title = f"{readings[0].label.partition(':')[0]}: efficiency"
        axes = plain_axes(figure, (0.05 + 0.325 * k, 0.17, 0.28, 0.7), title)
        axes.plot([0.0, 0.5], [1.0, 0.5], color=SOFT, lw=0.8, ls=":")
        for reading, color in zip(readings, (CURVE, ACCENT, "#5b8c5a"), strict=False):
            _draw_reading(axes, *efficiency(runs, reading), reading.label.partition(": ")[2], color)
        axes.set_ylim(0.0, 1.25)
        axes.set_xlabel("share of robots disabled", fontsize=TEXT_PT, color=SOFT)
        axes.legend(fontsize=SMALL_PT, frameon=False, loc="lower left")
    return figure


def _draw_reading(axes: Any, share: FloatArray, table: FloatArray, label: str, color: Any) -> None:
    summaries = [summary(number_sample(row)) for row in table]
    axes.vlines(share, *np.array([statistics.mean_interval for statistics in summaries]).T, color=color, lw=0.9)
    axes.plot(share, [statistics.mean for statistics in summaries], "o", color=color, ms=3.2, label=label)
    fits = degradation(share, table)
    if fits is not None:
        fine = np.linspace(0.0, float(share[-1]), 51)
        axes.plot(fine, fits.better.evaluate(fine), color=color, lw=1.0)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """The fits of each reading, what is left at 5 % and 50 %, and how many runs did not finish."""
    head = (
        "efficiency",
        "left at 5 %",
        "left at 50 %",
        "slope of the line",
        "exponent",
        "AIC line less exp",
        "unfinished",
    )
    lines = [head, ("---",) * len(head)]
    for reading in READINGS:
        if reading.campaign not in runs:
            continue
        share, table = efficiency(runs, reading)
        fits = degradation(share, table)
        shares = [_left(share, table, at) for at in (0.05, 0.5)]
        lines.append((reading.label, *shares, *_fits(fits), _unfinished(runs, reading)))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _left(share: FloatArray, table: FloatArray, at: float) -> str:
    """Mean relative efficiency at a share, with the interval of its difference, seed by seed, to none disabled."""
    rows = np.flatnonzero(np.isclose(share, at))
    if not len(rows):
        return "–"
    effect = difference(number_sample(table[0]), number_sample(table[rows[0]]))
    low, high = effect.mean_interval
    return f"{1.0 + effect.mean:.3f} ({1.0 + low:.3f} to {1.0 + high:.3f})"


def _fits(fits: Degradation | None) -> tuple[str, str, str]:
    if fits is None:
        return "–", "–", "–"
    apart = fits.linear.aic - fits.exponential.aic
    form = fits.better.form if fits.is_clear else "undecided"
    return _slope(fits.linear), _slope(fits.exponential), f"{apart:+.1f}: {form}"


def _slope(fit: Fit) -> str:
    return f"{fit.b:.2f} ({fit.b_interval.low:.2f} to {fit.b_interval.high:.2f})"


def _unfinished(runs: Mapping[str, pl.DataFrame], reading: Reading) -> str:
    if not reading.is_time:
        return "–"
    selected = runs[reading.campaign]
    selected = selected.filter(pl.col("agent") == reading.agent) if reading.agent else selected
    return f"{selected[reading.column].null_count()} of {len(selected)}"
