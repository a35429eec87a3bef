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

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.geometry import robot_index
from swarmwire.comms.geometry.obstacles import Obstacles, is_blocked
from swarmwire.comms.kernels import kernel
from swarmwire.comms.radio.phy.losses import MeasuredLinks
from swarmwire.comms.radio.phy.propagation import PropagationParams
from swarmwire.comms.radio.propagation import fading, shadowing
from swarmwire.comms.radio.propagation.fading import gain_of
from swarmwire.comms.radio.propagation.obstruction import bodies_between, wall_loss_db
from swarmwire.comms.radio.propagation.path_loss import loss_db
from swarmwire.comms.radio.propagation.shadowing import SUMS
from swarmwire.comms.radio.unit_disk.neighbours import CELL_SLACK, strip


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
    running: BoolArray,
    obstacles: Obstacles,
    around: PropagationParams,
    measured: MeasuredLinks | None = None,
) -> Pairs:
    """All pairs above the cut-off of robots that stand at `pose` (rows, 3), and those of measured strength.

    Arenas that are not `running` (arenas,) are left out.
    """
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    robots = len(x) // len(keys)
    cells = robot_index.build(x, y, len(keys), size_m, around.reach_m * CELL_SLACK, running)
    a, b, loss = _near(x, y, robots, cells, around)
    if around.shadows:
        _add_shadows(loss, x, y, robots, cells.order, around.field, around.amplitude_db, a, b)
    if around.walls:
        _add_walls(loss, x, y, robots, obstacles, around.crossing_db, around.inside_db_per_m, a, b)
    if around.bodies:
        _add_bodies(loss, x, y, robots, cells, around.radius_m, around.most_radius_m, around.body_db, a, b)
    kept = int(_above(around.least_dbm, around.send_dbm, around.receive_dbi, a, b, loss))
    a, b, loss = a[:kept], b[:kept], loss[:kept]
    if measured is not None:
        a, b, loss = measured.with_unlisted(a, b, loss)
    gain, blocked = np.ones(len(a)), np.zeros(len(a), np.int64)
    if around.fades:
        _fade(gain, x, y, robots, keys, cells.order, around.scatter, around.law, a, b)
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
def _near(x, y, robots, cells, around):
    """Pairs above the cut-off by path loss alone, but for what shadowing may add, and this loss in dB."""
    ahead = np.empty((len(cells.order), 2, 2), np.uint64)
    most = _look_ahead(ahead, x, y, robots, cells)
    a, b, loss = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    near, metres2 = np.empty(2 * len(x), np.uint64), np.empty(2 * len(x))
    there_x, there_y = x[cells.order], y[cells.order]
    found = _join(a, b, loss, cells.order, there_x, there_y, ahead, around, near, metres2)
    return a[:found], b[:found], loss[:found]


@kernel()
def _look_ahead(ahead, x, y, robots, cells):
    """Whom the robot at each place in the grid's order makes pairs with, and how many pairs there are at most.

    What comes later in its own row of cells (j = 0), and the row above (j = 1): from ahead[place, j, 0] on to before
    ahead[place, j, 1].
    """
    most = 0
    for at in range(len(cells.order)):
        s = cells.order[at]
        for j in range(2):
            first, stop = strip(x[s], y[s], s // robots, cells, j)
            first = at + 1 if j == 0 else first
            ahead[at, j, 0], ahead[at, j, 1] = first, stop
            most += stop - first
    return most


@kernel()
def _join(a, b, loss, order, x, y, ahead, around, near, metres2):
    """Put in the pairs, and say how many; `x` and `y` are in the grid's order."""
    found, square_m2, curve = np.uint64(0), around.reach_m * around.reach_m, around.curve
    send_dbm, receive_dbi, least_dbm = around.send_dbm, around.receive_dbi, around.least_dbm - around.spread_db
    for at in range(np.uint64(len(x))):
        few, s = np.uint64(0), order[at]
        for j in range(2):
            for k in range(ahead[at, j, 0], ahead[at, j, 1]):
                dx, dy = x[k] - x[at], y[k] - y[at]
                # Written first and kept if it counts: a branch would be guessed wrong too often.
                near[few], metres2[few] = k, dx * dx + dy * dy
                few += np.uint64(metres2[few] <= square_m2)
        for k in range(few):
            r = order[near[k]]
            a[found], b[found], loss[found] = min(s, r), max(s, r), loss_db(curve, math.sqrt(metres2[k]))
            # Who is near enough must not depend on other robots' antennas, of which `reach_m` knows the best.
            found += np.uint64(_best_dbm(send_dbm, receive_dbi, s, r) - loss[found] >= least_dbm)
    return found


@njit(cache=True)
def _add_shadows(loss, x, y, robots, rows, field, amplitude_db, a, b):
    single = np.float32
    height = np.empty((len(x), shadowing.WAVES), single)
    for r in rows:
        shadowing.heights(field[r // robots], x[r], y[r], height[r])
    _add_between(loss, x, y, robots, field.astype(single), amplitude_db, a, b, height, np.empty(SUMS, single))


@kernel()
def _add_between(loss, x, y, robots, field, amplitude_db, a, b, height, parts):
    for i in range(len(a)):
        s, r = a[i], b[i]
        dx, dy = np.float32(x[r] - x[s]), np.float32(y[r] - y[s])
        loss[i] += shadowing.between_db(field, s // robots, amplitude_db, height, s, r, dx, dy, parts)


@njit(cache=True)
def _add_walls(loss, x, y, robots, obstacles, crossing_db, inside_db_per_m, a, b):
    for i in range(len(a)):
        s, r = a[i], b[i]
        loss[i] += wall_loss_db(obstacles, s // robots, crossing_db, inside_db_per_m, x[s], y[s], x[r], y[r])


@njit(cache=True)
def _add_bodies(loss, x, y, robots, cells, radius_m, most_radius_m, body_db, a, b):
    for i in range(len(a)):
        loss[i] += body_db * bodies_between(x, y, radius_m, most_radius_m, cells, robots, a[i], b[i])


@kernel(from_python=True)
def _above(least_dbm, send_dbm, receive_dbi, a, b, loss):
    """Put pairs in which either hears the other with so much power before the others, and say how many there are."""
    kept = np.uint64(0)
    for i in range(len(a)):
        s, r = a[i], b[i]
        a[kept], b[kept], loss[kept] = s, r, loss[i]
        kept += np.uint64(_best_dbm(send_dbm, receive_dbi, s, r) - loss[i] >= least_dbm)
    return kept


@kernel()
def _best_dbm(send_dbm, receive_dbi, s, r):
    """The power with which the better of both would hear the other, without losses."""
    s, r = np.uint64(s), np.uint64(r)
    return max(send_dbm[s] + receive_dbi[r], send_dbm[r] + receive_dbi[s])


@njit(cache=True)
def _fade(gain, x, y, robots, keys, rows, scatter, law, a, b):
    at, number = np.zeros((len(x), 4, fading.WAVES), np.float32), np.zeros(len(x), np.uint64)
    for r in rows:
        fading.arriving(scatter[r // robots], x[r], y[r], at[r])
        number[r] = fading.own_number(keys[r // robots], r % robots)
    parts = np.empty((2, SUMS), np.float32)
    _gains(gain, x, y, at, number, law, a, b, parts[0], parts[1])


@kernel()
def _gains(gain, x, y, at, number, law, a, b, real, imaginary):
    for i in range(len(a)):
        s, r = a[i], b[i]
        h = fading.scattered(fading.signs_of(number[s], number[r]), at, s, r, real, imaginary)
        dx, dy = x[r] - x[s], y[r] - y[s]
        gain[i] = gain_of(law, h, math.sqrt(dx * dx + dy * dy))


@njit(cache=True)
def _find_blocked(blocked, x, y, robots, obstacles, a, b):
    for i in range(len(a)):
        s, r = a[i], b[i]
        blocked[i] = is_blocked(obstacles, s // robots, x[s], y[s], x[r], y[r])
