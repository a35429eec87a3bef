"""Coverage of a radio: mean power and delivery of lone packets between two points, as a map or by distance.

Propagation and reception are those of the medium, without other robots; all points are on the floor. A point may have
a heading, with which its antenna turns; the antenna of a point without a heading points at the other end of the link.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.phy import Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.phy.params import phy_params_of
from swarmwire.comms.radio.phy.propagation import cut_off_dbm, sensitivity_of
from swarmwire.comms.radio.phy.success import lone_deliveries
from swarmwire.comms.radio.propagation.antennas import add_pattern_losses, antenna_patterns
from swarmwire.comms.radio.propagation.decibels import to_db
from swarmwire.comms.radio.propagation.fading import fading_gain, fading_model
from swarmwire.comms.radio.propagation.path_loss import MeanLoss, loss_between_db, rssi_dbm
from swarmwire.comms.radio.propagation.shadowing import amplitude_db, field_waves
from swarmwire.comms.radio.stages.losses import LossChain

FADING_GAINS = 2000  # delivery is the mean over this number of gains
POWER_STEP_DB = 0.1  # step of the table of delivery by power
FADING_RANGE_DB = 40.0  # bound of fading below and above the mean
POINT_M = 1e-9  # length of a line that stands for a point


class RadioCoverage:
    """A radio among the obstacles of one arena, between any two points.

    Attributes:
        sensitivity_dbm: the least mean power that counts as in range; None for a unit disk.
    """

    def __init__(
        self,
        radio: Radio,
        key: np.uint64,
        obstacles: ObstacleIndices,
        payload_bytes: int,
        sender: Antenna | None = None,
    ) -> None:
        """`key` is the arena's, `obstacles` are those of this arena alone, `payload_bytes` is the size of a packet.

        `sender` is the antenna at the start of links, by default the radio's, which all receivers have.
        """
        self._radio, self._obstacles = radio, obstacles.now()
        self._sender, self._receiver = sender or radio.antenna_or_default, radio.antenna_or_default
        self._losses = LossChain.create(_context_of(radio, key, obstacles))
        self._range_m = math.inf if radio.range_m is None else radio.range_m
        self.sensitivity_dbm = sensitivity_of(radio) if radio.is_phy else None
        if radio.is_phy:
            shadowing, walls = radio.shadowing or Shadowing(deviation_db=0.0), radio.walls or Walls(0.0, 0.0)
            self._waves = field_waves(np.array([key], np.uint64), shadowing)[0]
            curve = radio.path_loss_model.curve(radio.frequency_hz)
            self._mean_loss = MeanLoss(curve, amplitude_db(shadowing), walls.crossing_db, walls.inside_db_per_m)
            self._by_power = self._delivery_by_power(key, 8 * (payload_bytes + radio.overhead_bytes))

    def mean_dbm(self, start: FloatArray, end: FloatArray) -> FloatArray | None:
        """Return the mean power between points (k, 2) in m, without fading, (k,); None for a unit disk.

        Points with a heading in rad are rows (k, 3).
        """
        if not self._radio.is_phy:
            return None
        start_m, end_m = (np.ascontiguousarray(points[:, :2], np.float64) for points in (start, end))
        loss_db = _mean_loss_db(self._mean_loss, self._waves, self._obstacles, start_m, end_m)
        if self.is_directional:
            self._add_pattern_losses(loss_db, start, end)
        return rssi_dbm(self._sender.power_dbm, self._sender.peak_dbi, self._receiver.peak_dbi, loss_db)

    @property
    def is_directional(self) -> bool:
        """True if the antenna of the sender or of receivers has a pattern."""
        return self._radio.is_phy and (self._sender.is_directional or self._receiver.is_directional)

    def _add_pattern_losses(self, loss_db: FloatArray, start: FloatArray, end: FloatArray) -> None:
        """Add the losses of the antennas of points with a heading, in place."""
        links, turning = len(loss_db), [points.shape[1] > 2 for points in (start, end)]
        antennas = self._sender if turning[0] else Antenna(), self._receiver if turning[1] else Antenna()
        patterns = antenna_patterns(antennas, np.repeat([0, 1], links))
        x, y = np.concatenate([start[:, :2], end[:, :2]]).T
        heading = np.concatenate([points[:, 2] if points.shape[1] > 2 else np.zeros(links) for points in (start, end)])
        a, b = np.arange(links), links + np.arange(links)
        add_pattern_losses(loss_db, patterns, x.copy(), y.copy(), np.zeros(2 * links), heading, a, b)

    def in_range(self, start: FloatArray, end: FloatArray) -> BoolArray:
        """Return True for links in range whose mean power reaches the sensitivity and that no obstacle blocks, (k,)."""
        mean_dbm, is_open = self.mean_dbm(start, end), self._open(start, end)
        if mean_dbm is None or self.sensitivity_dbm is None:
            return is_open
        return is_open & (mean_dbm >= self.sensitivity_dbm)

    def delivery(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Return the probability that a lone packet gets through, over all fading and bursts, (k,)."""
        mean_dbm, passes = self.mean_dbm(start, end), np.where(self._open(start, end), self._passing(len(start)), 0.0)
        if mean_dbm is None:
            return passes
        return np.where(mean_dbm < cut_off_dbm(self._radio), 0.0, passes * np.interp(mean_dbm, *self._by_power))

    def _passing(self, links: int) -> FloatArray | float:
        """Return the share of frames that pass all losses, (links,) or a scalar; each link has an arena of its own."""
        rows = np.arange(2 * links)
        return self._losses.passing * self._losses.delivery(rows[0::2], rows[1::2], 0)

    def is_free(self, points: FloatArray) -> BoolArray:
        """Return True for points (k, 2) in m that no obstacle covers, (k,)."""
        return ~_blocked(self._obstacles, points, points + np.array([POINT_M, 0.0]))

    def _open(self, start: FloatArray, end: FloatArray) -> BoolArray:
        """Return True for links within the radio's range and, if the radio needs it, with a line of sight, (k,)."""
        start, end = np.ascontiguousarray(start[:, :2]), np.ascontiguousarray(end[:, :2])
        offset = end - start
        within = (offset * offset).sum(axis=1) <= self._range_m * self._range_m
        return within & ~_blocked(self._obstacles, start, end) if self._radio.needs_line_of_sight else within

    def _delivery_by_power(self, key: np.uint64, bits: int) -> tuple[FloatArray, FloatArray]:
        """Return mean powers in dBm, rising, and the delivery at each."""
        assert self.sensitivity_dbm is not None
        params = phy_params_of(self._radio, 1)
        noise_dbm = self._radio.detector_noise_dbm
        low_dbm = min(noise_dbm, self.sensitivity_dbm) - FADING_RANGE_DB
        high_dbm = max(noise_dbm, self.sensitivity_dbm) + FADING_RANGE_DB
        mean_dbm = np.arange(low_dbm, high_dbm, POWER_STEP_DB)
        if self._radio.fading is None:
            return mean_dbm, lone_deliveries(params, mean_dbm, bits)
        gain_db = _gains_db(fading_model(self._radio.fading, self._radio.frequency_hz), key)
        return mean_dbm, np.array([lone_deliveries(params, dbm + gain_db, bits).mean() for dbm in mean_dbm])


def _context_of(radio: Radio, key: np.uint64, obstacles: ObstacleIndices) -> ChannelContext:
    """Return the context of two robots without bodies."""
    context = ChannelContext.open_space(radio, np.array([key], np.uint64), 2, (math.inf, math.inf))
    return replace(context, obstacles=obstacles)


@njit()
def _mean_loss_db(mean_loss, waves, obstacles, start, end):
    loss_db, entered = np.empty(len(start)), np.empty((len(obstacles.shape), 2))
    for i in range(len(start)):
        ax, ay = start[i]
        bx, by = end[i]
        distance_m = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        loss_db[i] = loss_between_db(mean_loss, waves, obstacles, entered, 0, distance_m, ax, ay, 0.0, bx, by, 0.0)
    return loss_db


@njit()
def _blocked(obstacles, start, end):
    blocked = np.zeros(len(start), np.bool_)
    for i in range(len(start)):
        blocked[i] = is_blocked(obstacles, 0, start[i, 0], start[i, 1], 0.0, end[i, 0], end[i, 1], 0.0, 0.0, 0.0)
    return blocked


@njit()
def _gains_db(law, key):
    """Return gains of fading on many links at different positions, which do not change the distribution."""
    out_db = np.empty(FADING_GAINS)
    for i in range(FADING_GAINS):
        x, y = 0.73 * i, 0.41 * i
        out_db[i] = to_db(fading_gain(law, key, 2 * i, 2 * i + 1, x, y, x + 1.0 + 0.013 * i, y))
    return out_db


CANDIDATES, MAX_LINKS, MIN_LINKS = 20_000, 2000, 50  # links of each distance: drawn, used at most, used at least
QUANTILES = (0.05, 0.95)
SURVEY = purpose("survey of coverage")


@dataclass(frozen=True, eq=False)
class CoverageMap:
    """A radio's coverage from one point, on a grid over the arena."""

    at_m: tuple[float, float]
    x_m: FloatArray  # (columns,) rising
    y_m: FloatArray  # (rows,) rising
    mean_dbm: FloatArray | None  # (rows, columns) without fading; None for a unit disk
    in_range: BoolArray  # (rows, columns)
    delivery: FloatArray  # (rows, columns) probability of a lone packet
    is_free: BoolArray  # (rows, columns) no obstacle covers the point

    def share(self, selected: BoolArray) -> float:
        """Return the share of selected points (rows, columns) among those free of obstacles."""
        return float(np.mean(selected[self.is_free])) if self.is_free.any() else math.nan


class Band(NamedTuple):
    """Mean and quantiles of a figure over links of each length."""

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
    coverage: RadioCoverage,
    size_m: tuple[float, float],
    at_m: tuple[float, float],
    points: int,
    heading_rad: float | None = None,
) -> CoverageMap:
    """Return the map from a point, with `points` grid points along the longer side of the arena.

    `heading_rad` is that of the sender, by default towards each point; antennas of receivers point at the sender.
    """
    step_m = max(size_m) / points
    x_m, y_m = (_cell_centres(side_m, step_m) for side_m in size_m)
    end = np.stack(np.meshgrid(x_m, y_m), axis=-1).reshape(-1, 2)
    pose = at_m if heading_rad is None else (*at_m, heading_rad)
    start = np.broadcast_to(np.array(pose), (len(end), len(pose)))
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
    """Return delivery and strength over links between free points of the arena, at distances up to `farthest_m`.

    Links are uniform in position and direction, and antennas with patterns in their headings, drawn by the arena's key.
    Distances with fewer than
    MIN_LINKS links that fit into the arena are omitted.
    """
    lengths_m = farthest_m * (np.arange(distances) + 0.5) / distances
    links = [_links(coverage, size_m, key, i, float(length_m)) for i, length_m in enumerate(lengths_m)]
    fits = [i for i, (start, _) in enumerate(links) if len(start) >= MIN_LINKS]
    mean_dbm = [dbm for i in fits if (dbm := coverage.mean_dbm(*links[i])) is not None]
    return ByDistance(
        distance_m=lengths_m[fits],
        delivery=_band([coverage.delivery(*links[i]) for i in fits]),
        mean_dbm=None if coverage.sensitivity_dbm is None else _band(mean_dbm),
    )


def _band(figures: list[FloatArray]) -> Band:
    rows = [(figure.mean(), *np.quantile(figure, QUANTILES)) for figure in figures]
    return Band(*np.array(rows, np.float64).reshape(-1, 3).T)


def _cell_centres(side_m: float, step_m: float) -> FloatArray:
    cells = max(round(side_m / step_m), 1)
    return side_m * ((np.arange(cells) + 0.5) / cells - 0.5)


def _links(
    coverage: RadioCoverage, size_m: tuple[float, float], key: np.uint64, distance_index: int, distance_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return start and end (k, 2) in m of links of this length, within the arena and outside obstacles.

    With directional antennas they have headings, (k, 3).
    """
    keys = np.array(key, np.uint64)
    x, y, turn = (uniform(keys, np.arange(CANDIDATES), distance_index, axis, SURVEY) for axis in range(3))
    start = (np.stack([x, y], axis=1) - 0.5) * size_m
    direction = np.stack([portable.cos(2.0 * np.pi * turn), portable.sin(2.0 * np.pi * turn)], axis=1)
    end = start + distance_m * direction
    fits = np.flatnonzero((np.abs(end) <= 0.5 * np.array(size_m)).all(axis=1))
    fits = fits[coverage.is_free(start[fits]) & coverage.is_free(end[fits])][:MAX_LINKS]
    if coverage.is_directional:
        headings = (2.0 * np.pi * uniform(keys, np.arange(CANDIDATES), distance_index, i, SURVEY) for i in (3, 4))
        start, end = (np.column_stack([ends, heading]) for ends, heading in zip((start, end), headings, strict=True))
    return start[fits], end[fits]
