"""The floor of a recording: one picture below all else, in greys light enough to see robots on."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import ByteArray
from swarmwire.comms.geometry.ground import ground_of, shades_over
from swarmwire.comms.truth import Static

LONGER_SIDE_PX = 512
_DARKEST, _BRIGHTEST = 30, 90  # greys of the shades 0 and 1; the viewer is dark
_ORDER = -1.0


def log_floor(rec: Any, static: Static) -> None:
    """Log it, if the run has one."""
    import rerun as rr

    if static.floor is None:
        return
    grey, (width, height) = _raster(static), static.arena_size_m
    rows, columns = grey.shape
    # An image's pixels are a unit wide; its first row is at the least y, as y points up in the arena.
    place = rr.Transform3D(translation=[-width / 2, -height / 2, 0.0], scale=[width / columns, height / rows, 1.0])
    rec.log("world/floor", place, rr.Image(grey, color_model="L", draw_order=_ORDER), static=True)


def _raster(static: Static) -> ByteArray:
    """The greys of the floor, (rows, columns), the least y first."""
    ground, (width, height) = ground_of(static.floor, static.arena_size_m, static.boundary), static.arena_size_m
    step_m = max(width, height) / LONGER_SIDE_PX
    columns, rows = max(round(width / step_m), 1), max(round(height / step_m), 1)
    x = (np.arange(columns) + 0.5) * width / columns - width / 2
    y = (np.arange(rows) + 0.5) * height / rows - height / 2
    return (_DARKEST + (_BRIGHTEST - _DARKEST) * shades_over(ground, x, y)).astype(np.uint8)
