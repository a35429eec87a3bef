"""How a behaviour bears loss and latency: an experiment whose campaign varies these two, and what is drawn of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from docs.behaviours.shown import Shown, find_shown
from docs.experiments.experiment import Experiment, Layout
from swarmwire.metrics.pictures.report.axes import plain_legend
from swarmwire.metrics.pictures.report.charts import MedianLine, response_curve
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.statistics.sample import Interval, Sample
from swarmwire.metrics.statistics.summary import summary

LOSS, LATENCY = "loss", "latency_s"
DIGITS = 3
HEAD_ROOM = 1.2  # above the lines, for the legend


def degradation_of(name: str, layout: Layout) -> Experiment:
    """The behaviour's campaign as an experiment, which `docs.experiments` sweeps, digests and draws."""
    shown = find_shown(name, layout)
    return Experiment(name, shown.title, (name,), (), _Degradation(name, shown), name)


@dataclass(frozen=True)
class _Degradation:
    """Stands for the module of an experiment."""

    name: str
    shown: Shown

    def digested(self, folder: Path, _runs: pl.DataFrame) -> pl.DataFrame:
        """A row a run that ended well: loss, latency_s, seed, value, observed (False: a time that was cut off), kind.

        The first parameter that the campaign varies is the loss, the second the latency.
        """
        campaign = CampaignFolder(folder)
        loss, latency = campaign.parameters
        parts: list[pl.DataFrame] = []
        for number, point in enumerate(campaign.points):
            sample = campaign.sample(self.shown.response, number)
            rows = pl.DataFrame({"seed": sample.seed, "value": sample.value, "observed": sample.observed})
            at = {LOSS: point[loss], LATENCY: point[latency]}
            fixed_columns = [pl.lit(float(str(value))).alias(key) for key, value in at.items()]
            parts.append(rows.select(*fixed_columns, "seed", "value", "observed", pl.lit(sample.kind).alias("kind")))
        return pl.concat(parts)

    def draw(self, runs: Mapping[str, pl.DataFrame]) -> Any:
        """The response over loss, a line for each latency."""
        frame = runs[self.name]
        losses = _levels(frame, LOSS)
        lines = [
            _line(f"{latency:g} s late", losses, [_sample(frame, loss, latency) for loss in losses])
            for latency in _levels(frame, LATENCY)
        ]
        cut_off = frame.filter(~pl.col("observed"))["value"]
        limit = float(np.max(cut_off.to_numpy())) if len(cut_off) else None
        figure = response_curve(lines, self.shown.title, f"share of the {self.shown.lost} lost", limit)
        axes = figure.axes[0]
        top = axes.get_ylim()[1]
        axes.set_ylim(0.0, HEAD_ROOM * top)  # from 0: what hardly changes should look so
        axes.set_yticks([tick for tick in axes.get_yticks() if 0.0 <= tick <= top])  # none beside the legend
        plain_legend(axes, loc="upper center", ncols=len(lines), columnspacing=1.2)
        return figure

    def numbers(self, runs: Mapping[str, pl.DataFrame]) -> str:
        """A row for each loss, a column for each latency."""
        frame = runs[self.name]
        latencies = _levels(frame, LATENCY)
        lines = ["| lost | " + " | ".join(f"{latency:g} s late" for latency in latencies) + " |"]
        lines.append("| --- " * (1 + len(latencies)) + "|")
        for loss in _levels(frame, LOSS):
            cells = [_words(_sample(frame, loss, latency)) for latency in latencies]
            lines.append(f"| {100 * loss:g} % | {' | '.join(cells)} |")
        kind = "Medians" if _is_time(frame) else "Means"
        runs_each = int(frame.group_by(LOSS, LATENCY).len()["len"].to_numpy().max())
        about = f"{kind} of {runs_each} runs each, with 95 % intervals: {self.shown.title}."
        return "\n".join([*lines, "", about])


def _levels(frame: pl.DataFrame, column: str) -> list[float]:
    return sorted(frame[column].unique().to_list())


def _is_time(frame: pl.DataFrame) -> bool:
    return frame["kind"][0] == "time"


def _sample(frame: pl.DataFrame, loss: float, latency_s: float) -> Sample:
    cell_frame = frame.filter(pl.col(LOSS) == loss, pl.col(LATENCY) == latency_s)
    columns = (cell_frame[name].to_numpy() for name in ("value", "observed", "seed"))
    return Sample(*columns, kind="time" if _is_time(frame) else "number")


def _middle(sample: Sample) -> tuple[float, Interval]:
    """The median of times, which may be cut off, and the mean of numbers; with its interval."""
    numbers = summary(sample)
    return (numbers.q50, numbers.q50_interval) if sample.kind == "time" else (numbers.mean, numbers.mean_interval)


def _line(label: str, x: list[float], samples: list[Sample]) -> MedianLine:
    middles = [_middle(sample) for sample in samples]
    table = np.array([(middle, interval.low, interval.high) for middle, interval in middles])
    if samples[0].kind == "time":
        table[np.isnan(table)] = np.inf  # beyond the limit
    middle, low, high = table.T
    return MedianLine(label, np.array(x), middle, low, high, middle, middle)


def _words(sample: Sample) -> str:
    middle, interval = _middle(sample)
    if sample.kind == "time" and np.isnan(middle):
        return f"beyond {_rounded(float(np.max(sample.value)))}"
    low, high = (_rounded(end) if np.isfinite(end) else "…" for end in (interval.low, interval.high))
    return f"{_rounded(middle)} ({low}–{high})"


def _rounded(value: float) -> str:
    return f"{float(f'{value:.{DIGITS}g}'):g}"  # 1080, not 1.08e+03
