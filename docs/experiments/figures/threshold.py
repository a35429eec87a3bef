"""The article's rule against its cure: going to and fro, deadlocks and collisions in a corridor, by density."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SMALL_PT, SOFT, TEXT_PT, plain_axes
from swarmwire.metrics.pictures.report.page import blank_figure
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import Interval, Sample, number_sample
from swarmwire.metrics.statistics.summary import summary

CAMPAIGNS = ("article-rule", "article-pair", "article-three", "article-parts")
MEASURES = {
    "reversals.final": "forward and back, 1/min",
    "oscillation.final": "left and right, 1/min",
    "deadlocked.mean": "deadlocked",
    "collision_rate.final": "collisions, 1/h",
    "wall_contacts.final": "wall contacts",
    "speed.mean": "speed, m/s",
}
COLUMNS = tuple(MEASURES)

AGENT, COUNT, BOUNDARY, PARTS = (
    "robots.crowd.agent",
    "robots.crowd.count",
    "arena.boundary",
    "robots.crowd.params",
)
RULE, SMOOTHED = "ThresholdRule", "SmoothedAvoidance"
LOOKS = {RULE: ("the article's rule", ACCENT), SMOOTHED: ("smoothed", CURVE)}
PANELS = (
    ("changes of direction a robot-minute", pl.col("reversals.final") + pl.col("oscillation.final")),
    ("share of the robots deadlocked", pl.col("deadlocked.mean")),
    ("collisions a robot-hour", pl.col("collision_rate.final")),
)


def sample_of(runs: pl.DataFrame, value: pl.Expr, agent: str) -> Sample:
    """A value by seed of the runs of one agent."""
    selected = runs.filter(pl.col(AGENT).str.ends_with(f":{agent}"))
    return number_sample(selected.select(value.cast(pl.Float64)).to_series().to_numpy(), selected["seed"].to_numpy())


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Changes of direction, deadlocks and collisions against the number of robots, with their means' intervals."""
    figure = blank_figure(7.2, 2.4)
    corridor = runs["article-rule"]
    counts = corridor[COUNT].unique().sort().to_list()
    for column, (title, value) in enumerate(PANELS):
        axes = plain_axes(figure, (0.05 + 0.325 * column, 0.18, 0.28, 0.68), title)
        for agent, (label, color) in LOOKS.items():
            summaries = [summary(sample_of(corridor.filter(pl.col(COUNT) == count), value, agent)) for count in counts]
            axes.vlines(
                counts, *np.array([statistics.mean_interval for statistics in summaries]).T, color=color, lw=0.9
            )
            axes.plot(
                counts, [statistics.mean for statistics in summaries], "o-", color=color, ms=3.2, lw=1.0, label=label
            )
        axes.set_xscale("log", base=2)
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("robots in the corridor (20 m²)", fontsize=TEXT_PT, color=SOFT)
    figure.axes[0].legend(fontsize=SMALL_PT, frameon=False)
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """The corridor by number of robots, the paired differences, the small cases, and the parts of the cure."""
    corridor = runs["article-rule"]
    many = ", ".join(f"{name} {group['seed'].n_unique()}" for name, group in runs.items())
    return "\n\n".join((f"Runs a point: {many}.", _by_count(corridor), _paired(corridor), _cases(runs), _parts(runs)))


def _by_count(runs: pl.DataFrame) -> str:
    rows: list[Sequence[str]] = []
    for (count,), group in runs.group_by(COUNT, maintain_order=True):
        rows += [(str(count), label, *_measures(group, agent)) for agent, (label, _) in LOOKS.items()]
    return _table(("robots", "rule", *MEASURES.values()), rows)


def _paired(runs: pl.DataFrame) -> str:
    """Smoothed less the article's, seed by seed."""
    rows: list[Sequence[str]] = []
    for (count,), group in runs.group_by(COUNT, maintain_order=True):
        effects = [difference(sample_of(group, value, RULE), sample_of(group, value, SMOOTHED)) for _, value in PANELS]
        rows.append((str(count), *(_within(effect.mean, effect.mean_interval, "+") for effect in effects)))
    return _table(("robots", *(f"{title}: smoothed less the article's" for title, _ in PANELS)), rows)


def _cases(runs: Mapping[str, pl.DataFrame]) -> str:
    rows: list[Sequence[str]] = []
    for campaign, case in (("article-pair", "two head on"), ("article-three", "one against two")):
        for (boundary,), group in runs[campaign].group_by(BOUNDARY, maintain_order=True):
            where = {"open": "in the open", "walls": "in the corridor"}[str(boundary)]
            rows += [(f"{case}, {where}", label, *_measures(group, agent)) for agent, (label, _) in LOOKS.items()]
    return _table(("case", "rule", *MEASURES.values()), rows)


def _parts(runs: Mapping[str, pl.DataFrame]) -> str:
    names = ("field alone", "and low-pass", "and hysteresis", "and both")
    groups = runs["article-parts"].group_by(PARTS, maintain_order=True)
    rows = [(name, *_summaries(group)) for name, (_, group) in zip(names, groups, strict=False)]
    return _table(("16 robots", *MEASURES.values()), rows)


def _measures(runs: pl.DataFrame, agent: str) -> list[str]:
    return _summaries(runs.filter(pl.col(AGENT).str.ends_with(f":{agent}")))


def _summaries(runs: pl.DataFrame) -> list[str]:
    summaries = [summary(number_sample(runs[name].cast(pl.Float64).to_numpy())) for name in MEASURES]
    return [_within(statistics.mean, statistics.mean_interval) for statistics in summaries]


def _within(mean: float, interval: Interval, sign: str = "") -> str:
    return f"{mean:{sign}.3g} ({interval.low:{sign}.3g} to {interval.high:{sign}.3g})"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, ("---",) * len(head), *rows))
