"""Who is in whose radio range, from positions and obstacles alone."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from scipy.spatial import KDTree

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Obstacle


def in_range(
    position_m: AnyArray,
    alive: BoolArray,
    range_m: float,
    obstacles: Sequence[Obstacle],
    torus_m: tuple[float, float] | None = None,
) -> IntArray:
    """Pairs (e, 2) of robots alive that are no farther apart than the range, with no obstacle between their centres.

    That is the radio graph of most runs. A run folder holds no links, so partitions, failed radios and radios that
    need no line of sight are not regarded. `torus_m` are the sides of a torus, whose distances are the shortest.
    """
    living = np.flatnonzero(alive)
    place = position_m[living].astype(np.float64)
    if torus_m is not None:
        place = np.mod(place, torus_m)
        place[place >= torus_m] = 0.0  # by rounding
    tree = cast(Any, KDTree)(place, boxsize=torus_m)  # its stub types the answers in part only
    pairs: IntArray = living[tree.query_pairs(range_m, output_type="ndarray")]
    start, end = (position_m[pairs[:, side]].astype(np.float64) for side in (0, 1))
    over = np.zeros_like(start)
    if torus_m is not None:
        over -= torus_m * np.floor((end - start) / torus_m + 0.5)
    clear = np.ones(len(pairs), np.bool_)
    for obstacle in obstacles:
        clear &= ~_touches(obstacle, start, end + over) & ~_touches(obstacle, start - over, end)
    return pairs[clear]


def _touches(obstacle: Obstacle, start: FloatArray, end: FloatArray) -> BoolArray:
    """Whether an obstacle touches each of the straight lines (e, 2) to (e, 2)."""
    if obstacle.shape != "cylinder":
        return _touches_polygon(obstacle.corners_m, start, end)
    centre, along = np.array([obstacle.x_m, obstacle.y_m]), end - start
    length2 = np.maximum((along * along).sum(axis=1), np.finfo(np.float64).tiny)
    share = np.clip(((centre - start) * along).sum(axis=1) / length2, 0.0, 1.0)
    nearest = start + share[:, None] * along
    return np.hypot(*(nearest - centre).T) <= obstacle.radius_m


def _touches_polygon(corners: FloatArray, start: FloatArray, end: FloatArray) -> BoolArray:
    """The lines are clipped by one side after the other (Cyrus and Beck, 1978)."""
    along = end - start
    enter, leave = np.zeros(len(start)), np.ones(len(start))
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        outward = np.array([following[1] - corner[1], corner[0] - following[0]])
        outside, speed = (start - corner) @ outward, along @ outward
        at = -outside / np.where(speed == 0.0, 1.0, speed)
        enter = np.where(speed < 0.0, np.maximum(enter, at), enter)
        leave = np.where(speed > 0.0, np.minimum(leave, at), leave)
        leave = np.where((speed == 0.0) & (outside > 0.0), -1.0, leave)
    return enter <= leave
