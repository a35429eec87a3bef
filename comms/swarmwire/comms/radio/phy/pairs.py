"""Pairs of robots near enough to receive or to interfere, and the loss and fading gain between them.

Power = transmit power + antenna gains - path loss - patterns - shadowing - walls - bodies + fading. Antenna gains are
those of the main directions, and patterns lose dB against them. All terms except the sender's power and the gains of
events are equal in both directions and depend on poses only, so each pair is computed once.
Distances are in space; the fields of shadowing and fading lie in the plane, and do not change with height. A pair is
omitted if path loss alone, or all terms without fading, give less than the cut-off. Measured strengths replace
modelled strengths.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry import robot_index
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.phy.propagation import PropagationParams
from swarmwire.comms.radio.propagation import fading, shadowing
from swarmwire.comms.radio.propagation.antennas import add_pattern_losses
from swarmwire.comms.radio.propagation.fading import field_gain
from swarmwire.comms.radio.propagation.obstruction import BodyParams, bodies_between, wall_loss_db
from swarmwire.comms.radio.propagation.path_loss import lifted, loss_db
from swarmwire.comms.radio.propagation.shadowing import SUMS
from swarmwire.comms.radio.stages.blocking import LineOfSight
from swarmwire.comms.radio.traces import LinkTraces


class Pairs(NamedTuple):
    """Pairs of robot rows a < b."""

    a: IntArray  # (k,)
    b: IntArray  # (k,)
    loss_db: FloatArray  # (k,) from a to b, against antennas that point at each other, without fading
    reverse_db: FloatArray  # (k,) from b to a: the same array, unless links were measured
    gain: FloatArray  # (k,) power gain of fading, a ratio
    blocked: BoolArray  # (k,) an obstacle blocks a required line of sight


def pairs_of(
    pose: FloatArray,
    size_m: tuple[float, float],
    keys,
    running: BoolArray,
    obstacles: ObstacleIndices,
    propagation: PropagationParams,
    line_of_sight: LineOfSight | None = None,
    measured: "MeasuredLinks | None" = None,
) -> Pairs:
    """Return all pairs above the cut-off of robots at `pose` (rows, 4), and all pairs of measured strength.

    Arenas that are not `running` (arenas,) have no pairs.
    """
    x, y, z = (np.ascontiguousarray(pose[:, column]) for column in (0, 1, 3))
    robots = len(x) // len(keys)
    if propagation.curve.sender_height_m > 0.0:
        propagation = propagation.up_to(float(z.max()))
    grid = robot_index.grid_over(size_m, propagation.reach_m, len(keys), len(x), clamps=True)
    robot_index.sort(grid, pose.reshape(len(keys), robots, pose.shape[1]), running)
    order = robot_index.rows_in_order(grid, len(keys), robots)
    a, b, loss = _near(x, y, z, robots, grid, order, propagation)
    if propagation.directs:
        add_pattern_losses(loss, propagation.patterns, x, y, z, np.ascontiguousarray(pose[:, 2]), a, b)
    if propagation.shadows:
        _add_shadows(loss, x, y, robots, order, propagation.field, propagation.amplitude_db, a, b)
    if propagation.walls:
        _add_walls(loss, x, y, z, robots, obstacles.now(), propagation.crossing_db, propagation.inside_db_per_m, a, b)
    if propagation.bodies:
        radius_m, height_m = propagation.radius_m, propagation.height_m
        bodies = BodyParams(x, y, z, radius_m, height_m, float(radius_m.max()), grid, robots)
        loss += propagation.body_db * bodies_between(bodies, a, b)
    count = int(_above(propagation.min_dbm, propagation.send_dbm, propagation.receive_dbi, a, b, loss))
    a, b, loss = a[:count], b[:count], loss[:count]
    if measured is not None:
        a, b, loss = measured.with_unlisted(a, b, loss)
    gain = np.ones(len(a))
    if propagation.fades:
        _fade(gain, x, y, z, robots, keys, order, propagation.scatter, propagation.fading_model, a, b)
    blocked = np.zeros(len(a), np.bool_) if line_of_sight is None else line_of_sight.blocked(pose, a, b)
    pairs = Pairs(a, b, loss, loss, gain, blocked)
    return pairs if measured is None else _measured(pairs, measured)


def _measured(pairs: Pairs, measured: "MeasuredLinks") -> Pairs:
    """Return the pairs with measured losses in place of modelled losses, per direction; they include blocking."""
    a, b, blocked = pairs.a, pairs.b, pairs.blocked
    forward_db, forward_measured = measured.loss_db(a, b, pairs.loss_db)
    reverse_db, reverse_measured = measured.loss_db(b, a, pairs.loss_db)
    forward_db[blocked & reverse_measured & ~forward_measured] = np.inf
    reverse_db[blocked & forward_measured & ~reverse_measured] = np.inf
    still_blocked = blocked & ~(forward_measured | reverse_measured)
    return pairs._replace(loss_db=forward_db, reverse_db=reverse_db, blocked=still_blocked)


@njit(nogil=True)
def _near(x, y, z, robots, grid, order, propagation):
    """Return pairs above the cut-off by path loss alone, with a margin for shadowing, and this loss in dB."""
    ahead = np.empty((len(order), 2, 2), np.uint64)
    capacity = _look_ahead(ahead, x, y, robots, grid, order)
    a, b, loss = np.empty(capacity, np.int64), np.empty(capacity, np.int64), np.empty(capacity)
    near, square_distance_m2 = np.empty(2 * len(x), np.uint64), np.empty(2 * len(x))
    near_loss_db = np.empty(2 * len(x))
    sorted_xyz = x[order], y[order], z[order]
    count = _join(a, b, loss, order, *sorted_xyz, ahead, propagation, near, square_distance_m2, near_loss_db)
    return a[:count], b[:count], loss[:count]


@kernel()
def _look_ahead(ahead, x, y, robots, grid, order):
    """Find the candidates for a pair with each robot, in grid order; return the number of candidate pairs.

    Candidates are later robots in the same row of cells (j = 0) and robots in the row above (j = 1):
    range(ahead[i, j, 0], ahead[i, j, 1]) for the robot at index i of `order`.
    """
    capacity = 0
    for i in range(len(order)):
        s = order[i]
        for j in range(2):
            first, stop = robot_index.run_near(grid, s // robots, x[s], y[s], j)
            first = i + 1 if j == 0 else first
            ahead[i, j, 0], ahead[i, j, 1] = first, stop
            capacity += stop - first
    return capacity


@kernel()
def _join(a, b, loss, order, x, y, z, ahead, propagation, near, square_distance_m2, near_loss_db):
    """Write the pairs and return their number; `x`, `y` and `z` are in grid order."""
    count, square_m2, curve = np.uint64(0), propagation.reach_m * propagation.reach_m, propagation.curve
    send_dbm, receive_dbi, min_dbm = (
        propagation.send_dbm,
        propagation.receive_dbi,
        propagation.min_dbm - propagation.spread_db,
    )
    for i in range(np.uint64(len(x))):
        candidates, s = np.uint64(0), order[i]
        for j in range(2):
            for k in range(ahead[i, j, 0], ahead[i, j, 1]):
                dx, dy, dz = x[k] - x[i], y[k] - y[i], z[k] - z[i]
                # Branchless: write first, then advance for a candidate; branches would be mispredicted too often.
                near[candidates], square_distance_m2[candidates] = k, dx * dx + dy * dy + dz * dz
                candidates += np.uint64(square_distance_m2[candidates] <= square_m2)
        for k in range(candidates):  # a loop of its own is vectorised
            near_loss_db[k] = loss_db(curve, math.sqrt(square_distance_m2[k]))
        for k in range(candidates if curve.sender_height_m > 0.0 else np.uint64(0)):
            near_loss_db[k] = loss_db(lifted(curve, z[i], z[near[k]]), math.sqrt(square_distance_m2[k]))
        for k in range(candidates):
            r = order[near[k]]
            a[count], b[count], loss[count] = min(s, r), max(s, r), near_loss_db[k]
            # Pairs must not depend on the antennas of other robots; `reach_m` is that of the best antennas.
            count += np.uint64(_max_dbm(send_dbm, receive_dbi, s, r) - loss[count] >= min_dbm)
    return count


@njit(nogil=True)
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


@njit()
def _add_walls(loss, x, y, z, robots, obstacles, crossing_db, inside_db_per_m, a, b):
    entered = np.empty((len(obstacles.shape), 2))
    for i in range(len(a)):
        s, r = a[i], b[i]
        loss[i] += wall_loss_db(
            obstacles, entered, s // robots, crossing_db, inside_db_per_m, x[s], y[s], z[s], x[r], y[r], z[r]
        )


@kernel(from_python=True, nogil=True)
def _above(min_dbm, send_dbm, receive_dbi, a, b, loss):
    """Move pairs of at least `min_dbm` in either direction to the front and return their number."""
    count = np.uint64(0)
    for i in range(len(a)):
        s, r = a[i], b[i]
        a[count], b[count], loss[count] = s, r, loss[i]
        count += np.uint64(_max_dbm(send_dbm, receive_dbi, s, r) - loss[i] >= min_dbm)
    return count


@kernel()
def _max_dbm(send_dbm, receive_dbi, s, r):
    """Return the power in the better direction, without losses."""
    s, r = np.uint64(s), np.uint64(r)
    return max(send_dbm[s] + receive_dbi[r], send_dbm[r] + receive_dbi[s])


@njit(nogil=True)
def _fade(gain, x, y, z, robots, keys, rows, scatter, fading_model, a, b):
    arriving, number = np.zeros((len(x), 4, fading.WAVES), np.float32), np.zeros(len(x), np.uint64)
    for r in rows:
        fading.waves_at(scatter[r // robots], x[r], y[r], arriving[r])
        number[r] = fading.robot_number(keys[r // robots], r % robots)
    parts = np.empty((2, SUMS), np.float32)
    _gains(gain, x, y, z, arriving, number, fading_model, a, b, parts[0], parts[1])


@kernel()
def _gains(gain, x, y, z, arriving, number, fading_model, a, b, real, imaginary):
    for i in range(len(a)):
        s, r = a[i], b[i]
        h = fading.scattered_field(fading.pair_signs(number[s], number[r]), arriving, s, r, real, imaginary)
        dx, dy, dz = x[r] - x[s], y[r] - y[s], z[r] - z[s]
        gain[i] = field_gain(fading_model, h, math.sqrt(dx * dx + dy * dy + dz * dz))


class MeasuredLinks:
    """Measured strength of each directed link at one time, which replaces the modelled strength in all arenas."""

    def __init__(
        self, traces: LinkTraces, others: str, robots: int, arenas: int, send_dbm: FloatArray, receive_dbi: FloatArray
    ) -> None:
        """`others` is the radio's `trace.others`; each arena has `robots` robots.

        `send_dbm` and `receive_dbi` (robots,) are the antenna values during the measurement; gains of events are
        added.
        """
        self._send_dbm, self._receive_dbi = send_dbm, receive_dbi
        self._traces, self._others_end = traces, others == "none"
        self._robots, self._arenas = robots, arenas
        self._link = np.unique(np.concatenate([np.empty(0, np.int64), *(trace.link for trace in traces.all)]))
        self.move_to(0)

    @classmethod
    def create(cls, context: ChannelContext) -> "MeasuredLinks | None":
        """Return the links of the radio's trace; None without a trace."""
        if context.traces is None or context.radio.trace is None:
            return None
        antennas, antenna = context.antennas, context.radio.antenna_or_default
        antenna_values = antennas.send_dbm(antenna), antennas.receive_dbi(antenna)
        return cls(context.traces, context.radio.trace.others, context.robots, len(context.keys), *antenna_values)

    def move_to(self, now_ns: int) -> None:
        """Look up the values at `now_ns`."""
        sender, receiver = np.divmod(self._link, self._robots)
        at_ns = np.full(len(sender), now_ns)
        missing = np.full(len(sender), np.nan)
        strength = self._traces.rssi_dbm
        self._rssi_dbm = missing if strength is None else strength.values_at(sender, receiver, at_ns)
        self._has_value = self._traces.has_values(sender, receiver, at_ns)

    def with_unlisted(self, a: IntArray, b: IntArray, loss_db: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return pairs of robot rows a < b (k,), then missing pairs of measured strength, with loss inf."""
        rows = self._robots * self._arenas
        sender, receiver = np.divmod(self._link[~np.isnan(self._rssi_dbm)], self._robots)
        first = self._robots * np.arange(self._arenas)[:, None]
        measured = ((first + np.minimum(sender, receiver)) * rows + first + np.maximum(sender, receiver)).ravel()
        more_a, more_b = np.divmod(np.setdiff1d(measured, a * rows + b), rows)
        a, b = np.concatenate([a, more_a]), np.concatenate([b, more_b])
        return a, b, np.concatenate([loss_db, np.full(len(more_a), np.inf)])

    def loss_db(self, sender: IntArray, receiver: IntArray, modelled_db: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the loss of links between robot rows, (k,), else `modelled_db`; and True where it was measured."""
        budget_db = self._send_dbm[sender % self._robots] + self._receive_dbi[receiver % self._robots]
        rssi_dbm = self._values_of(self._rssi_dbm, np.nan, sender, receiver)
        is_measured = ~np.isnan(rssi_dbm)
        loss = np.where(is_measured, budget_db - rssi_dbm, modelled_db)
        if self._others_end:
            loss[~self._values_of(self._has_value, False, sender, receiver)] = np.inf
        return loss, is_measured

    def _values_of(self, values, missing, sender: IntArray, receiver: IntArray):
        """Return the values of the links between robot rows, (k,); `missing` for links that were never measured."""
        robots = self._robots
        link = sender % robots * robots + receiver % robots
        if not len(self._link):
            return np.full(len(link), missing)
        index = np.minimum(np.searchsorted(self._link, link), len(self._link) - 1)
        return np.where(self._link[index] == link, values[index], missing)
