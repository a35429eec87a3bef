"""The LEDs of a recording: those that are lit, where they sit on their robots, in their colours."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.truth import Static, Truth
from swarmwire.metrics.viewer.rows import RerunRows

_LEDS = 5.0  # drawn above the robots
_OPAQUE = 0xFF


class RerunLeds:
    """The lit LEDs of one arena: points in each tick in which there are some."""

    def __init__(self, static: Static) -> None:
        """Draw the LEDs of any arena of this run."""
        self._place_m = np.zeros((static.robots, static.max_leds, 2))  # ahead and to the left of the robot's axis
        for group in static.groups:
            self._place_m[group.start : group.stop, : group.body.led_count] = group.body.led_places_m[:, :2]
        self._leds: IntArray | None = None  # as of the last tick
        self._any_lit = False

    def begin(self, rec: Any) -> None:
        """Log what does not change."""
        import rerun as rr

        look = rr.Points2D.from_fields(radii=rr.Radius.ui_points(2.5), draw_order=_LEDS)
        rec.log("world/leds", look, static=True)

    def add(self, rows: RerunRows, truth: Truth, own: slice) -> None:
        """Add a tick of the robots in these rows of the world."""
        were_lit = self._any_lit
        if truth.leds is not self._leds:  # of which there are many: a new array is there when something changes
            self._leds, self._any_lit = truth.leds, bool(truth.leds[own].any())
        if not (self._any_lit or were_lit):
            return
        import rerun as rr

        rgb, pose = truth.leds[own], truth.pose[own]
        robot, which = np.nonzero(rgb)
        ahead_m, left_m = self._place_m[robot, which].T
        c, s = np.cos(pose[robot, 2]), np.sin(pose[robot, 2])
        x_m, y_m = pose[robot, 0] + c * ahead_m - s * left_m, pose[robot, 1] + s * ahead_m + c * left_m
        at_m = np.stack([x_m, y_m], axis=1).astype(np.float32)
        colors = ((rgb[robot, which] << 8) | _OPAQUE).astype(np.uint32)
        rows.add("world/leds", rr.Points2D.columns, positions=at_m, colors=colors)
