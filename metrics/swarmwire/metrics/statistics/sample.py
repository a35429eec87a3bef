"""Samples of the results of runs, right-censored where a run ended first, and intervals of confidence."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray

Kind = Literal["number", "time"]  # a time may lie beyond its run's end: right-censored
LEVEL = 0.95  # default confidence


@dataclass(frozen=True)
class Sample:
    """n values, in the order of their seeds; runs without a value are counted beside them."""

    value: FloatArray  # (n,) finite; where not observed: the time up to which it had not happened
    observed: BoolArray  # (n,) False: right-censored, the true value lies beyond
    seed: IntArray  # (n,) of each value's run; runs of one seed start alike
    kind: Kind = "number"  # quantiles of times are Kaplan and Meier's, censored or not
    failed: int = 0  # runs that ended in an error
    undefined: int = 0  # runs that ended well with nothing to measure
    # (k,) Of a time: how long runs were observed that a stop condition ended before it. If the condition has to do with
    # the event, they are not censored by chance, and estimates mislead.
    stopped_first: FloatArray = field(default_factory=lambda: np.empty(0))

    @cached_property
    def censored(self) -> float:
        """Share of the values that are right-censored; NaN of none."""
        return float(np.mean(~self.observed)) if len(self.value) else float("nan")

    @cached_property
    def seeds(self) -> int:
        """How many seeds the values have: fewer than values if several runs have the same seed."""
        return len(np.unique(self.seed))

    def __len__(self) -> int:
        return len(self.value)

    def of_seeds(self, seed: IntArray) -> "Sample":
        """The values (k,) of these seeds, in this order; each occurs once."""
        order = np.argsort(self.seed)
        place = order[np.searchsorted(self.seed, seed, sorter=order)]
        return replace(self, value=self.value[place], observed=self.observed[place], seed=seed)


def number_sample(value: FloatArray, seed: IntArray | None = None) -> Sample:
    """A sample of numbers (n,), of which NaN are undefined; default seeds are 0, 1 and so on."""
    there = np.isfinite(value)
    seeds = np.arange(len(value)) if seed is None else seed
    undefined = int(np.count_nonzero(~there))
    return Sample(value[there], there[there], seeds[there], undefined=undefined)


def time_sample(value: FloatArray, observed: BoolArray, seed: IntArray | None = None) -> Sample:
    """A sample of finite times (n,), right-censored where not observed; default seeds are 0, 1 and so on."""
    return Sample(value, observed, np.arange(len(value)) if seed is None else seed, "time")


class SeedTable(NamedTuple):
    """The values of points, those of one seed in one column, or in several if a row is about several points."""

    value: FloatArray  # (points, columns); NaN where there is no such run
    seed: IntArray  # (columns,)

    @classmethod
    def from_table(cls, table: "FloatArray | SeedTable") -> "SeedTable":
        """Return a table unchanged, or the table of an array (points, seeds) with a seed per column."""
        return table if isinstance(table, SeedTable) else cls(table, np.arange(table.shape[1]))


def by_seed(samples: Sequence[Sample]) -> SeedTable:
    """The values of points and seeds, seeds rising.

    Of a time that was censored it is the time up to which it had not happened: where all runs may take equally long,
    means of these are restricted means.
    """
    seeds = np.unique(np.concatenate([sample.seed for sample in samples]))
    table = np.full((len(samples), len(seeds)), np.nan)
    for row, sample in zip(table, samples, strict=True):
        row[np.searchsorted(seeds, sample.seed)] = sample.value
    return SeedTable(table, seeds)


class Interval(NamedTuple):
    """From low to high. NaN: unknown; infinite: open on that side, as for censored times."""

    low: float
    high: float


UNKNOWN = Interval(float("nan"), float("nan"))  # of too few runs
