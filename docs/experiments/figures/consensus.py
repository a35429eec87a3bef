"""Average consensus under loss: how fast robots agree, and how far from the average."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from docs.experiments.experiment import LAYOUT
from docs.experiments.figures._consensus_model import Graph, graph_of
from docs.experiments.figures._side_by_side import legend, mean_and_interval, panels, table
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.report.axes import ordered_colors

CAMPAIGNS = ("consensus", "consensus-random", "consensus-more")
COLUMNS = ("first_pattern", "consensus_error", "consensus_bias")  # after `steps`, from the series

LOSS, RANGE = "radio.loss", "radio.range_m"
ALL_M = 3.0  # range with which all of ten hear all
GRAPHS = (  # name, campaign, scenario, range of the radio, if not the scenario's
    ("ring of 10", "consensus", "consensus", 0.8),
    ("random, 16", "consensus-random", "consensus-random", None),
    ("all of 10", "consensus", "consensus", ALL_M),
)
AGAIN = ("all of 10, again", "consensus-more", "consensus", ALL_M)
HEAD = (
    "graph",
    "loss",
    "steps",
    "decay, formula",
    "mean decay, measured",
    "error's decay, exact",
    "measured",
    "bias, exact",
    "measured",
)


class Point(NamedTuple):
    """One graph at one loss."""

    name: str
    campaign: str
    graph: Graph
    loss: float
    steps: int
    pattern: FloatArray  # (runs,) each after the steps
    error: FloatArray
    bias: FloatArray


def digested(folder: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """What was left after the steps in which the formula says that a fifth is left."""
    by = [name for name in (RANGE, LOSS) if name in runs.columns]
    graphs = {campaign: (scenario, range_m) for _, campaign, scenario, range_m in (*GRAPHS, AGAIN)}
    scenario, range_m = graphs[folder.name]
    ranges = runs[RANGE].unique() if RANGE in by else [range_m]
    graphs = {reach_m: _graph(scenario, reach_m) for reach_m in ranges}
    steps = [
        min(graphs[row.get(RANGE, range_m)].steps(row[LOSS]), row["ticks"] - 1) for row in runs.iter_rows(named=True)
    ]
    at = runs.with_columns(pl.Series("steps", steps, pl.Int32))
    series = pl.scan_parquet(folder / "series" / "*.parquet").select("run", pl.col("tick").alias("steps"), *COLUMNS)
    joined = at.lazy().join(series, on=["run", "steps"], how="left", suffix="_")
    return joined.select(
        "run", "point", "seed", *by, "ended", "sim_time_s", "steps", *COLUMNS, "timing_wall_s"
    ).collect()


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Decay against loss beside the formula; what the losses do to the average."""
    figure, (slow, off) = panels(
        ("decay of the mean disagreement in a step", "loss"), ("average moved by (root mean square)", "loss")
    )
    for (name, *_), color in zip(GRAPHS, ordered_colors(len(GRAPHS)), strict=True):
        points = [point for point in _points(runs) if point.name == name]
        loss = [point.loss for point in points]
        fine = np.linspace(0.0, max(loss), 81)
        graph = points[0].graph
        slow.plot(fine, [graph.decay(p) for p in fine], color=color, lw=0.9)
        off.plot(fine, [graph.after(graph.steps(p), p).bias for p in fine], color=color, lw=0.9)
        _measured(slow, loss, [_decay(point) for point in points], color, name)
        _measured(off, loss, [_root(point.bias, 1) for point in points], color, name)
    legend(slow, loc="lower right")
    off.set_ylim(bottom=0.0)
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """A row per graph and loss, and how many intervals hold the formula."""
    rows: list[list[str]] = []
    held, intervals = dict.fromkeys(runs, 0), dict.fromkeys(runs, 0)
    for point in _points(runs):
        exact = point.graph.after(point.steps, point.loss)
        first = float(np.std(point.graph.start))
        decay = point.graph.decay(point.loss)
        mean, error, bias = _decay(point), _root(point.error / first, point.steps), _root(point.bias, 1)
        if point.loss > 0.0:
            held[point.campaign] += mean[1] <= decay <= mean[2]
            intervals[point.campaign] += 1
        exact_error = (exact.error / first) ** (1.0 / point.steps)
        texts = [f"{decay:.4f}", _text(mean), f"{exact_error:.4f}", _text(error), f"{exact.bias:.4f}", _text(bias)]
        rows.append([point.name, f"{point.loss:g}", str(point.steps), *texts])
    statements = [
        f"{held[campaign]} of {count} of `{campaign}` ({runs[campaign]['seed'].n_unique()} seeds)"
        for campaign, count in intervals.items()
    ]
    hold = "Where packets are lost, so many 95 % intervals of the mean decay hold the formula"
    return f"{table(HEAD, rows)}\n\n{hold}: {', '.join(statements)}."


def _graph(scenario: str, range_m: float | None) -> Graph:
    return graph_of(LAYOUT.campaigns / "scenarios" / f"{scenario}.toml", range_m)


def _points(runs: Mapping[str, pl.DataFrame]) -> Iterator[Point]:
    """All points, graph by graph, losses rising."""
    for name, campaign, scenario, range_m in (*GRAPHS, AGAIN):
        campaign_runs = runs[campaign]
        if RANGE in campaign_runs.columns:
            campaign_runs = campaign_runs.filter(pl.col(RANGE) == range_m)
        for (loss,), at in campaign_runs.sort(LOSS, "seed").group_by(LOSS, maintain_order=True):
            values = (at[column].to_numpy().astype(np.float64) for column in COLUMNS)
            yield Point(name, campaign, _graph(scenario, range_m), float(str(loss)), int(at["steps"][0]), *values)


def _decay(point: Point) -> tuple[float, float, float]:
    """The mean of what is left, as decay in one step, with its interval."""
    mean, (low, high) = mean_and_interval(point.pattern)
    return mean ** (1.0 / point.steps), max(low, 0.0) ** (1.0 / point.steps), high ** (1.0 / point.steps)


def _root(values: FloatArray, steps: int) -> tuple[float, float, float]:
    """The root mean square of values, as decay in one step of so many, with its interval."""
    mean, (low, high) = mean_and_interval(values**2)
    return mean ** (0.5 / steps), max(low, 0.0) ** (0.5 / steps), high ** (0.5 / steps)


def _measured(axes: Any, x: list[float], estimates: list[tuple[float, float, float]], color: Any, label: str) -> None:
    axes.vlines(x, [low for _, low, _ in estimates], [high for *_, high in estimates], color=color, lw=1.0, zorder=3)
    axes.plot(x, [mean for mean, *_ in estimates], "o", ms=3, color=color, label=label, zorder=4)


def _text(estimate: tuple[float, float, float]) -> str:
    return f"{estimate[0]:.4f} ({estimate[1]:.4f} to {estimate[2]:.4f})"
