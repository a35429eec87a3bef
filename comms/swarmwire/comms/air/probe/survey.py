"""Surveys of an arena's coverage: as a map from one place, and by distance over all places and directions."""

# pyright: basic, reportUnknownMemberType=false

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmwire.comms.air.probe.coverage import Coverage
from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.draws import purpose, uniform

CANDIDATES, MOST_LINKS, FEWEST_LINKS = 20_000, 2000, 50  # links drawn for each distance
QUANTILES = (0.05, 0.95)
SURVEY = purpose("survey of coverage")


@dataclass(frozen=True, eq=False)
class CoverageMap:
    """A radio's coverage from one place, on a grid over the arena."""

    at_m: tuple[float, float]
    x_m: FloatArray  # (columns,) rising
    y_m: FloatArray  # (rows,) rising
    mean_dbm: FloatArray | None  # (rows, columns) without fading; None for a disk
    in_range: BoolArray  # (rows, columns)
    delivery: FloatArray  # (rows, columns) of lone packets
    is_free: BoolArray  # (rows, columns) of obstacles

    def share(self, which: BoolArray) -> float:
        """The share of the places free of obstacles that these (rows, columns) are."""
        return float(np.mean(which[self.is_free])) if self.is_free.any() else math.nan


class Band(NamedTuple):
    """A figure over links of the arena, by their length."""

    mean: FloatArray  # (distances,)
    low: FloatArray  # (distances,) the 5 % quantile
    high: FloatArray  # (distances,) the 95 % quantile


@dataclass(frozen=True, eq=False)
class ByDistance:
    """Delivery of lone packets and mean strength over distance."""

    distance_m: FloatArray  # (distances,) rising
    delivery: Band
    mean_dbm: Band | None  # None for a disk


def coverage_map(
    coverage: Coverage, size_m: tuple[float, float], at_m: tuple[float, float], points: int
) -> CoverageMap:
    """The map from a place, with so many points along the longer side of the arena."""
    step_m = max(size_m) / points
    x_m, y_m = (_middles(side_m, step_m) for side_m in size_m)
    end = np.stack(np.meshgrid(x_m, y_m), axis=-1).reshape(-1, 2)
    start = np.broadcast_to(np.array(at_m), end.shape)
    shape = len(y_m), len(x_m)
    mean_dbm = coverage.mean_dbm(start, end)
    return CoverageMap(
        at_m=at_m,
        x_m=x_m,
        y_m=y_m,
        mean_dbm=None if mean_dbm is None else mean_dbm.reshape(shape),
        in_range=coverage.in_range(start, end).reshape(shape),
        delivery=coverage.delivery(start, end).reshape(shape),
        is_free=coverage.is_free(end).reshape(shape),
    )


def by_distance(
    coverage: Coverage, size_m: tuple[float, float], key: np.uint64, farthest_m: float, distances: int
) -> ByDistance:
    """Links between free places of the arena, uniform in place and direction, at so many distances up to the farthest.

    Drawn by the arena's key. Distances at which next to no link fits into the arena are left out.
    """
    lengths_m = farthest_m * (np.arange(distances) + 0.5) / distances
    links = [_links(coverage, size_m, key, i, float(length_m)) for i, length_m in enumerate(lengths_m)]
    fits = [i for i, (start, _) in enumerate(links) if len(start) >= FEWEST_LINKS]
    strengths = [coverage.mean_dbm(*links[i]) for i in fits]
    known = [strength for strength in strengths if strength is not None]
    return ByDistance(
        distance_m=lengths_m[fits],
        delivery=_band([coverage.delivery(*links[i]) for i in fits]),
        mean_dbm=None if coverage.sensitivity_dbm is None else _band(known),
    )


def _band(found: list[FloatArray]) -> Band:
    columns = [(one.mean(), *np.quantile(one, QUANTILES)) for one in found]
    return Band(*np.array(columns, np.float64).reshape(-1, 3).T)


def _middles(side_m: float, step_m: float) -> FloatArray:
    cells = max(round(side_m / step_m), 1)
    return side_m * ((np.arange(cells) + 0.5) / cells - 0.5)


def _links(
    coverage: Coverage, size_m: tuple[float, float], key: np.uint64, which: int, distance_m: float
) -> tuple[FloatArray, FloatArray]:
    """Start and end (k, 2) in m of links of this length, within the arena and off obstacles."""
    keys = np.array(key, np.uint64)
    x, y, turn = (uniform(keys, np.arange(CANDIDATES), which, axis, SURVEY) for axis in range(3))
    start = (np.stack([x, y], axis=1) - 0.5) * size_m
    way = np.stack([np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)], axis=1)
    end = start + distance_m * way
    fits = np.flatnonzero((np.abs(end) <= 0.5 * np.array(size_m)).all(axis=1))
    fits = fits[coverage.is_free(start[fits]) & coverage.is_free(end[fits])][:MOST_LINKS]
    return start[fits], end[fits]
