"""The arena of a recording: boundary, obstacles and lights once; robots, headings, trails and links per tick."""

import math
from typing import Any

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Obstacle, Static, Truth
from swarmwire.metrics.palette import group_color

LINKS_EVERY_TICK_UP_TO = 200  # robots; links are most of a recording's bytes and time
THINNED_LINKS_EVERY_TICKS = 10

_DEAD_COLOR = (95, 95, 100)
_WALL_COLOR = (150, 155, 170)
_LIGHT_COLOR = (255, 220, 60)
_LINK_COLOR = (130, 145, 180, 50)
_TRAIL_ALPHA = 170
_LIGHTS, _LINKS, _TRAILS, _HEADINGS, _ROBOTS = 0.5, 1.0, 2.0, 3.0, 4.0  # drawn in this order
_HEADING_RADII = 2.5  # length of a heading's arrow in body radii, from the centre
_LEAST_HEADING = 0.025  # and at least this share of the arena's larger side, so that it can be seen,
_CROWDED = 0.25  # or this share / sqrt(robots) if that is less, so that a thousand do not cover one another


class RerunArena:
    """What is seen of one arena: a call per kind of thing and tick, whatever the number of robots.

    In rerun's 2D views y points down; a static transform that mirrors y turns it up, and leaves the data as it is.
    """

    def __init__(self, static: Static, arena: int) -> None:
        """Draw this arena of the run."""
        self._static, self._arena = static, arena
        self._rows = slice(arena * static.robots, (arena + 1) * static.robots)
        self._color, radius_m = _by_group(static)
        self._radius_m = radius_m
        least = min(_LEAST_HEADING, _CROWDED / math.sqrt(static.robots))
        self._heading_m = np.maximum(_HEADING_RADII * radius_m, least * max(static.arena_size_m))
        self._was_alive: BoolArray | None = None
        self.links_every_ticks = 1 if static.robots <= LINKS_EVERY_TICK_UP_TO else THINNED_LINKS_EVERY_TICKS

    def begin(self, rec: Any) -> None:
        """Log what does not change."""
        import rerun as rr

        static = self._static
        rec.log("world", rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
        half_x, half_y = (size / 2 for size in static.arena_size_m)
        boundary = _closed(np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]]))
        width = rr.Radius.ui_points(1.2 if static.walled else 0.5)
        rec.log("world/boundary", rr.LineStrips2D([boundary], radii=width, colors=_WALL_COLOR), static=True)
        outlines = [_outline(obstacle) for obstacle in static.obstacles[self._arena]]
        if outlines:
            thin = rr.Radius.ui_points(1.2)
            rec.log("world/obstacles", rr.LineStrips2D(outlines, radii=thin, colors=_WALL_COLOR), static=True)
        lights = [(light.x_m, light.y_m) for light in static.lights[self._arena]] if static.lights else []
        if lights:
            disc = rr.Radius.ui_points(6.0)
            points = rr.Points2D(lights, radii=disc, colors=_LIGHT_COLOR, draw_order=_LIGHTS)
            rec.log("world/lights", points, static=True)
        names = list(static.robot_names)
        robots = rr.Points2D.from_fields(radii=self._radius_m, labels=names, show_labels=False, draw_order=_ROBOTS)
        rec.log("world/robots", robots, static=True)
        faint = np.column_stack([self._color, np.full(static.robots, _TRAIL_ALPHA, np.uint8)])
        trails = rr.Points2D.from_fields(radii=rr.Radius.ui_points(0.7), colors=faint, draw_order=_TRAILS)
        rec.log("world/trails", trails, static=True)
        links = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_LINK_COLOR, draw_order=_LINKS)
        rec.log("world/links", links, static=True)
        headings = rr.Arrows2D.from_fields(radii=rr.Radius.ui_points(1.2), draw_order=_HEADINGS)
        rec.log("world/headings", headings, static=True)

    def log(self, rec: Any, truth: Truth) -> None:
        """Log one tick."""
        import rerun as rr

        pose = truth.pose[self._rows]
        position_m, heading_rad = pose[:, :2], pose[:, 2]
        alive = truth.alive[self._rows]
        if self._was_alive is None or not np.array_equal(alive, self._was_alive):
            self._log_colors(rec, alive)
        rec.log("world/robots", rr.Points2D.from_fields(positions=position_m))
        rec.log("world/trails", rr.Points2D.from_fields(positions=position_m))
        ahead = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1) * self._heading_m[:, None]
        rec.log("world/headings", rr.Arrows2D.from_fields(origins=position_m, vectors=ahead))
        if truth.edges is not None and truth.tick % self.links_every_ticks == 0:
            ends = self._edges(truth.edges)
            rec.log("world/links", rr.LineStrips2D.from_fields(strips=position_m[ends].astype(np.float32)))

    def _edges(self, edges: IntArray) -> IntArray:
        """The arena's own edges, as indices of its robots."""
        start = self._rows.start
        own = (edges[:, 0] >= start) & (edges[:, 0] < self._rows.stop)
        return edges[own] - start

    def _log_colors(self, rec: Any, alive: BoolArray) -> None:
        import rerun as rr

        color = np.where(alive[:, None], self._color, np.array(_DEAD_COLOR, np.uint8))
        rec.log("world/robots", rr.Points2D.from_fields(colors=color))
        rec.log("world/headings", rr.Arrows2D.from_fields(colors=color))
        self._was_alive = alive


def _by_group(static: Static) -> tuple[Any, FloatArray]:
    """Each robot's colour (robots, 3), and its body's radius in m (robots,)."""
    color = np.zeros((static.robots, 3), np.uint8)
    radius_m = np.zeros(static.robots)
    for i, group in enumerate(static.groups):
        color[group.start : group.stop] = group_color(i)
        radius_m[group.start : group.stop] = group.body.radius_m
    return color, radius_m


def _outline(obstacle: Obstacle) -> FloatArray:
    """A closed line around an obstacle, (points, 2) in m, arena frame."""
    if obstacle.shape == "cylinder":
        centre = np.array([obstacle.x_m, obstacle.y_m])
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        return centre + obstacle.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return _closed(obstacle.corners_m)


def _closed(corners: FloatArray) -> FloatArray:
    return np.concatenate([corners, corners[:1]])
