"""The table of links: who is near enough to whom to hear or to disturb, and how strong.

Power = transmit power + both antennas - path loss - shadowing - walls - bodies, and fading on top. All of it is the
same both ways and depends on poses alone, so that each pair is computed once. A pair is left out if path loss alone, or
all but fading, leaves it below the cut-off: it neither hears nor disturbs.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms import grid
from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.propagation.bodies_between import bodies_between
from swarmwire.comms.air.propagation.fading import FadingLaw, fading_gain
from swarmwire.comms.air.propagation.link_budget import rssi_dbm
from swarmwire.comms.air.propagation.loss_curve import LossCurve
from swarmwire.comms.air.propagation.path_loss import loss_db
from swarmwire.comms.air.propagation.shadowing import shadowing_db
from swarmwire.comms.air.propagation.walls import wall_loss_db
from swarmwire.comms.air.reach import CELL_SLACK, _strip
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.geometry import Obstacles, is_blocked


class Surroundings(NamedTuple):
    """Propagation in numbers."""

    power_dbm: float
    gain_dbi: float
    curve: LossCurve
    reach_m: float  # no link is longer
    least_dbm: float  # no link is weaker, fading apart
    shadows: bool
    amplitude_db: float
    waves: FloatArray  # (arenas, 3, n), as `field_waves` has them
    walls: bool
    crossing_db: float
    inside_db_per_m: float
    line_of_sight: bool
    bodies: bool
    body_db: float
    radius_m: FloatArray  # (rows,)
    most_radius_m: float
    fades: bool
    law: FadingLaw


class Pairs(NamedTuple):
    """Pairs of robot rows a < b."""

    a: IntArray  # (k,)
    b: IntArray  # (k,)
    mean_dbm: FloatArray  # (k,) without fading
    power_mw: FloatArray  # (k,) with fading
    blocked: IntArray  # (k,) 1 where an obstacle stands in a needed line of sight


def pairs_of(pose: FloatArray, size_m: tuple[float, float], keys, obstacles: Obstacles, around: Surroundings) -> Pairs:
    """All pairs above the cut-off of robots that stand at `pose` (rows, 3)."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    arenas = len(keys)
    cells = grid.build(x, y, arenas, size_m, around.reach_m * CELL_SLACK)
    robots = len(x) // arenas
    a, b = _near(x, y, robots, cells, around.reach_m)
    kept, mean_dbm, power_mw, blocked = _strengths(x, y, robots, keys, obstacles, cells, around, a, b)
    return Pairs(a[kept], b[kept], mean_dbm[kept], power_mw[kept], blocked[kept])


@njit(cache=True)
def both_ways(rows, a, b):
    """Links by sender: order (2k,) of directed links (k of a to b, then k of b to a), and start (rows + 1,)."""
    k = len(a)
    start = np.zeros(rows + 1, np.int64)
    for i in range(k):
        start[a[i] + 1] += 1
        start[b[i] + 1] += 1
    for r in range(rows):
        start[r + 1] += start[r]
    filled = start[:-1].copy()
    order = np.empty(2 * k, np.int64)
    for i in range(k):
        order[filled[a[i]]] = i
        filled[a[i]] += 1
        order[filled[b[i]]] = k + i
        filled[b[i]] += 1
    return order, start


@njit(cache=True)
def _near(x, y, robots, cells, reach_m):
    most = 0
    for s in range(len(x)):
        for j in range(-1, 2):
            first, stop = _strip(x[s], y[s], s // robots, cells, j)
            most += stop - first
    a, b = np.empty(most, np.int64), np.empty(most, np.int64)
    found = 0
    for s in range(len(x)):
        for j in range(-1, 2):
            first, stop = _strip(x[s], y[s], s // robots, cells, j)
            for at in range(first, stop):
                r = cells.order[at]
                dx, dy = x[r] - x[s], y[r] - y[s]
                a[found], b[found] = s, r
                found += (r > s) & (dx * dx + dy * dy <= reach_m * reach_m)
    return a[:found].copy(), b[:found].copy()


@njit(cache=True)
def _strengths(x, y, robots, keys, obstacles, cells, around, a, b):
    kept = np.zeros(len(a), np.bool_)
    mean_dbm, power_mw, blocked = np.zeros(len(a)), np.zeros(len(a)), np.zeros(len(a), np.int64)
    for i in range(len(a)):
        s, r = a[i], b[i]
        arena = s // robots
        dx, dy = x[r] - x[s], y[r] - y[s]
        loss = loss_db(around.curve, math.sqrt(dx * dx + dy * dy))
        if around.shadows:
            loss += shadowing_db(around.waves[arena], around.amplitude_db, x[s], y[s], x[r], y[r])
        if around.walls:
            crossing_db, inside_db_per_m = around.crossing_db, around.inside_db_per_m
            loss += wall_loss_db(obstacles, arena, crossing_db, inside_db_per_m, x[s], y[s], x[r], y[r])
        if around.bodies:
            between = bodies_between(x, y, around.radius_m, around.most_radius_m, cells, robots, s, r)
            loss += between * around.body_db
        mean_dbm[i] = rssi_dbm(around.power_dbm, around.gain_dbi, around.gain_dbi, loss)
        kept[i] = mean_dbm[i] >= around.least_dbm
        if not kept[i]:
            continue
        power_mw[i] = from_db(mean_dbm[i])
        if around.fades:
            key = keys[arena]
            power_mw[i] *= fading_gain(around.law, key, s % robots, r % robots, x[s], y[s], x[r], y[r])
        if around.line_of_sight:
            blocked[i] = is_blocked(obstacles, arena, x[s], y[s], x[r], y[r])
    return kept, mean_dbm, power_mw, blocked
