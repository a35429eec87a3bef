"""The robots of a recording: where they are, where they head, where they were, what they are at, who hears whom."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.truth import Static, Truth
from swarmwire.metrics.palette import robot_color
from swarmwire.metrics.viewer.classes import RerunClasses
from swarmwire.metrics.viewer.colors import shown
from swarmwire.metrics.viewer.rows import RerunRows

_TRAIL_ALPHA = 170
_TRAILS, _HEADINGS, _ROBOTS = 2.0, 3.0, 4.0  # drawn in this order, above the links
_HEADING_RADII = 2.5  # length of a heading's arrow in body radii, from the centre
_MIN_HEADING = 0.025  # and at least this share of the arena's larger side, so that it can be seen,
_CROWDED = 0.25  # or this share / sqrt(robots) if that is less, so that a thousand do not cover one another


class RerunRobots:
    """The robots of one arena: discs, headings and trails in each tick, their colours when one changes."""

    def __init__(self, static: Static) -> None:
        """Draw the robots of any arena of this run."""
        self._static, self._classes = static, RerunClasses(static)
        radii = [np.full(group.stop - group.start, group.body.radius_m) for group in static.groups]
        self.radius_m = np.concatenate(radii)  # (robots,)
        least = min(_MIN_HEADING, _CROWDED / math.sqrt(static.robots))
        self.heading_m = np.maximum(_HEADING_RADII * self.radius_m, least * max(static.arena_size_m))  # (robots,)
        self._arrow_m = self.heading_m[:, None].astype(np.float32)
        self._was: tuple[bytes, bytes] | None = None  # who was alive and at what when the colours were logged

    def begin(self, rec: Any) -> None:
        """Log what does not change."""
        import rerun as rr

        names = [shown(name) for name in self._static.robot_names]
        robots = rr.Points2D.from_fields(radii=self.radius_m, labels=names, show_labels=False, draw_order=_ROBOTS)
        rec.log("world/robots", robots, static=True)
        faint = np.zeros((self._static.robots, 4), np.uint8)
        for i, group in enumerate(self._static.groups):
            faint[group.start : group.stop] = (*robot_color(i), _TRAIL_ALPHA)
        trails = rr.Points2D.from_fields(radii=rr.Radius.ui_points(0.7), colors=faint, draw_order=_TRAILS)
        rec.log("world/trails", trails, static=True)
        width = rr.Radius.ui_points(1.2)
        headings = rr.Arrows2D.from_fields(radii=width, show_labels=False, draw_order=_HEADINGS)
        rec.log("world/headings", headings, static=True)

    def add(self, rows: RerunRows, truth: Truth, own: slice, *, trails: bool) -> None:
        """Add a tick of the robots in these rows of the world; without `trails` their places are not kept for those."""
        import rerun as rr

        pose, alive, state = truth.pose[own].astype(np.float32), truth.alive[own], truth.state[own]
        rows.add("world/robots", _points, pose=pose)
        if trails:
            rows.add("world/trails", _points, pose=pose)
        rows.add("world/headings", self._arrows, pose=pose)
        now = alive.tobytes(), state.tobytes()
        if now != self._was:
            self._was = now
            class_id = self._classes.of(rows.rec, alive, state, truth.states)
            rows.add("world/robots", rr.Points2D.columns, class_ids=class_id)
            rows.add("world/headings", rr.Arrows2D.columns, class_ids=class_id)

    def _arrows(self, pose: NDArray[np.float32]) -> Any:
        """The headings at the poses of one tick or many, (ticks x robots, 3)."""
        import rerun as rr

        ahead = np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1).reshape(-1, self._static.robots, 2)
        ahead *= self._arrow_m
        return rr.Arrows2D.columns(origins=np.ascontiguousarray(pose[:, :2]), vectors=ahead.reshape(-1, 2))


def _points(pose: NDArray[np.float32]) -> Any:
    import rerun as rr

    return rr.Points2D.columns(positions=np.ascontiguousarray(pose[:, :2]))
