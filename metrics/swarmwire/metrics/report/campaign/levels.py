"""The values of one parameter, in order, as groups of design points that share one."""

import math
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.metrics.campaign.about import Point, Value
from swarmwire.metrics.report.campaign.words import short_value

MAX_LEVELS = 16  # of numbers, beyond which they are put together
_BINS = 8


@dataclass(frozen=True)
class Levels:
    """A parameter's levels, in ascending order of numbers, else as they were asked for."""

    path: str
    labels: tuple[str, ...]  # (l,)
    number: FloatArray | None  # (l,) the value, or the mean of those put together; None: no numbers
    of_point: IntArray  # (points,) the level of each design point
    means: tuple[str, ...] = ()  # (l,) if levels are ranges: the mean of each, which is shorter

    @property
    def short(self) -> tuple[str, ...]:
        """Labels for axes: (l,)."""
        return self.means or self.labels

    def __len__(self) -> int:
        return len(self.labels)

    def points(self, level: int) -> list[int]:
        """The design points at this level."""
        return np.flatnonzero(self.of_point == level).tolist()


def levels_of(path: str, points: tuple[Point, ...]) -> Levels:
    """The levels of a parameter over all design points; more than MAX_LEVELS numbers become ranges, equally full."""
    values = [point[path] for point in points]
    if all(_is_number(value) for value in values):
        return _of_numbers(path, np.array(values, dtype=np.float64))
    texts = [short_value(value) for value in values]
    labels = tuple(dict.fromkeys(texts))
    return Levels(path, labels, None, np.array([labels.index(text) for text in texts]))


def _of_numbers(path: str, values: FloatArray) -> Levels:
    distinct, of_point = np.unique(values, return_inverse=True)
    if len(distinct) <= MAX_LEVELS:
        return Levels(path, tuple(f"{value:.6g}" for value in distinct), distinct, of_point)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1)))
    of_point = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    of_point = np.unique(of_point, return_inverse=True)[1]  # a range may have been empty
    ranges = [values[of_point == level] for level in range(int(of_point.max()) + 1)]
    decimals = max(0, 1 - math.floor(math.log10(float(np.ptp(values)) / len(ranges))))
    labels = tuple(f"{part.min():.{decimals}f}–{part.max():.{decimals}f}" for part in ranges)
    means = np.array([part.mean() for part in ranges])
    return Levels(path, labels, means, of_point, tuple(f"{mean:.2g}" for mean in means))


def _is_number(value: Value) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
