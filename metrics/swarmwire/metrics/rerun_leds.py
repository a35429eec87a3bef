"""The LEDs of a recording: those that are lit, where they sit on their robots, in their colours."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.rerun_rows import RerunRows

_LEDS = 5.0  # drawn above the robots
_OPAQUE = 0xFF


class RerunLeds:
    """The lit LEDs of one arena: points in each tick in which there are some."""

    def __init__(self, static: Static) -> None:
        """Draw the LEDs of any arena of this run."""
        self._place_m = np.zeros((static.robots, static.most_leds, 2))  # ahead and to the left of the robot's axis
        for group in static.groups:
            self._place_m[group.start : group.stop, : group.body.led_count] = group.body.led_places_m[:, :2]
        self._any_lit = False  # in the last tick

    def begin(self, rec: Any) -> None:
        """Log what does not change."""
        import rerun as rr

        look = rr.Points2D.from_fields(radii=rr.Radius.ui_points(2.5), draw_order=_LEDS)
        rec.log("world/leds", look, static=True)

    def add(self, rows: RerunRows, rgb: IntArray, pose: FloatArray) -> None:
        """Add a tick: colours (robots, most LEDs), poses (robots, 3)."""
        any_lit = bool(rgb.any())
        if not any_lit and not self._any_lit:
            return
        import rerun as rr

        self._any_lit = any_lit
        robot, which = np.nonzero(rgb)
        ahead_m, left_m = self._place_m[robot, which].T
        c, s = np.cos(pose[robot, 2]), np.sin(pose[robot, 2])
        x_m, y_m = pose[robot, 0] + c * ahead_m - s * left_m, pose[robot, 1] + s * ahead_m + c * left_m
        at_m = np.stack([x_m, y_m], axis=1).astype(np.float32)
        colors = ((rgb[robot, which] << 8) | _OPAQUE).astype(np.uint32)
        rows.add("world/leds", rr.Points2D, positions=at_m, colors=colors)
