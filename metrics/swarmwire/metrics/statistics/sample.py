"""Samples of the results of runs, right-censored if a run ended first, and confidence intervals."""

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
    """n values, in the order of their seeds, and counts of the runs without a value."""

    value: FloatArray  #: (n,) finite; if not observed, the censoring time
    observed: BoolArray  #: (n,) False: right-censored, the true value lies beyond
    seed: IntArray  #: (n,) seed of each value's run; runs of one seed start alike
    kind: Kind = "number"  #: quantiles of times are Kaplan and Meier's, censored or not
    failed: int = 0  #: runs that ended in an error
    undefined: int = 0  #: runs without an error and without a value
    # (k,) Censoring times of the runs that a stop condition ended before the time. If the condition depends on the
    # event, their censoring is informative, and estimates mislead.
    stopped_first: FloatArray = field(default_factory=lambda: np.empty(0))

    @cached_property
    def censored(self) -> float:
        """Share of the values that are right-censored; NaN without values."""
        return float(np.mean(~self.observed)) if len(self.value) else float("nan")

    @cached_property
    def seeds(self) -> int:
        """Number of seeds; less than the number of values if several runs have the same seed."""
        return len(np.unique(self.seed))

    def __len__(self) -> int:
        return len(self.value)

    def select_seeds(self, seed: IntArray) -> "Sample":
        """Return the values (k,) of these seeds, in this order; each seed occurs once."""
        order = np.argsort(self.seed)
        index = order[np.searchsorted(self.seed, seed, sorter=order)]
        return replace(self, value=self.value[index], observed=self.observed[index], seed=seed)


def number_sample(value: FloatArray, seed: IntArray | None = None) -> Sample:
    """Return a sample of numbers (n,); NaN are undefined, default seeds are 0, 1 and so on."""
    defined = np.isfinite(value)
    seeds = np.arange(len(value)) if seed is None else seed
    undefined = int(np.count_nonzero(~defined))
    return Sample(value[defined], defined[defined], seeds[defined], undefined=undefined)


def time_sample(value: FloatArray, observed: BoolArray, seed: IntArray | None = None) -> Sample:
    """Return a sample of finite times (n,), right-censored if not observed; default seeds are 0, 1 and so on."""
    return Sample(value, observed, np.arange(len(value)) if seed is None else seed, "time")


class SeedTable(NamedTuple):
    """Values of points, a row per point and a column per seed; more columns if a row combines several points."""

    value: FloatArray  #: (points, columns); NaN without such a run
    seed: IntArray  #: (columns,)

    @classmethod
    def from_table(cls, table: "FloatArray | SeedTable") -> "SeedTable":
        """Return a table unchanged, or the table of an array (points, seeds) with a seed per column."""
        return table if isinstance(table, SeedTable) else cls(table, np.arange(table.shape[1]))


def by_seed(samples: Sequence[Sample]) -> SeedTable:
    """Return the values by point and seed, with seeds in order.

    A censored time has its censoring time: if all runs have the same time limit, means are restricted means.
    """
    seeds = np.unique(np.concatenate([sample.seed for sample in samples]))
    table = np.full((len(samples), len(seeds)), np.nan)
    for row, sample in zip(table, samples, strict=True):
        row[np.searchsorted(seeds, sample.seed)] = sample.value
    return SeedTable(table, seeds)


class Interval(NamedTuple):
    """An interval from low to high. NaN: unknown; infinite: open on that side, for censored times."""

    low: float
    high: float


UNKNOWN = Interval(float("nan"), float("nan"))  # interval of too few runs
