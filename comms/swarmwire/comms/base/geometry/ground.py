"""The floor of an arena as arrays, and its shade at a point. Compiled; for ground sensors."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import ByteArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.floor import Floor
from swarmwire.comms.base.geometry.obstacles import sides_of
from swarmwire.comms.base.geometry.shapes import Boundary
from swarmwire.comms.base.kernels import kernel, njit

WHITE = Floor()


class Ground(NamedTuple):
    """The floor, the same in every arena. Patch k has the sides side_start[k] to side_start[k + 1] - 1, a disc none."""

    width_m: float  #: width and height of the arena
    height_m: float
    wraps: bool  #: on a torus, where a patch goes on at the opposite side
    shade: float  #: 0 black … 1 white, where nothing covers the floor
    grey: ByteArray  #: (rows, columns) top row first, over the whole arena; (0, 0) without a picture
    patch: FloatArray  #: (patches, 4) x, y, radius of a circle around it in m, shade
    side_start: IntArray  #: (patches + 1,)
    side: FloatArray  #: (sides, 5) as `geometry.sides_of` has them, around the patch's x, y


def ground_of(floor: Floor | None, size_m: tuple[float, float], boundary: Boundary) -> Ground:
    """Return the floor of an arena of this size, white by default. ValueError for an invalid picture."""
    floor = floor or WHITE
    patches, sides, side_start = [], [np.empty((0, 5))], [0]
    for patch in floor.patches:
        radius_m = patch.radius_m
        if patch.shape == "polygon":
            corners = np.array(patch.points_m, np.float64)
            radius_m = portable.hypot(*corners.T).max()
            sides.append(sides_of(corners))
        patches.append((patch.x_m, patch.y_m, radius_m, patch.shade))
        side_start.append(side_start[-1] + len(patch.points_m))
    return Ground(
        float(size_m[0]),
        float(size_m[1]),
        boundary == "torus",
        floor.shade,
        floor.image.grey if floor.image else np.empty((0, 0), np.uint8),
        np.array(patches, np.float64).reshape(-1, 4),
        np.array(side_start, np.int64),
        np.concatenate(sides),
    )


@kernel(from_python=True)
def shade_at(ground, x, y):
    """Return the shade at a point in m, 0 black … 1 white; outside an arena that is no torus, the uncovered floor's."""
    for k in range(len(ground.patch) - 1, -1, -1):
        dx, dy = x - ground.patch[k, 0], y - ground.patch[k, 1]
        if ground.wraps:
            dx -= ground.width_m * np.round(dx / ground.width_m)
            dy -= ground.height_m * np.round(dy / ground.height_m)
        if dx * dx + dy * dy <= ground.patch[k, 2] * ground.patch[k, 2]:
            covers = True
            for i in range(ground.side_start[k], ground.side_start[k + 1]):
                covers = covers and ground.side[i, 2] * dx + ground.side[i, 3] * dy <= ground.side[i, 4]
            if covers:
                return ground.patch[k, 3]
    rows, columns = ground.grey.shape
    if rows == 0:
        return ground.shade
    right, down = x / ground.width_m + 0.5, 0.5 - y / ground.height_m
    if ground.wraps:
        right, down = right - np.floor(right), down - np.floor(down)
    elif not (0.0 <= right <= 1.0 and 0.0 <= down <= 1.0):
        return ground.shade
    return ground.grey[min(int(down * rows), rows - 1), min(int(right * columns), columns - 1)] / 255.0


@njit()
def shades_over(ground: Ground, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the shade at every x with every y in m, (len(y), len(x)): a picture of the floor."""
    shades = np.empty((len(y), len(x)))
    for j in range(len(y)):
        for i in range(len(x)):
            shades[j, i] = shade_at(ground, x[i], y[j])
    return shades


@njit()
def shades_at(ground: Ground, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the shade at points in m, (n,) each."""
    shades = np.empty(len(x))
    for i in range(len(x)):
        shades[i] = shade_at(ground, x[i], y[i])
    return shades
