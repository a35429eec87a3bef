"""The arena of a recording: boundary, obstacles, lights once; robots, their LEDs, links and lost packets per tick."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.truth import Obstacle, Static, Truth
from swarmwire.metrics.torus import link_lines
from swarmwire.metrics.viewer.colors import LIGHT, WALL
from swarmwire.metrics.viewer.floor import log_floor
from swarmwire.metrics.viewer.leds import RerunLeds
from swarmwire.metrics.viewer.lost import add_lost, begin_lost
from swarmwire.metrics.viewer.robots import RerunRobots
from swarmwire.metrics.viewer.rows import RerunRows
from swarmwire.metrics.viewer.selected import RerunSelected

LINKS_EVERY_TICK_UP_TO = 200  # robots; links are most of a recording's bytes and time
THINNED_LINKS_EVERY_TICKS = 10

_LINK_COLOR = (130, 145, 180, 50)
_LIGHTS, _LINKS = 0.5, 1.0  # drawn in this order, below all that moves


class RerunArena:
    """What is seen of one arena: a call per kind of thing and tick, whatever the number of robots.

    In rerun's 2D views y points down; a static transform that mirrors y turns it up, and leaves the data as it is.
    """

    def __init__(self, static: Static, arena: int, selected: str) -> None:
        """Draw this arena of the run, and this robot in detail."""
        self._static, self._arena = static, arena
        self._own = slice(arena * static.robots, (arena + 1) * static.robots)
        self._robots = RerunRobots(static)
        self._leds = RerunLeds(static)
        self._selected = RerunSelected(static, arena, selected, self._robots.radius_m, self._robots.heading_m)
        self.links_every_ticks = 1 if static.robots <= LINKS_EVERY_TICK_UP_TO else THINNED_LINKS_EVERY_TICKS

    def begin(self, rec: Any) -> None:
        """Log what does not change."""
        import rerun as rr

        rec.log("world", rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
        log_floor(rec, self._static)
        self._log_fixed(rec)
        links = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_LINK_COLOR, draw_order=_LINKS)
        rec.log("world/links", links, static=True)
        begin_lost(rec)
        self._robots.begin(rec)
        self._leds.begin(rec)
        self._selected.begin(rec)

    def add(self, rows: RerunRows, truth: Truth) -> None:
        """Add one tick."""
        full = truth.tick % self.links_every_ticks == 0
        self._robots.add(rows, truth, self._own, trails=full)
        self._leds.add(rows, truth, self._own)
        self._selected.add(rows, truth, full=full)
        if truth.movable is not None:
            self._add_movable(rows, truth.movable[self._arena])
        if full:
            self._add_radio(rows, truth, truth.pose[self._own, :2])

    def _add_movable(self, rows: RerunRows, pose: FloatArray) -> None:
        import rerun as rr

        strips = [_outline(obstacle) for obstacle in self._static.movable_at(self._arena, pose)]
        rows.add("world/movable", rr.LineStrips2D.columns, strips=strips)

    def _add_radio(self, rows: RerunRows, truth: Truth, position_m: FloatArray) -> None:
        import rerun as rr

        if truth.edges is not None:
            ends = self._edges(truth.edges)
            lines = link_lines(position_m, ends, self._static)
            rows.add("world/links", rr.LineStrips2D.columns, strips=lines.astype(np.float32))
        if truth.finished is not None:
            add_lost(rows, truth.finished, self._arena, position_m)

    def _edges(self, edges: IntArray) -> IntArray:
        """The arena's own edges, as indices of its robots."""
        start = self._own.start
        own = (edges[:, 0] >= start) & (edges[:, 0] < self._own.stop)
        return edges[own] - start

    def _log_fixed(self, rec: Any) -> None:
        import rerun as rr

        static = self._static
        half_x, half_y = (size / 2 for size in static.arena_size_m)
        boundary = _closed(np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]]))
        width = rr.Radius.ui_points(1.2 if static.walled else 0.5)
        rec.log("world/boundary", rr.LineStrips2D([boundary], radii=width, colors=WALL), static=True)
        thin = rr.Radius.ui_points(1.2)
        outlines = [_outline(obstacle) for obstacle in static.fixed(self._arena)]
        if outlines:
            rec.log("world/obstacles", rr.LineStrips2D(outlines, radii=thin, colors=WALL), static=True)
        if static.movable:
            rec.log("world/movable", rr.LineStrips2D.from_fields(radii=thin, colors=WALL), static=True)
        lights = [(light.x_m, light.y_m) for light in static.lights[self._arena]] if static.lights else []
        if lights:
            disc = rr.Radius.ui_points(6.0)
            rec.log("world/lights", rr.Points2D(lights, radii=disc, colors=LIGHT, draw_order=_LIGHTS), static=True)


def _outline(obstacle: Obstacle) -> FloatArray:
    """A closed line around an obstacle, (points, 2) in m, arena frame."""
    if obstacle.shape == "cylinder":
        centre = np.array([obstacle.x_m, obstacle.y_m])
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        return centre + obstacle.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return _closed(obstacle.corners_m)


def _closed(corners: FloatArray) -> FloatArray:
    return np.concatenate([corners, corners[:1]])
