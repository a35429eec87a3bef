"""The loss map: success of avoidance, flocking and search over packet loss and latency, independent and in bursts."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import FAINT, INK, LONG_SIDE_IN, SMALL_PT, SOFT, TEXT_PT, new_figure
from swarmwire.metrics.statistics.bootstrap import binomial_interval
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import Interval, Sample, number_sample

RADIOS = ("", "-bursts")
BEHAVIOURS = ("avoidance", "flocking", "pso")
CHECKS = {  # each beside the column without losses of the map whose break it explains
    "loss-map-avoidance-told": ("avoidance", "agents know the latency"),
    "loss-map-pso-early": ("pso", "bests sent 3 s before an update"),
}
CAMPAIGNS = (*(f"loss-map-{behaviour}{radio}" for behaviour in BEHAVIOURS for radio in RADIOS), *CHECKS)
COLUMNS = ("radio.link_pdr",)

TITLES = {
    "avoidance": "avoidance\nno contact in 60 s",
    "flocking": "flocking\none flock within 60 s",
    "pso": "particle swarm search\nhalf at the light within 150 s",
}
LABELS = {"": "independent loss", "-bursts": "bursts of 2 s"}
STOPPED_IS_FAILURE = ("avoidance",)  # the others end once they have succeeded
LOSSES = ("radio.loss", "radio.bursts.mean_loss")
CELLS = ((0.0, 0.0), (0.9, 0.0), (0.0, 0.5), (0.9, 0.5), (0.0, 2.0), (0.5, 2.0), (0.9, 2.0))  # that are told
HEIGHT_IN = 3.65
HALF = 0.5 - 1e-6  # a cell of just one half is within the line
COLORS = "cividis"  # as ordered for those who cannot tell red from green


def results(runs: pl.DataFrame, behaviour: str) -> pl.DataFrame:
    """A row per run: loss, latency_s, seed, success; runs that failed to run are left out."""
    loss = next((pl.col(name) for name in LOSSES if name in runs.columns), pl.lit(0.0))
    stopped = pl.col("stop_time_s").is_not_null()
    success = ~stopped if behaviour in STOPPED_IS_FAILURE else stopped
    ran = runs.filter(pl.col("ended") != "failed")
    latency = pl.col("radio.latency_s").alias("latency_s")
    return ran.select(loss.alias("loss"), latency, "seed", "radio.link_pdr", success.alias("success"))


def shares(runs: pl.DataFrame) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Losses (columns,), latencies in s (rows,), and the share of runs that succeed (rows, columns)."""
    table = runs.group_by("latency_s", "loss").agg(pl.col("success").mean()).sort("latency_s", "loss")
    losses, latencies = table["loss"].unique().sort().to_numpy(), table["latency_s"].unique().sort().to_numpy()
    return losses, latencies, table["success"].to_numpy().reshape(len(latencies), len(losses))


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """A map for each behaviour (columns) and kind of loss (rows), with one scale of colours."""
    figure = new_figure(LONG_SIDE_IN, HEIGHT_IN, 1280)
    figure.set_layout_engine("constrained", w_pad=0.03, h_pad=0.04, wspace=0.03, hspace=0.03)
    panels = figure.subplots(len(RADIOS), len(BEHAVIOURS), sharex=True, sharey=True)
    image = None
    for row, radio in zip(panels, RADIOS, strict=True):
        for axes, behaviour in zip(row, BEHAVIOURS, strict=True):
            image = _map(axes, *shares(results(runs[f"loss-map-{behaviour}{radio}"], behaviour)))
        row[0].set_ylabel(f"{LABELS[radio]}\nlatency in s", fontsize=TEXT_PT, color=INK)
    for axes, behaviour in zip(panels[0], BEHAVIOURS, strict=True):
        axes.set_title(TITLES[behaviour], loc="left", fontsize=TEXT_PT, color=INK, pad=5)
    for axes in panels[-1]:
        axes.set_xlabel("mean share of packets lost", fontsize=TEXT_PT, color=SOFT)
    bar = figure.colorbar(image, ax=panels, fraction=0.025, pad=0.015, ticks=[0.0, 0.25, 0.5, 0.75, 1.0])
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0)
    bar.ax.axhline(0.5, color="white", lw=1.6)
    bar.set_label("share of runs that succeed; line: one half", fontsize=SMALL_PT, color=SOFT)
    return figure


def _map(axes: Any, losses: FloatArray, latencies: FloatArray, share: FloatArray) -> Any:
    """One map; rows are equally high, whatever lies between their latencies."""
    columns, rows = np.arange(len(losses)), np.arange(len(latencies))
    image = axes.pcolormesh(columns, rows, share, cmap=COLORS, vmin=0.0, vmax=1.0, edgecolors="white", linewidth=0.3)
    if share.min() < 0.5 < share.max():
        _draw_half(axes, share)
    every = 3 if len(losses) > 4 else 1
    axes.set_xticks(columns[::every], [f"{loss:g}" for loss in losses[::every]])
    axes.set_yticks(rows, [f"{latency:g}" for latency in latencies])
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    axes.spines[:].set(color=FAINT, linewidth=0.5)
    return image


def _draw_half(axes: Any, share: FloatArray) -> None:
    """Where one half of the runs succeed, between the cells' middles; cells at the edge are as at their middle."""
    x, y = (np.concatenate(([-0.5], np.arange(cells), [cells - 0.5])) for cells in share.shape[::-1])
    for color, width in ((INK, 2.6), ("white", 1.4)):
        axes.contour(x, y, np.pad(share, 1, mode="edge"), levels=[HALF], colors=[color], linewidths=width)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Success at chosen cells, the difference that bursts make there and over the whole map."""
    lines = [
        _size(runs),
        "",
        "| | loss | latency, s | independent | bursts | bursts less independent |",
        f"|{' --- |' * 6}",
    ]
    for behaviour in BEHAVIOURS:
        independent, bursts = (results(runs[f"loss-map-{behaviour}{radio}"], behaviour) for radio in RADIOS)
        lines += [line for cell in CELLS if (line := _cell_line(behaviour, independent, bursts, *cell))]
        lines.append(
            f"| {behaviour} | all | all | {_mean(independent)} | {_mean(bursts)} | {_difference(independent, bursts)} |"
        )
    return "\n".join([*lines, "", *_check_lines(runs)])


def _size(runs: Mapping[str, pl.DataFrame]) -> str:
    """How many runs the maps are made of, and how long they took."""
    maps = [frame for name, frame in runs.items() if name not in CHECKS]
    cells, seeds = maps[0].n_unique("point"), maps[0].n_unique("seed")
    took_min = sum(float(frame["timing_wall_s"].sum()) for frame in maps) / 60.0
    total = sum(map(len, maps))
    return (
        f"{total} runs: {len(maps)} maps of {cells} cells, {seeds} seeds in each; {took_min:.0f} minutes of one worker."
    )


def _check_lines(runs: Mapping[str, pl.DataFrame]) -> list[str]:
    """A table of what heals a break, latency by latency, without losses."""
    lines = ["| | latency, s | as in the map | with the change | difference |", f"|{' --- |' * 5}"]
    for name, (behaviour, change) in CHECKS.items():
        cured = results(runs[name], behaviour)
        plain = results(runs[f"loss-map-{behaviour}"], behaviour).filter(pl.col("loss") == 0.0)
        for latency_s in cured["latency_s"].unique().sort():
            pair = (plain.filter(latency_s=latency_s), cured.filter(latency_s=latency_s))
            cells = f"{_share(pair[0])} | {_share(pair[1])} | {_difference(*pair)}"
            lines.append(f"| {behaviour}: {change} | {latency_s:g} | {cells} |")
    return lines


def _cell_line(behaviour: str, independent: pl.DataFrame, bursts: pl.DataFrame, loss: float, latency_s: float) -> str:
    """A row of the table, "" if the cell was not run."""
    cell = ((pl.col("loss") - loss).abs() < 1e-9) & ((pl.col("latency_s") - latency_s).abs() < 1e-9)
    first, second = independent.filter(cell), bursts.filter(cell)
    if not (len(first) and len(second)):
        return ""
    cells = f"{_share(first)} | {_share(second)} | {_difference(first, second)}"
    return f"| {behaviour} | {loss:g} | {latency_s:g} | {cells} |"


def _share(runs: pl.DataFrame) -> str:
    """Of one cell, with Wilson's interval."""
    successes, n = int(runs["success"].sum()), len(runs)
    low, high = binomial_interval(np.array([successes]), np.array([n]))
    return f"{successes} of {n} ({low[0]:.2f} to {high[0]:.2f})"


def _mean(runs: pl.DataFrame) -> str:
    return f"{runs['success'].mean():.2f}"


def _difference(first: pl.DataFrame, second: pl.DataFrame) -> str:
    """Of the shares, seed by seed, with the bootstrap's interval over seeds."""
    effect = difference(by_seed(first), by_seed(second))
    low, high = effect.mean_interval if np.isfinite(effect.mean_interval.low) else Interval(effect.mean, effect.mean)
    return f"{effect.mean:+.2f} ({low:+.2f} to {high:+.2f})"


def by_seed(runs: pl.DataFrame) -> Sample:
    """The share of each seed's runs that succeed."""
    means = runs.group_by("seed").agg(pl.col("success").cast(pl.Float64).mean()).sort("seed")
    return number_sample(means["success"].to_numpy(), means["seed"].to_numpy().astype(np.int64))
