"""Coverage of a radio between places, without robots: mean power and delivery of lone packets, as map or by distance.

Propagation and reception are those of the medium. Other robots neither interfere nor stand in between.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.config.phy import Antennas, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.phy.params import phy_params_of
from swarmwire.comms.radio.phy.propagation import cut_off_dbm, sensitivity_of
from swarmwire.comms.radio.phy.reception import lone_deliveries
from swarmwire.comms.radio.propagation.decibels import to_db
from swarmwire.comms.radio.propagation.fading import fading_gain, fading_model
from swarmwire.comms.radio.propagation.path_loss import loss_between_db, rssi_dbm
from swarmwire.comms.radio.propagation.shadowing import amplitude_db, field_waves
from swarmwire.comms.radio.stages.losses import LossChain
from swarmwire.comms.radio.stages.stage import ChannelContext

GAINS = 2000  # of fading, over which delivery is averaged
STEP_DB, DEEP_DB = 0.1, 40.0  # of the table of delivery by power; how far fading reaches below and above the mean
A_LITTLE_M = 1e-9


class RadioCoverage:
    """A radio among the obstacles of one arena, between any two places.

    Attributes:
        sensitivity_dbm: the least mean power that counts as in range; None for a unit disk.
    """

    def __init__(self, radio: Radio, key: np.uint64, obstacles: ObstacleIndices, payload_bytes: int) -> None:
        """`key` is that of the arena, `obstacles` are those of this arena alone; packets have so many bytes."""
        self._radio, self._obstacles = radio, obstacles.now()
        self._losses = LossChain.of(_context_of(radio, key, obstacles))
        self._range_m = math.inf if radio.range_m is None else radio.range_m
        self.sensitivity_dbm = sensitivity_of(radio) if radio.is_phy else None
        if radio.is_phy:
            self._curve = radio.loss_model.curve(radio.frequency_hz)
            shadowing = radio.shadowing or Shadowing(deviation_db=0.0)
            self._waves = field_waves(np.array([key], np.uint64), shadowing)[0]
            self._amplitude_db = amplitude_db(shadowing)
            self._by_power = self._delivery_by_power(key, 8 * (payload_bytes + radio.overhead_bytes))

    def mean_dbm(self, start: FloatArray, end: FloatArray) -> FloatArray | None:
        """The mean power between places (k, 2) in m, fading apart, (k,); None for a unit disk."""
        if not self._radio.is_phy:
            return None
        antenna, walls = self._radio.antenna_or_default, self._radio.walls or Walls(0.0, 0.0)
        return _mean_dbm(
            self._curve,
            antenna.power_dbm,
            antenna.gain_dbi,
            self._waves,
            self._amplitude_db,
            self._obstacles,
            walls.crossing_db,
            walls.inside_db_per_m,
            np.ascontiguousarray(start, np.float64),
            np.ascontiguousarray(end, np.float64),
        )

    def in_range(self, start: FloatArray, end: FloatArray) -> BoolArray:
        """Whether the mean power reaches the sensitivity, or a unit disk its range; nowhere that an obstacle blocks."""
        mean_dbm, is_open = self.mean_dbm(start, end), self._open(start, end)
        if mean_dbm is None or self.sensitivity_dbm is None:
            return is_open
        return is_open & (mean_dbm >= self.sensitivity_dbm)

    def delivery(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """The probability that a lone packet gets through, over all fading and bursts, (k,)."""
        mean_dbm, passes = self.mean_dbm(start, end), np.where(self._open(start, end), self._passing(len(start)), 0.0)
        if mean_dbm is None:
            return passes
        return np.where(mean_dbm < cut_off_dbm(self._radio), 0.0, passes * np.interp(mean_dbm, *self._by_power))

    def _passing(self, links: int) -> FloatArray | float:
        """The share of frames that pass all losses, (links,) or one for all; each link is an arena of two robots."""
        rows = np.arange(2 * links)
        return self._losses.passing * self._losses.delivery(rows[0::2], rows[1::2], 0)

    def is_free(self, place: FloatArray) -> BoolArray:
        """Whether no obstacle covers each of the places (k, 2) in m."""
        return ~_blocked(self._obstacles, place, place + np.array([A_LITTLE_M, 0.0]))

    def _open(self, start: FloatArray, end: FloatArray) -> BoolArray:
        """Whether neither the radio's range nor, where it needs a line of sight, an obstacle ends a link."""
        away = end - start
        found = (away * away).sum(axis=1) <= self._range_m * self._range_m
        return found & ~_blocked(self._obstacles, start, end) if self._radio.needs_line_of_sight else found

    def _delivery_by_power(self, key: np.uint64, bits: int) -> tuple[FloatArray, FloatArray]:
        """Mean power in dBm, rising, and the delivery at each."""
        assert self.sensitivity_dbm is not None
        rules = phy_params_of(self._radio, 1)
        middle_dbm = self._radio.noise_or_default.power_dbm
        least, most = min(middle_dbm, self.sensitivity_dbm) - DEEP_DB, max(middle_dbm, self.sensitivity_dbm) + DEEP_DB
        mean_dbm = np.arange(least, most, STEP_DB)
        if self._radio.fading is None:
            return mean_dbm, lone_deliveries(rules, mean_dbm, bits)
        gain_db = _gains_db(fading_model(self._radio.fading, self._radio.frequency_hz), key)
        return mean_dbm, np.array([lone_deliveries(rules, one_dbm + gain_db, bits).mean() for one_dbm in mean_dbm])


def _context_of(radio: Radio, key: np.uint64, obstacles: ObstacleIndices) -> ChannelContext:
    """The context of two robots without bodies."""
    keys, none, antennas = np.array([key], np.uint64), Disruption.none(2), Antennas.alike(2)
    return ChannelContext(
        radio, keys, 2, obstacles, (math.inf, math.inf), np.zeros(2), none, antennas, np.ones(1, np.bool_)
    )


@njit()
def _mean_dbm(curve, power_dbm, gain_dbi, waves, amplitude, obstacles, crossing_db, inside_db_per_m, start, end):
    out_dbm, entered = np.empty(len(start)), np.empty((len(obstacles.shape), 2))
    for i in range(len(start)):
        ax, ay = start[i]
        bx, by = end[i]
        apart_m = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        loss = loss_between_db(
            curve, waves, amplitude, obstacles, entered, 0, crossing_db, inside_db_per_m, apart_m, ax, ay, bx, by
        )
        out_dbm[i] = rssi_dbm(power_dbm, gain_dbi, gain_dbi, loss)
    return out_dbm


@njit()
def _blocked(obstacles, start, end):
    found = np.zeros(len(start), np.bool_)
    for i in range(len(start)):
        found[i] = is_blocked(obstacles, 0, start[i, 0], start[i, 1], end[i, 0], end[i, 1], 0.0, 0.0)
    return found


@njit()
def _gains_db(law, key):
    """The gain of fading on many links, each elsewhere; it is distributed alike at all places."""
    out_db = np.empty(GAINS)
    for i in range(GAINS):
        x, y = 0.73 * i, 0.41 * i
        out_db[i] = to_db(fading_gain(law, key, 2 * i, 2 * i + 1, x, y, x + 1.0 + 0.013 * i, y))
    return out_db


CANDIDATES, MAX_LINKS, MIN_LINKS = 20_000, 2000, 50  # links drawn for each distance
QUANTILES = (0.05, 0.95)
SURVEY = purpose("survey of coverage")


@dataclass(frozen=True, eq=False)
class CoverageMap:
    """A radio's coverage from one place, on a grid over the arena."""

    at_m: tuple[float, float]
    x_m: FloatArray  # (columns,) rising
    y_m: FloatArray  # (rows,) rising
    mean_dbm: FloatArray | None  # (rows, columns) without fading; None for a unit disk
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
    mean_dbm: Band | None  # None for a unit disk


def coverage_map(
    coverage: RadioCoverage, size_m: tuple[float, float], at_m: tuple[float, float], points: int
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
    coverage: RadioCoverage, size_m: tuple[float, float], key: np.uint64, farthest_m: float, distances: int
) -> ByDistance:
    """Links between free places of the arena, uniform in place and direction, at so many distances up to the farthest.

    Drawn by the arena's key. Distances at which next to no link fits into the arena are left out.
    """
    lengths_m = farthest_m * (np.arange(distances) + 0.5) / distances
    links = [_links(coverage, size_m, key, i, float(length_m)) for i, length_m in enumerate(lengths_m)]
    fits = [i for i, (start, _) in enumerate(links) if len(start) >= MIN_LINKS]
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
    coverage: RadioCoverage, size_m: tuple[float, float], key: np.uint64, which: int, distance_m: float
) -> tuple[FloatArray, FloatArray]:
    """Start and end (k, 2) in m of links of this length, within the arena and off obstacles."""
    keys = np.array(key, np.uint64)
    x, y, turn = (uniform(keys, np.arange(CANDIDATES), which, axis, SURVEY) for axis in range(3))
    start = (np.stack([x, y], axis=1) - 0.5) * size_m
    way = np.stack([np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)], axis=1)
    end = start + distance_m * way
    fits = np.flatnonzero((np.abs(end) <= 0.5 * np.array(size_m)).all(axis=1))
    fits = fits[coverage.is_free(start[fits]) & coverage.is_free(end[fits])][:MAX_LINKS]
    return start[fits], end[fits]
