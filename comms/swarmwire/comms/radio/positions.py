"""Positions within a tick: held at its start, or on the straight line to the next tick's poses.

A tick has PARTS equal parts, and robots stand where they are in the middle of a part. So positions are out of date by
at most a twentieth of a tick, and not at all on average. A pose for each frame would cost a link budget to every
receiver in each frame; this costs the links of all robots once in each part, for either radio model.
"""

from collections.abc import Iterator

import numpy as np

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.arrays import FloatArray

PARTS = 10


def poses_between(
    from_ns: int, before: FloatArray, until_ns: int, after: FloatArray, wrap_m: tuple[float, float]
) -> Iterator[tuple[int, FloatArray]]:
    """Yield the start of each part of the time between two poses (rows, 4), and the poses in its middle.

    Robots turn the shorter way; on a torus with the sides `wrap_m` they move it, too. 0: no torus.
    """
    way = after - before
    way[:, 2] = wrap_angles(way[:, 2])
    for axis, side_m in enumerate(wrap_m):
        way[:, axis] += _to_nearest(way[:, axis], side_m)
    for part in range(PARTS):
        pose = before + (part + 0.5) / PARTS * way
        pose[:, 2] = wrap_angles(pose[:, 2])
        for axis, side_m in enumerate(wrap_m):
            pose[:, axis] += _to_nearest(pose[:, axis], side_m)
        yield from_ns + (until_ns - from_ns) * part // PARTS, pose


def _to_nearest(away_m: FloatArray, side_m: float) -> FloatArray | float:
    """Return what to add for the shortest way; `obstacles.to_nearest` for arrays."""
    return -side_m * np.floor(away_m / side_m + 0.5) if side_m > 0.0 else 0.0
