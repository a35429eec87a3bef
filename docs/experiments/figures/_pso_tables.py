"""Tables of the particle swarms' numbers."""

from collections.abc import Mapping, Sequence

import polars as pl

from docs.experiments.figures._pso_samples import FIRST, HALF, at, difference_text, mean_text, quartiles, table, times
from swarmwire.metrics.statistics.summary import summary

COMPARED = ("robots", "particles", "robots - particles, p")


def against_model(robots: pl.DataFrame, model: pl.DataFrame, column: str, name: str) -> str:
    """Time to the first and to half by what a column says, robots beside point particles."""
    head = [name, *(f"{what}: {who}" for what in ("first", "half") for who in COMPARED)]
    rows: list[list[str]] = []
    for value in robots[column].unique(maintain_order=True):
        row = [f"{value:g}"]
        for response in (FIRST, HALF):
            one, other = (times(runs.filter(pl.col(column) == value), response) for runs in (model, robots))
            row += [quartiles(summary(other)), quartiles(summary(one)), difference_text(one, other)]
        rows.append(row)
    return table(head, rows)


def steps_table(steps: Sequence[tuple[str, pl.DataFrame]], base: pl.DataFrame) -> str:
    """Time to half in each step, and what it is more than in the base."""
    rows = [
        [label, *(quartiles(summary(times(runs, of))) for of in (FIRST, HALF)), mean_text(times(runs, HALF)),
         "" if runs is base else difference_text(times(base, HALF), times(runs, HALF))]
        for label, runs in steps
    ]  # fmt: skip
    return table(["", "first", "half", "mean up to 300 s", "more than the first line, p"], rows)


def variants_table(runs: pl.DataFrame, columns: Mapping[str, str]) -> str:
    """Time to the first and to half at each point of a design, told by these columns and what they are called."""
    rows: list[list[str]] = []
    for values in runs.select(*columns).unique(maintain_order=True).iter_rows():
        some = at(runs, **dict(zip(columns, values, strict=True)))
        told = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
        rows.append(
            [*told, *(quartiles(summary(times(some, of))) for of in (FIRST, HALF)), mean_text(times(some, HALF))]
        )
    return table([*columns.values(), "first", "half", "half, mean up to 300 s"], rows)
