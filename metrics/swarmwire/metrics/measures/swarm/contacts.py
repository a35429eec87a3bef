"""Contacts that began, and the smallest gap between two robots."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.swarm.pairs import radii_m, sort_by_x
from swarmwire.metrics.measures.torus import sides_m

S_PER_H = 3600.0


@dataclass(frozen=True)
class Collisions(Metric):
    """Contacts between two robots that began in the tick; one that lasts counts once. The dead can be hit."""

    name = "collisions"
    help = "contacts between two robots that began, a lasting one once"
    kind = "count"
    standard = True
    needs = ("contacts",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return lambda view: view.truth.contact_onsets[:, 0].astype(np.float64)


@dataclass(frozen=True)
class WallContacts(Metric):
    """Contacts between a robot and a wall or obstacle that began in the tick; one that lasts counts once."""

    name = "wall_contacts"
    help = "contacts of a robot with a wall or an obstacle that began, a lasting one once"
    kind = "count"
    standard = True
    needs = ("contacts",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return lambda view: view.truth.contact_onsets[:, 1].astype(np.float64)


@dataclass(frozen=True)
class CollisionRate(Metric):
    """2 x contacts between robots that began so far / robot-hours alive so far, in 1/h; NaN while no robot was alive.

    A contact that lasts counts once, and for both robots, so this is how often one robot is in a collision. Robots
    alive are added up over time. The dead can be hit, and their contacts count as any. `final` is the rate of the run.

    Discs of diameter D that go straight at speed v without avoidance, at random over an area with n discs per square
    metre, touch at a rate of (8 / pi) n D v (N - 1) / N each, since their mean relative speed is 4 v / pi: 237 an hour
    for 60 of 7 cm at 0.1 m/s on 4 x 4 m.

    Source: the kinetic theory of gases in the plane, for the rate without avoidance.
    """

    name = "collision_rate"
    help = "contacts between robots per robot-hour so far, each counted for both robots, in 1/h"
    unit = "1/h"
    needs = ("contacts",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure that adds up contacts and robots alive."""
        contacts, robot_ticks = np.zeros(static.arenas, np.int64), np.zeros(static.arenas, np.int64)
        ticks_per_h = static.rate_hz * S_PER_H

        def measure(view: TickView) -> FloatArray:
            np.add(contacts, view.truth.contact_onsets[:, 0], out=contacts)
            np.add(robot_ticks, view.robots_alive, out=robot_ticks)
            robot_h = np.where(robot_ticks > 0, robot_ticks / ticks_per_h, np.nan)
            return 2.0 * contacts / robot_h

        return measure


@dataclass(frozen=True)
class MinGap(Metric):
    """Smallest distance in m between the surfaces of two robots alive: min of |p_i - p_j| - r_i - r_j.

    Two robots have no gap if one is wholly above the other. 0 at a touch, and a little less while two press against
    each other; NaN if no two robots alive could touch. Its `min` in the summary is the smallest gap of the run, at the
    ticks.
    """

    name = "min_gap"
    help = "smallest distance between the surfaces of two robots alive, neither of them wholly above the other, in m"
    unit = "m"
    standard = True
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure; its memory only makes it quick."""
        radius_m = radii_m(static)
        low_m = np.concatenate([np.full(g.stop - g.start, g.body.altitude_m) for g in static.groups])
        tall_m = np.concatenate([np.full(g.stop - g.start, g.body.height_m) for g in static.groups])
        span_m = np.stack([low_m, low_m + tall_m], axis=1)
        order: IntArray | None = None
        wrap_m = sides_m(static)

        def measure(view: TickView) -> FloatArray:
            nonlocal order
            if order is None:
                order = np.argsort(view.pose[:, :, 0], axis=1)
            return smallest_gap_m(view.truth.pose, radius_m, span_m, view.truth.alive, order, wrap_m)

        return measure


@njit()
def smallest_gap_m(
    pose: FloatArray,
    radius_m: FloatArray,
    span_m: FloatArray,
    alive: BoolArray,
    order: IntArray,
    wrap_m: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """Return the smallest gap of each arena, (arenas,), between discs alive at `pose` (rows, 3), by a sweep along x.

    `span_m` (robots, 2) is the height of each robot's lower and upper side; NaN if no two of them overlap. `order`
    (arenas, robots), a permutation of each arena's robots, is sorted by x in place: it is quick if it is that of the
    previous tick. `wrap_m` are the sides of a torus, 0 for an arena with a boundary.
    """
    arenas, robots = order.shape
    gap_m = np.full(arenas, np.inf)
    # On a torus the robots are listed twice: the sweep continues with the first after the last.
    length = 2 * robots if wrap_m[0] > 0.0 else robots
    x, y, radius, robot = np.empty(length), np.empty(length), np.empty(length), np.empty(length, np.int64)
    largest_m = 0.0
    for k in range(robots):  # max() of numpy takes a second to compile
        largest_m = max(largest_m, radius_m[k])
    for arena in range(arenas):
        first, n = arena * robots, 0
        sort_by_x(order[arena], pose[first : first + robots])
        for i in order[arena]:
            if alive[first + i]:
                x[n], y[n], radius[n], robot[n] = pose[first + i, 0], pose[first + i, 1], radius_m[i], i
                n += 1
        listed = n
        if wrap_m[0] > 0.0:
            listed = 2 * n
            for k in range(n):  # an assignment of slices takes 3 s to compile, for its error's text
                x[n + k], y[n + k], radius[n + k], robot[n + k] = x[k] + wrap_m[0], y[k], radius[k], robot[k]
        smallest_m = np.inf
        for a in range(n):
            for b in range(a + 1, min(a + n, listed)):
                along_m = x[b] - x[a]
                if along_m > smallest_m + radius[a] + largest_m:
                    break
                across_m = y[b] - y[a]
                if wrap_m[1] > 0.0:
                    across_m += to_nearest(across_m, wrap_m[1])
                near_m = smallest_m + radius[a] + radius[b]
                square = along_m * along_m + across_m * across_m
                if square < near_m * near_m and near_m > 0.0 and _heights_overlap(span_m, robot[a], robot[b]):
                    smallest_m = np.sqrt(square) - max(radius[a], radius[b]) - min(radius[a], radius[b])
        gap_m[arena] = smallest_m if smallest_m < np.inf else np.nan
    return gap_m


@kernel()
def _heights_overlap(span_m: AnyArray, i: int, j: int):
    """Return True unless one robot is wholly above the other."""
    return span_m[i, 0] < span_m[j, 1] and span_m[j, 0] < span_m[i, 1]
