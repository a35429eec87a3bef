"""A sample: what the runs of one design point gave, each with its seed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Sample:
    """n values, in the order of their seeds; runs without a value are counted beside them."""

    value: FloatArray  # (n,) finite; where not observed: the time up to which it had not happened
    observed: BoolArray  # (n,) False: right-censored, the true value lies beyond
    seed: IntArray  # (n,) of each value's run: who has the same seed began alike
    failed: int = 0  # runs that ended in an error
    undefined: int = 0  # runs that ended well with nothing to measure

    @cached_property
    def censored(self) -> float:
        """Share of the values that are right-censored; NaN of none."""
        return float(np.mean(~self.observed)) if len(self.value) else float("nan")

    def __len__(self) -> int:
        return len(self.value)


def sample_of(value: FloatArray, observed: BoolArray | None = None, seed: IntArray | None = None) -> Sample:
    """A sample of arrays (n,); all observed, and seeds 0, 1, …, unless told. NaN counts as undefined."""
    there = np.isfinite(value)
    told = np.ones(len(value), np.bool_) if observed is None else observed
    seeds = np.arange(len(value)) if seed is None else seed
    return Sample(value[there], told[there], seeds[there], undefined=int(np.count_nonzero(~there)))
