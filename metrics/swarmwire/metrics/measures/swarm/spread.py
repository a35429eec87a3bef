"""Spread: distances of robots from their centroid and from one another.

On a torus the mean of coordinates is no centroid. Instead, along each axis, the positions are unrolled around their
circular mean (the mean direction of the angles 2 pi x / side), and the centroid is the mean of the unrolled positions.
A swarm within half a side of its circular mean has the same centroid as on a plane. Positions whose directions cancel
have no centroid.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.swarm.pairs import (
    allocate_strips,
    along_m,
    fill,
    initial_order,
    radii_m,
    wrapped_slot,
)
from swarmwire.metrics.measures.torus import sides_m

MIN_CENTROID_DISTANCE_M = 1e-9  # shorter distances are rounding errors and have no direction
MIN_MEAN_DIRECTION = 1e-9  # shorter means of directions are rounding errors


@dataclass(frozen=True)
class Cohesion(Metric):
    """max |x_i - c| in m over the robots alive, c their centroid; 0 for one robot alone, NaN if none is alive.

    The radius of the smallest circle around the centroid that contains all centres. A single straggler decides it;
    `dispersion` weighs all robots. On a torus the centroid follows from the circular mean of the positions, and
    distances are the shortest; NaN without a centroid.

    Source: R. Olfati-Saber, Flocking for multi-agent dynamic systems, IEEE TAC 51 (2006), section IX: cohesion radius.
    """

    name = "cohesion"
    help = "largest distance of a robot alive to the centroid of those alive, in m"
    unit = "m"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        wrap_m = sides_m(static)

        def measure(view: TickView) -> FloatArray:
            return _largest(from_centroid_m(view.pose, view.alive, wrap_m), view.alive)

        return measure


@njit()
def _largest(away_m, alive):
    arenas, robots = alive.shape
    largest_m = np.full(arenas, np.nan)
    for arena in range(arenas):
        most, n = 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                square = away_m[arena, i, 0] ** 2 + away_m[arena, i, 1] ** 2
                most = square if np.isnan(square) else max(most, square)
                n += 1
        if n:
            largest_m[arena] = np.sqrt(most)
    return largest_m


@dataclass(frozen=True)
class Dispersion(Metric):
    """sum |x_i - c|^2 / (4 r^2) over the robots alive: second moment about their centroid c, in squared diameters.

    The minimum is that of the densest packing, near a hexagonal one, of as many discs: 6 for 7 discs, 48 for 19. It
    grows with the square of their number: compare with the minimum, or runs with equally many robots. r is the radius
    of the body; for mixed bodies r^2 is the mean of the squares over the robots alive. On a torus the centroid follows
    from the circular mean of the positions, and distances are the shortest. NaN without a centroid, or if no robot is
    alive.

    Source: M. Gauci et al., Self-organized aggregation without computation, IJRR 33 (2014), eq. 1.
    """

    name = "dispersion"
    help = "dispersion: sum of squared distances to the centroid / (4 r^2), over robots alive"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        wrap_m, radius_m = sides_m(static), radii_m(static)

        def measure(view: TickView) -> FloatArray:
            return _dispersion(from_centroid_m(view.pose, view.alive, wrap_m), radius_m, view.alive)

        return measure


@njit()
def _dispersion(away_m, radius_m, alive):
    arenas, robots = alive.shape
    dispersion = np.full(arenas, np.nan)
    for arena in range(arenas):
        spread, squares, n = 0.0, 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                spread += away_m[arena, i, 0] ** 2 + away_m[arena, i, 1] ** 2
                squares += radius_m[i] ** 2
                n += 1
        if n:
            dispersion[arena] = spread / (4.0 * squares / n)
    return dispersion


@dataclass(frozen=True)
class Rotation(Metric):
    """|sum r_i x u_i| / N over the N robots alive: u_i unit heading, r_i unit vector from the centroid to the robot.

    1 if all head along circles around the centroid in one sense; 0 if they cancel, head outwards, or all in one
    direction. A robot at the centroid has no r_i and adds 0. A robot that drives backwards counts by its heading. On a
    torus the centroid follows from the circular mean of the positions, and r_i is the shortest way: the value is
    meaningful only if the swarm is much smaller than the arena. NaN if no robot is alive, or without a centroid.

    Source: I. D. Couzin et al., Collective memory and spatial sorting in animal groups, J. Theor. Biol. 218 (2002),
    group angular momentum m_group, with headings for directions of motion.
    """

    name = "rotation"
    help = "rotation around the centroid: |sum of r x u| / robots alive, r to the robot, u its heading, unit vectors"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        wrap_m = sides_m(static)

        def measure(view: TickView) -> FloatArray:
            away_m = from_centroid_m(view.pose, view.alive, wrap_m)
            return _rotation(away_m, *view.direction, view.alive)

        return measure


@njit()
def _rotation(away_m, c, s, alive):
    arenas, robots = alive.shape
    rotation = np.full(arenas, np.nan)
    for arena in range(arenas):
        total, n = 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                n += 1
                x, y = away_m[arena, i]
                length_m = np.sqrt(x * x + y * y)
                if not length_m <= MIN_CENTROID_DISTANCE_M:  # NaN passes
                    total += (x * s[arena, i] - y * c[arena, i]) / length_m
        if n and not np.isnan(total):
            rotation[arena] = min(abs(total) / n, 1.0)
    return rotation


@dataclass(frozen=True)
class NearestNeighbour(Metric):
    """Mean over the robots i alive of min over the others j alive of |x_i - x_j| in m, centre to centre.

    The shortest way on a torus. For robots at random on a large plane, n per square metre, it is 1 / (2 sqrt(n)); lower
    values mean clustering. The maximum, of a hexagonal lattice, is 1.0746 / sqrt(n). NaN with fewer than two robots
    alive.

    Source: P. J. Clark, F. C. Evans, Distance to nearest neighbor as a measure of spatial relationships in populations,
    Ecology 35 (1954).
    """

    name = "nearest_neighbour"
    help = "mean distance from a robot alive to the nearest other one, centre to centre, in m"
    unit = "m"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure; its memory only makes it quick."""
        order, strips, wrap_m = initial_order(static), allocate_strips(static), sides_m(static)

        def measure(view: TickView) -> FloatArray:
            return _mean_nearest_m(view.pose, view.alive, order, strips, wrap_m)

        return measure


@njit()
def _mean_nearest_m(pose, alive, order, strips, wrap_m):
    """Search from each robot strip by strip outwards, while a strip may have a nearer robot than the nearest so far."""
    mean_m = np.full(len(order), np.nan)
    for arena in range(len(order)):
        n = np.sum(alive[arena])
        count, low_m, height_m = fill(strips, order[arena], pose[arena], alive[arena], 0.0, int(np.sqrt(n)), wrap_m[1])
        total_m = 0.0
        for a in range(n):
            strip = strips.strip[a]
            up_m = strips.y[a] - (low_m + strip * height_m)  # above the lower side of its strip
            nearest = _nearest_square(strips, a, strip, np.inf, wrap_m)
            for step in range(1, count // 2 + 1 if wrap_m[1] > 0.0 else count):
                between_m = (step - 1) * height_m
                if between_m * between_m >= nearest:
                    break
                for other, to_m in (
                    (strip - step, up_m + between_m),
                    (strip + step, height_m - up_m + between_m),
                ):
                    s = other % count if wrap_m[1] > 0.0 else other
                    if 0 <= s < count and to_m * to_m < nearest:
                        nearest = _nearest_square(strips, a, s, nearest, wrap_m)
            total_m += np.sqrt(nearest)
        if n > 1:
            mean_m[arena] = total_m / n
    return mean_m


@kernel()
def _nearest_square(strips, a, s, nearest, wrap_m):
    """Return the minimum of `nearest` and the squared distances from slot a to the others of strip s."""
    low, size = strips.start[s], strips.start[s + 1] - strips.start[s]
    middle = _first_from(strips.x, low, low + size, strips.x[a]) - low
    right_end, left_end = (middle + size, middle - 1 - size) if wrap_m[0] > 0.0 else (size, -1)
    for begin, end, step in ((middle, right_end, 1), (middle - 1, left_end, -1)):
        for v in range(begin, end, step):
            along, b = along_m(strips, a, low, size, v, wrap_m[0]), wrapped_slot(low, size, v)
            if along * along >= nearest:
                break
            if b != a:
                across = strips.y[b] - strips.y[a]
                across += to_nearest(across, wrap_m[1])
                nearest = min(nearest, along * along + across * across)
    return nearest


@kernel()
def _first_from(x, low, high, least):
    """Return the first slot from low to high - 1, sorted by x, with x >= `least`; high if there is none."""
    while low < high:
        middle = (low + high) // 2
        if x[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@njit()
def from_centroid_m(pose: FloatArray, alive: BoolArray, wrap_m: tuple[float, float]) -> FloatArray:
    """Return each robot's position minus the centroid of the robots alive of its arena, (arenas, robots, 2).

    `wrap_m` are the sides of a torus, on which differences are the shortest; 0 for an arena with a boundary. NaN for
    dead robots, and along an axis without a centroid.
    """
    arenas, robots = alive.shape
    away_m = np.full((arenas, robots, 2), np.nan)
    for arena in range(arenas):
        for axis in range(2):
            centre = _mean(pose[arena, :, axis], alive[arena], 0.0, 0.0)
            if wrap_m[axis] > 0.0:
                origin = _circular_mean(pose[arena, :, axis], alive[arena], wrap_m[axis])
                centre = origin + _mean(pose[arena, :, axis], alive[arena], origin, wrap_m[axis])
            for i in range(robots):
                if alive[arena, i]:
                    away = pose[arena, i, axis] - centre
                    away_m[arena, i, axis] = away + to_nearest(away, wrap_m[axis])
    return away_m


@njit()
def _mean(x, alive, origin, side):
    """Return the mean of the shortest differences to `origin`; NaN if no robot is alive."""
    total, n = 0.0, 0
    for i in range(len(x)):
        if alive[i]:
            away = x[i] - origin
            total += away + to_nearest(away, side)
            n += 1
    return total / n if n else np.nan


@njit()
def _circular_mean(x, alive, side):
    """Return the x of the mean direction of the angles 2 pi x / side; NaN if they cancel, or no robot is alive."""
    turn, c, s, n = 2.0 * np.pi / side, 0.0, 0.0, 0
    for i in range(len(x)):
        if alive[i]:
            c += np.cos(turn * x[i])
            s += np.sin(turn * x[i])
            n += 1
    return np.arctan2(s, c) / turn if np.hypot(c, s) > MIN_MEAN_DIRECTION * n else np.nan
