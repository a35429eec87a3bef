"""Antenna patterns: the loss of a direction against the main direction of an antenna, in dB, at least 0.

An antenna turns with its robot: its main direction is `azimuth_deg` left of the heading and `elevation_deg` above the
horizontal. Robots drive upright, so that the elevation of a link follows from the two heights alone. Antennas are equal
when sending and receiving, so that the loss of a link is equal both ways. Sources of the formulas:

- half-wave dipole: C. A. Balanis, Antenna Theory, 4th edition, (4-84): U ~ (cos(pi/2 cos theta) / sin theta)^2 at the
  angle theta to its axis;
- patch: 3GPP TR 38.901, table 7.3-1: min(12 (phi / phi_3dB)^2, A) in azimuth and in elevation, and A at most in sum.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray, IntArray, Table, record_type
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.config.antennas import PATTERNS, Antenna, Pattern
from swarmwire.comms.radio.propagation.decibels import to_db

OMNIDIRECTIONAL, DIPOLE, PATCH, _ = range(len(PATTERNS))
TURN_RAD = 2.0 * math.pi
PATTERN = record_type(
    [
        ("model", np.int64),  # index in PATTERNS
        ("azimuth_rad", np.float64),
        ("cos_elevation", np.float64),
        ("sin_elevation", np.float64),
        ("beam_width_rad", np.float64),
        ("beam_height_rad", np.float64),
        ("max_loss_db", np.float64),
        # A table, in `AntennaPatterns.number`: azimuths and elevations in rad, then losses in dB by elevation.
        ("first", np.int64),
        ("azimuths", np.int64),
        ("elevations", np.int64),
    ]
)


class AntennaPatterns(NamedTuple):
    """Patterns of robots as numbers for kernels."""

    pattern: Table  # (patterns,) of dtype PATTERN
    index: IntArray  # (rows,) pattern of each robot
    number: FloatArray  # (n,) content of the tables


def antenna_patterns(antennas: Sequence[Antenna], index: IntArray) -> AntennaPatterns:
    """Return the patterns of robots, `index` (rows,) being their antennas."""
    pattern: Table = np.zeros(len(antennas), PATTERN)
    numbers: list[FloatArray] = [np.empty(0)]
    for row, antenna in zip(pattern, antennas, strict=True):
        _fill(row, antenna.pattern or Pattern(), numbers)
    return AntennaPatterns(pattern, index, np.concatenate(numbers))


def _fill(row, pattern: Pattern, numbers: list[FloatArray]) -> None:
    """Fill in the row of a pattern, and append its table to `numbers`."""
    row["model"] = PATTERNS.index(pattern.model)
    row["azimuth_rad"], elevation_rad = math.radians(pattern.azimuth_deg), math.radians(pattern.elevation_deg)
    row["cos_elevation"], row["sin_elevation"] = portable.cos(elevation_rad), portable.sin(elevation_rad)
    row["beam_width_rad"] = math.radians(pattern.beam_width_deg)
    row["beam_height_rad"] = math.radians(pattern.beam_height_deg)
    row["max_loss_db"] = pattern.max_loss_db
    if pattern.table is not None:
        azimuth_rad, elevation_rad = np.radians(pattern.table.azimuth_deg), np.radians(pattern.table.elevation_deg)
        row["first"] = sum(map(len, numbers))
        row["azimuths"], row["elevations"] = len(azimuth_rad), len(elevation_rad)
        numbers += [azimuth_rad, elevation_rad, pattern.peak_db - np.array(pattern.table.gain_db)]


@njit(nogil=True)
def add_pattern_losses(loss_db, patterns, x, y, z, heading_rad, a, b):
    """Add the loss of both antennas to that of each pair of robot rows `a` and `b`, (k,), in place.

    `patterns` is an `AntennaPatterns`; positions in m and headings are by robot row. Robots in one point have none.
    """
    for i in range(len(a)):
        s, r = a[i], b[i]
        dx, dy, dz = x[r] - x[s], y[r] - y[s], z[r] - z[s]
        sender_db = direction_loss_db(patterns, s, heading_rad[s], dx, dy, dz)
        loss_db[i] += sender_db + direction_loss_db(patterns, r, heading_rad[r], -dx, -dy, -dz)


@njit()
def losses_towards(patterns, x, y, z, heading_rad, robots, arena, position):
    """Return the loss at each robot of arena[j] of what comes from position[j] (x, y, z) in m, in dB, (k, robots)."""
    loss_db = np.empty((len(arena), robots))
    for j in range(len(arena)):
        for i in range(robots):
            r = arena[j] * robots + i
            dx, dy, dz = position[j, 0] - x[r], position[j, 1] - y[r], position[j, 2] - z[r]
            loss_db[j, i] = direction_loss_db(patterns, r, heading_rad[r], dx, dy, dz)
    return loss_db


@kernel(from_python=True)
def direction_loss_db(patterns, r, heading_rad, dx, dy, dz):
    """Return the loss of the antenna of robot row r in the direction (dx, dy, dz) of the arena's frame, in dB."""
    row = patterns.pattern[patterns.index[r]]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if row.model == OMNIDIRECTIONAL or distance == 0.0:
        return 0.0
    sine, cosine = math_compiled.sin_cos(heading_rad + row.azimuth_rad)
    level, left = cosine * dx + sine * dy, cosine * dy - sine * dx
    ahead = row.cos_elevation * level + row.sin_elevation * dz
    up = row.cos_elevation * dz - row.sin_elevation * level
    if row.model == DIPOLE:
        return min(_dipole_loss_db(up / distance), row.max_loss_db)
    azimuth, elevation = math_compiled.atan2(left, ahead), math_compiled.atan2(up, math_compiled.hypot(left, ahead))
    if row.model == PATCH:
        return min(
            _parabola_db(azimuth, row.beam_width_rad, row.max_loss_db)
            + _parabola_db(elevation, row.beam_height_rad, row.max_loss_db),
            row.max_loss_db,
        )
    return _table_loss_db(patterns.number, row.first, row.azimuths, row.elevations, azimuth, elevation)


@kernel()
def _dipole_loss_db(along):
    """Return the loss of a half-wave dipole, `along` being the cosine of the angle to its axis; inf on the axis."""
    across = 1.0 - along * along
    if across <= 0.0:
        return math.inf
    field = math_compiled.cos(0.5 * math.pi * along)
    return -to_db(field * field / across)


@kernel()
def _parabola_db(angle_rad, width_rad, max_loss_db):
    """Return 12 (phi / phi_3dB)^2 dB, up to `max_loss_db`."""
    share = angle_rad / width_rad
    return min(12.0 * share * share, max_loss_db)


@kernel()
def _table_loss_db(number, first, azimuths, elevations, azimuth, elevation):
    """Return the loss of a table: bilinear over azimuth and elevation in rad."""
    azimuth -= TURN_RAD * math.floor((azimuth - number[first]) / TURN_RAD)  # not before the first one
    i, before = _row_below(number, first, azimuths, azimuth), number[first]
    is_last = i == azimuths - 1
    after = before + TURN_RAD if is_last else number[first + i + 1]
    next_i = 0 if is_last else i + 1
    east = (azimuth - number[first + i]) / (after - number[first + i])
    height = first + azimuths
    j = _row_below(number, height, elevations, elevation)
    next_j = min(j + 1, elevations - 1)
    north = 0.0
    if next_j > j:
        north = (elevation - number[height + j]) / (number[height + next_j] - number[height + j])
        north = max(north, 0.0)
    lower, upper = height + elevations + j * azimuths, height + elevations + next_j * azimuths
    low = number[lower + i] + east * (number[lower + next_i] - number[lower + i])
    high = number[upper + i] + east * (number[upper + next_i] - number[upper + i])
    return low + north * (high - low)


@kernel()
def _row_below(number, first, count, value):
    """Return the last of `count` rising numbers from `first` on that is at most `value`, or 0."""
    low, high = 0, count - 1
    while low < high:
        middle = (low + high + 1) // 2
        if number[first + middle] <= value:
            low = middle
        else:
            high = middle - 1
    return low
