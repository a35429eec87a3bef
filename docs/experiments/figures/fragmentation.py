"""Fragmentation: flocks that an obstacle, a partition or a jammer splits: how many re-join, and how soon."""

# pyright: basic, reportUnknownMemberType=false

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import SMALL_PT, SOFT, TEXT_PT, plain_axes
from swarmwire.metrics.pictures.report.axes import ordered_colors
from swarmwire.metrics.pictures.report.page import blank_figure
from swarmwire.metrics.statistics.bootstrap import binomial_interval
from swarmwire.metrics.statistics.sample import Sample, time_sample
from swarmwire.metrics.statistics.summary import quartiles_text, summary

CAMPAIGNS = ("fragmentation-obstacle", "fragmentation-partition", "fragmentation-jammer")
COLUMNS = ("fragmentations.final", "fragmented.mean", "unrejoined.final", "rejoin_median.final", "rejoin_worst.final")

HOLD_S = 2.0  # as in the scenarios: a shorter split is none
AT_S, FOR_S = "events.0.at_s", "events.0.for_s"  # when a disturbance begins, and how long it lasts
OBSTACLES, WIDTH = "arena.obstacles", "width_m"  # the rock as it was varied, and what is kept of it
APART = 0.012  # of the axis, between curves


@dataclass(frozen=True)
class Cause:
    """What splits the flock, and over what it is varied."""

    title: str
    along: str  # path
    axis: str
    kind: str  # path of what tells the curves apart
    kind_title: str
    label: str


CAUSES = {
    "fragmentation-obstacle": Cause("an obstacle", WIDTH, "width of the rock in m", "radio.loss", "loss", "loss {:g}"),
    "fragmentation-partition": Cause(
        "a partition", FOR_S, "duration of the partition in s", AT_S, "from when on, s", "from {:g} s on"
    ),
    "fragmentation-jammer": Cause(
        "a jammer", FOR_S, "duration of the jamming in s", AT_S, "from when on, s", "from {:g} s on"
    ),
}


def digested(_folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """The columns, and of a rock its width."""
    varied = runs.columns[runs.columns.index("seed") + 1 : runs.columns.index("ended")]
    digest = runs.select(
        "run", "point", "seed", *varied, "ended", "stop_time_s", "sim_time_s", *COLUMNS, "timing_wall_s"
    )
    if OBSTACLES not in varied:
        return digest
    width_m = [2.0 * max(x for x, _ in json.loads(text)[0]["points"]) for text in digest[OBSTACLES]]
    return digest.with_columns(pl.Series(OBSTACLES, width_m, pl.Float64)).rename({OBSTACLES: WIDTH})


def fell_apart(runs: pl.DataFrame) -> pl.DataFrame:
    """The runs with at least one fragmentation."""
    return runs.filter(pl.col("fragmentations.final") > 0)


def times_apart(runs: pl.DataFrame) -> Sample:
    """How long each flock that fell apart took to be whole again, right-censored at the run's end.

    From the end of the disturbance on, 0 if it was whole by then; of an obstacle, which does not end, the time that the
    flock was in pieces.
    """
    runs = fell_apart(runs)
    observed = runs["stop_time_s"].is_not_null().to_numpy()
    if FOR_S in runs.columns:
        ended_s = runs["stop_time_s"].fill_null(runs["sim_time_s"]) - (runs[AT_S] + runs[FOR_S])
    else:
        ended_s = runs["fragmented.mean"] * runs["sim_time_s"] + HOLD_S * runs["fragmentations.final"]
    return time_sample(np.maximum(ended_s.to_numpy(), 0.0), observed, runs["seed"].to_numpy())


def points(runs: pl.DataFrame, cause: Cause) -> Iterator[tuple[float, float, pl.DataFrame]]:
    """What tells the curves apart, place along the axis, and the runs there, in order."""
    for kind in runs[cause.kind].unique().sort():
        for along in runs[cause.along].unique().sort():
            yield kind, along, runs.filter((pl.col(cause.kind) == kind) & (pl.col(cause.along) == along))


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """A column for each cause: the share of runs that fall apart and re-join above, the time to re-join below."""
    figure = blank_figure(7.2, 4.3)
    for k, (name, cause) in enumerate((name, CAUSES[name]) for name in runs):
        left = 0.06 + 0.32 * k
        share = plain_axes(figure, (left, 0.6, 0.26, 0.3), f"{cause.title}: share of runs")
        time = plain_axes(figure, (left, 0.1, 0.26, 0.33), "until whole again, s: quartiles")
        share.set_ylim(-0.03, 1.03)
        time.set_xlabel(cause.axis, fontsize=TEXT_PT, color=SOFT)
        _draw_cause(share, time, runs[name], cause)
    return figure


def _draw_cause(share: Any, time: Any, runs: pl.DataFrame, cause: Cause) -> None:
    kinds = runs[cause.kind].unique().sort().to_list()
    along = runs[cause.along].unique().sort().to_numpy()
    table = {(kind, value): group for kind, value, group in points(runs, cause)}
    for k, (kind, color) in enumerate(zip(kinds, ordered_colors(len(kinds)), strict=True)):
        groups = [table[kind, value] for value in along]
        x = along + (k - 0.5 * (len(kinds) - 1)) * APART * float(np.ptp(along))
        split = np.array([len(fell_apart(group)) for group in groups])
        rejoined = np.array([np.count_nonzero(times_apart(group).observed) for group in groups])
        n = np.array([len(group) for group in groups])
        share.plot(x, split / n, "o:", color=color, ms=3.0, lw=0.8, mfc="white")
        low, high = binomial_interval(rejoined, np.maximum(n, 1))
        share.plot(x, rejoined / n, "o-", color=color, ms=3.0, lw=1.0, label=cause.label.format(kind))
        share.vlines(x, low, high, color=color, lw=0.8)
        _draw_times(time, x, [times_apart(group) for group in groups], color)
    time.set_ylim(0.0, None)
    share.legend(
        fontsize=SMALL_PT,
        frameon=False,
        loc="best",
        title="hollow: fell apart\nfull: and re-joined",
        title_fontsize=SMALL_PT,
    )


def _draw_times(axes: Any, x: FloatArray, samples: list[Sample], color: Any) -> None:
    """Medians and quartiles; what lies beyond the limit is left out."""
    summaries = [summary(sample) for sample in samples]
    axes.plot(x, [statistics.q50 for statistics in summaries], "o-", color=color, ms=3.0, lw=1.0)
    top = [statistics.limit if np.isnan(statistics.q75) else statistics.q75 for statistics in summaries]
    axes.vlines(x, [statistics.q25 for statistics in summaries], top, color=color, lw=0.8)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """A table for each cause."""
    return "\n\n".join(_table(runs[name], cause) for name, cause in CAUSES.items() if name in runs)


def _table(runs: pl.DataFrame, cause: Cause) -> str:
    heads = cause.axis, cause.kind_title, "fell apart", "re-joined", "whole at its end", "until whole again, s"
    lines = [" | ".join(heads), " | ".join(["---"] * len(heads))]
    for kind, along, group in points(runs, cause):
        times = times_apart(group)
        rejoined = int(np.count_nonzero(times.observed))
        at_end = str(np.count_nonzero(times.value == 0.0)) if cause.along == FOR_S else "–"
        cells = f"{along:g}", f"{kind:g}", f"{len(times)} of {len(group)}", _share(rejoined, len(times)), at_end
        lines.append(" | ".join((*cells, quartiles_text(summary(times)))))
    title = f"Split by {cause.title}; times are medians with quartiles, censored runs counted as such:\n\n"
    return title + "\n".join(f"| {line} |" for line in lines)


def _share(successes: int, n: int) -> str:
    if n == 0:
        return "–"
    low, high = binomial_interval(np.array([successes]), np.array([n]))
    return f"{successes} of {n} ({100 * low[0]:.0f} to {100 * high[0]:.0f} %)"
