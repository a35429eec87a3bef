"""Movement with avoidance: collisions, coverage, straightness and deadlocks by the sizes of arena and obstacles."""

# pyright: basic, reportUnknownMemberType=false

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from swarmwire.metrics.pictures.drawing.canvas import ACCENT, SMALL_PT, SOFT, TEXT_PT, plain_axes
from swarmwire.metrics.pictures.report.axes import ordered_colors
from swarmwire.metrics.pictures.report.page import blank_figure
from swarmwire.metrics.statistics.sample import Interval, number_sample
from swarmwire.metrics.statistics.summary import Summary, summary

CAMPAIGNS = ("movement",)
MEASURES = {
    "collision_rate.final": "collisions a robot-hour",
    "wall_contacts.final": "contacts with walls and obstacles",
    "coverage.final": "share of the floor covered",
    "path_efficiency.final": "net way / path",
    "oscillation.final": "changes of side a robot-minute",
    "deadlocked.mean": "share of the robots deadlocked",
}
COLUMNS = tuple(MEASURES)

ARENA, OBSTACLE, FAINT = "arena.size_m", "arena.obstacles.0.radius_m", "robots.walkers.params.detection_threshold"
BLIND = 2.0  # no ray answers so much
SHOWN = ("coverage.final", "oscillation.final", "deadlocked.mean")


def side_m(size: str) -> float:
    """The side of a square arena, as the table has its size."""
    return float(json.loads(size)[0])


def points(runs: pl.DataFrame) -> list[tuple[float, float, bool, pl.DataFrame]]:
    """Side and radius in m, whether the robots look, and the runs, by point."""
    groups = runs.group_by(ARENA, OBSTACLE, FAINT, maintain_order=True)
    return [
        (side_m(size), float(radius), detection_threshold < BLIND, group)
        for (size, radius, detection_threshold), group in groups
    ]


def mean_of(runs: pl.DataFrame, measure: str) -> Summary:
    """A measure over the runs of a point."""
    return summary(number_sample(runs[measure].cast(pl.Float64).to_numpy()))


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Coverage, changes of side and deadlocks over the arena's side, a curve for each size of obstacle."""
    figure = blank_figure(7.2, 2.4)
    results = points(runs["movement"])
    radii = sorted({radius for _, radius, _, _ in results})
    for column, measure in enumerate(SHOWN):
        axes = plain_axes(figure, (0.05 + 0.325 * column, 0.18, 0.28, 0.68), MEASURES[measure])
        for radius, color in zip(radii, ordered_colors(len(radii)), strict=True):
            curve = [(side, mean_of(group, measure)) for side, r, looks, group in results if r == radius and looks]
            _curve(axes, curve, color, f"obstacles of {2.0 * radius:g} m", "-")
        blind = [(side, mean_of(group, measure)) for side, r, looks, group in results if r == radii[0] and not looks]
        if measure != "oscillation.final":  # who goes straight has no side
            _curve(axes, blind, ACCENT, f"without looking, {2.0 * radii[0]:g} m", ":")
        axes.set_ylim(bottom=0.0)
        axes.set_xticks(sorted({side for side, _, _, _ in results}))
        axes.set_xlabel("side of the arena, m", fontsize=TEXT_PT, color=SOFT)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.axes[1].legend(handles, labels, fontsize=SMALL_PT, frameon=False, loc="upper right")
    return figure


def _curve(axes: Any, curve: Sequence[tuple[float, Summary]], color: Any, label: str, line: str) -> None:
    sides = [side for side, _ in curve]
    axes.vlines(sides, *np.array([statistics.mean_interval for _, statistics in curve]).T, color=color, lw=0.9)
    axes.plot(sides, [statistics.mean for _, statistics in curve], f"o{line}", color=color, ms=3.2, lw=1.0, label=label)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Every measure at every point, those that look and then those that do not."""
    head = ("arena, m", "obstacles, m", "robots", *MEASURES.values())
    rows: list[Sequence[str]] = [head, ("---",) * len(head)]
    for looking in (True, False):
        for side, radius, looks, group in points(runs["movement"]):
            if looks == looking:
                readers = "look" if looks else "do not look"
                summaries = [mean_of(group, name) for name in MEASURES]
                rows.append(
                    (
                        f"{side:g} x {side:g}",
                        f"{2.0 * radius:g}",
                        readers,
                        *(_within(statistics.mean, statistics.mean_interval) for statistics in summaries),
                    )
                )
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    every = runs["movement"]
    failed = every.filter(pl.col("ended") == "failed").height
    without = f", less {failed} of all {every.height} that failed" if failed else ""
    return f"Runs a point: {every['seed'].n_unique()}{without}.\n\n{table}"


def _within(mean: float, interval: Interval) -> str:
    return f"{mean:.3g} ({interval.low:.3g} to {interval.high:.3g})"
