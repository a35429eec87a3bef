"""How Lennard-Jones flocking holds its distances, and how often robots bump and dither, under loss and latency."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl

from swarmwire.metrics.statistics.sample import number_sample
from swarmwire.metrics.statistics.summary import Summary, interval_text, summary
from swarmwire.metrics.text import number_text

LOSS, LATENCY = "radio.loss", "radio.latency_s"
CAMPAIGNS = ("lennard-jones",)
SHOWN = {
    "nearest_neighbour.final": "to the nearest neighbour, m",
    "collisions.final": "collisions in 60 s",
    "oscillation.final": "changes of side a robot-minute",
    "target_mean.final": "to the light, m",
}
COLUMNS = (*SHOWN, "cohesion.final")


def points(runs: Mapping[str, pl.DataFrame], column: str) -> list[tuple[float, float, Summary]]:
    """Latency, loss, and a summary of the runs there."""
    groups = runs["lennard-jones"].sort(LATENCY, LOSS).group_by(LATENCY, LOSS, maintain_order=True)
    return [
        (float(latency), float(loss), summary(number_sample(group[column].cast(pl.Float64).to_numpy())))
        for (latency, loss), group in groups
    ]


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """A panel for each response over loss, a line for each latency: means with their intervals."""
    from swarmwire.metrics.pictures.drawing.canvas import INK, SOFT, TEXT_PT, plain_axes
    from swarmwire.metrics.pictures.report.axes import ordered_colors
    from swarmwire.metrics.pictures.report.page import blank_figure

    figure = blank_figure(6.4, 4.2)
    for k, (column, title) in enumerate(SHOWN.items()):
        results = points(runs, column)
        latencies = sorted({latency for latency, _, _ in results})
        axes = plain_axes(figure, (0.07 + 0.5 * (k % 2), 0.58 - 0.48 * (k // 2), 0.4, 0.34), title)
        for latency, color in zip(latencies, ordered_colors(len(latencies)), strict=True):
            loss, mean, low, high = np.array(
                [
                    (at, statistics.mean, *statistics.mean_interval)
                    for late, at, statistics in results
                    if late == latency
                ]
            ).T
            axes.plot(loss, mean, "o-", color=color, ms=2.5, lw=1.2, label=f"{latency:g} s late")
            axes.fill_between(loss, low, high, color=color, alpha=0.15, lw=0.0)
        axes.set_ylim(0.0, None)
        axes.set_xlabel("packet loss", fontsize=TEXT_PT, color=SOFT, labelpad=2)
        if k == 0:
            axes.legend(fontsize=TEXT_PT - 0.5, frameon=False, labelcolor=INK)
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Means over runs with their 95 % intervals."""
    columns = [points(runs, column) for column in SHOWN]
    rows = [
        f"| {late:g} s | {loss:g} | {statistics.n} | " + " | ".join(text(column[k][2]) for column in columns) + " |"
        for k, (late, loss, statistics) in enumerate(columns[0])
    ]
    head = f"| latency | loss | runs | {' | '.join(SHOWN.values())} |"
    return "\n".join((head, "| " + "--- | " * (3 + len(SHOWN)), *rows)).replace("| \n", "|\n")


def text(statistics: Summary) -> str:
    """A mean with its interval."""
    return f"{number_text(statistics.mean)} ({interval_text(statistics.mean_interval)})"
