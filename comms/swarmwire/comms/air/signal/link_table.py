"""The table of links: who is near enough to whom to hear or to disturb, and how strong.

Power = transmit power + both antennas - path loss - shadowing - walls - bodies, and fading on top. All but the sender's
power and event-made differences is the same both ways and depends on poses alone, so that each pair is computed once.
A pair is left out if path loss alone, or all but fading, leaves it below the cut-off: it neither hears nor disturbs.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.air.propagation import scattering, shadowing
from swarmwire.comms.air.propagation.bodies_between import bodies_between
from swarmwire.comms.air.propagation.fading import FadingLaw, gain_of
from swarmwire.comms.air.propagation.loss_curve import LossCurve
from swarmwire.comms.air.propagation.path_loss import loss_db
from swarmwire.comms.air.propagation.walls import wall_loss_db
from swarmwire.comms.air.reach import CELL_SLACK, strip
from swarmwire.comms.air.signal.measured_links import MeasuredLinks
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.geometry import grid
from swarmwire.comms.geometry.obstacles import Obstacles, is_blocked


class Surroundings(NamedTuple):
    """Propagation in numbers."""

    send_dbm: FloatArray  # (rows,) transmit power and antenna gain
    receive_dbi: FloatArray  # (rows,) antenna gain
    curve: LossCurve
    reach_m: float  # no link is longer
    least_dbm: float  # no link is weaker, fading apart
    spread_db: float  # by how much shadowing may make up for path loss
    shadows: bool
    amplitude_db: float
    field: FloatArray  # (arenas, 3, n), as `field_waves` has them
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
    scatter: FloatArray  # (arenas, 5, n), as `scatter_waves` has them


class Pairs(NamedTuple):
    """Pairs of robot rows a < b."""

    a: IntArray  # (k,)
    b: IntArray  # (k,)
    loss_db: FloatArray  # (k,) from a to b, without antennas and fading
    back_db: FloatArray  # (k,) from b to a: the same array, unless links were measured
    gain: FloatArray  # (k,) of fading, a ratio
    blocked: IntArray  # (k,) 1 where an obstacle stands in a needed line of sight


def pairs_of(
    pose: FloatArray,
    size_m: tuple[float, float],
    keys,
    obstacles: Obstacles,
    around: Surroundings,
    measured: MeasuredLinks | None = None,
) -> Pairs:
    """All pairs above the cut-off of robots that stand at `pose` (rows, 3), and those of measured strength."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    robots = len(x) // len(keys)
    cells = grid.build(x, y, len(keys), size_m, around.reach_m * CELL_SLACK)
    a, b, loss = _near(x, y, robots, cells, around.reach_m, around.curve)
    # Who is near enough must not depend on other robots' antennas, of which `reach_m` knows the best.
    a, b, loss = _above(around.least_dbm - around.spread_db, around.send_dbm, around.receive_dbi, a, b, loss)
    if around.shadows:
        _add_shadows(loss, x, y, robots, around.field, around.amplitude_db, a, b)
    if around.walls:
        _add_walls(loss, x, y, robots, obstacles, around.crossing_db, around.inside_db_per_m, a, b)
    if around.bodies:
        _add_bodies(loss, x, y, robots, cells, around.radius_m, around.most_radius_m, around.body_db, a, b)
    a, b, loss = _above(around.least_dbm, around.send_dbm, around.receive_dbi, a, b, loss)
    if measured is not None:
        a, b, loss = measured.with_unlisted(a, b, loss)
    gain, blocked = np.ones(len(a)), np.zeros(len(a), np.int64)
    if around.fades:
        _fade(gain, x, y, robots, keys, around.scatter, around.law, a, b)
    if around.line_of_sight:
        _find_blocked(blocked, x, y, robots, obstacles, a, b)
    pairs = Pairs(a, b, loss, loss, gain, blocked)
    return pairs if measured is None else _measured(pairs, measured)


def _measured(pairs: Pairs, measured: MeasuredLinks) -> Pairs:
    """The pairs with what was measured in place of the model, each way; what blocked them was measured, too."""
    a, b, blocked = pairs.a, pairs.b, pairs.blocked > 0
    there_db, is_there = measured.loss_db(a, b, pairs.loss_db)
    back_db, is_back = measured.loss_db(b, a, pairs.loss_db)
    there_db[blocked & is_back & ~is_there] = np.inf
    back_db[blocked & is_there & ~is_back] = np.inf
    still_blocked = np.where(is_there | is_back, 0, pairs.blocked)
    return pairs._replace(loss_db=there_db, back_db=back_db, blocked=still_blocked)


@njit(cache=True)
def _near(x, y, robots, cells, reach_m, curve):
    """Pairs within reach, and their path loss in dB."""
    most = 0
    for at in range(len(x)):
        for j in range(2):
            first, stop = _ahead(x, y, robots, cells, at, j)
            most += stop - first
    a, b, metres2 = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    found = 0
    for at in range(len(x)):
        s = cells.order[at]
        for j in range(2):
            first, stop = _ahead(x, y, robots, cells, at, j)
            for k in range(first, stop):
                r = cells.order[k]
                dx, dy = x[r] - x[s], y[r] - y[s]
                # Written first and kept if it counts: a branch would be guessed wrong too often.
                a[found], b[found], metres2[found] = min(s, r), max(s, r), dx * dx + dy * dy
                found += metres2[found] <= reach_m * reach_m
    loss = np.empty(found)
    for i in range(found):
        loss[i] = loss_db(curve, math.sqrt(metres2[i]))
    return a[:found].copy(), b[:found].copy(), loss


@njit(cache=True)
def _ahead(x, y, robots, cells, at, j):
    """First and stop in the grid's order of those that the robot at `at` in it makes pairs with.

    What comes later in its own row of cells (j = 0), and the row above (j = 1).
    """
    s = cells.order[at]
    first, stop = strip(x[s], y[s], s // robots, cells, j)
    return (at + 1, stop) if j == 0 else (first, stop)


@njit(cache=True)
def _add_shadows(loss, x, y, robots, field, amplitude_db, a, b):
    waves, single = field.shape[2], np.float32
    height, parts, coarse = np.empty((len(x), waves), single), np.empty(waves, single), field.astype(single)
    for r in range(len(x)):
        shadowing.heights(field[r // robots], x[r], y[r], height[r])
    for i in range(len(a)):
        s, r = a[i], b[i]
        dx, dy = single(x[r] - x[s]), single(y[r] - y[s])
        loss[i] += shadowing.between_db(coarse, s // robots, amplitude_db, height, s, r, dx, dy, parts)


@njit(cache=True)
def _add_walls(loss, x, y, robots, obstacles, crossing_db, inside_db_per_m, a, b):
    for i in range(len(a)):
        s, r = a[i], b[i]
        loss[i] += wall_loss_db(obstacles, s // robots, crossing_db, inside_db_per_m, x[s], y[s], x[r], y[r])


@njit(cache=True)
def _add_bodies(loss, x, y, robots, cells, radius_m, most_radius_m, body_db, a, b):
    for i in range(len(a)):
        loss[i] += body_db * bodies_between(x, y, radius_m, most_radius_m, cells, robots, a[i], b[i])


@njit(cache=True)
def _above(least_dbm, send_dbm, receive_dbi, a, b, loss):
    """Pairs in which either hears the other with so much power."""
    kept = 0
    for i in range(len(a)):
        s, r = a[i], b[i]
        best_dbm = max(send_dbm[s] + receive_dbi[r], send_dbm[r] + receive_dbi[s]) - loss[i]
        a[kept], b[kept], loss[kept] = s, r, loss[i]
        kept += best_dbm >= least_dbm
    return a[:kept].copy(), b[:kept].copy(), loss[:kept].copy()


@njit(cache=True)
def _fade(gain, x, y, robots, keys, scatter, law, a, b):
    waves = scatter.shape[2]
    at, parts = np.empty((len(x), 4, waves), np.float32), np.empty((2, waves), np.float32)
    real, imaginary, number = parts[0], parts[1], np.empty(len(x), np.uint64)
    for r in range(len(x)):
        scattering.arriving(scatter[r // robots], x[r], y[r], at[r])
        number[r] = scattering.own_number(keys[r // robots], r % robots)
    for i in range(len(a)):
        s, r = a[i], b[i]
        h = scattering.scattered(scattering.signs_of(number[s], number[r]), at, s, r, real, imaginary)
        dx, dy = x[r] - x[s], y[r] - y[s]
        gain[i] = gain_of(law, h, math.sqrt(dx * dx + dy * dy))


@njit(cache=True)
def _find_blocked(blocked, x, y, robots, obstacles, a, b):
    for i in range(len(a)):
        s, r = a[i], b[i]
        blocked[i] = is_blocked(obstacles, s // robots, x[s], y[s], x[r], y[r])
