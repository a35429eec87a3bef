"""The arena of a recording: floor, walls, obstacles, lights; robots, LEDs, links, lost packets and traffic per tick."""

import math
from collections import deque
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from swarmwire.comms.base.arrays import BoolArray, ByteArray, FloatArray, IntArray
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.geometry.ground import ground_of, shades_over
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import ReceptionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.torus import link_lines
from swarmwire.metrics.pictures.drawing.canvas import FATE_COLORS, robot_color
from swarmwire.metrics.pictures.viewer.rows import RerunRows
from swarmwire.metrics.pictures.viewer.selection import ARENA, RerunSelected
from swarmwire.metrics.pictures.viewer.style import DEAD, LIGHT, MARK, WALL, RerunClasses, packed, printable

_ALPHA = 110  # the viewer darkens lines by the opacity
_LOST_ALPHA = 80  # many packets are lost, so their lines must not hide robots and rarer fates
_LOST_ORDER = 1.5  # order above the links, below the robots
_COLORS = np.zeros(len(Fate), np.uint32)
for _fate, _color in FATE_COLORS.items():
    _COLORS[_fate] = packed(_color, _LOST_ALPHA if _fate is Fate.LOST else _ALPHA)
LONGER_SIDE_PX = 512
_DARKEST, _BRIGHTEST = 30, 90  # grey levels of the shades 0 and 1
_FLOOR_ORDER = -1.0
_LEDS = 5.0  # order above the robots
_CROSS = np.array([[[-0.5, -0.5], [0.5, 0.5]], [[-0.5, 0.5], [0.5, -0.5]]], np.float32)  # unit: length of a heading
_NO_CROSSES = np.empty((0, 2, 2), np.float32)
_OPAQUE = 0xFF
_TRAIL_ALPHA = 170
_TRAILS, _HEADINGS, _ROBOTS, _CROSSES = 2.0, 3.0, 4.0, 4.5  # orders above the links
_HEADING_RADII = 2.5  # length of a heading's arrow from the center, in body radii
# least length of the arrow as a share of the arena's larger side; its limit times sqrt(robots), against overlaps
_MIN_HEADING, _MIN_HEADING_OF_CROWD = 0.025, 0.25
LINKS_EVERY_TICK_UP_TO = 200  # robots; links dominate the size and the time of a recording
THINNED_LINKS_EVERY_TICKS = 10
_LINK_COLOR = (84, 92, 116)
_LIGHTS, _LINKS = 0.5, 1.0  # orders below moving objects
_TRAFFIC_COLOR = MARK
_TRAFFIC_ORDER = 1.7  # order above links and lost packets, below the robots
_THIN, _PER_DECADE = 0.7, 0.6  # radius at _THIN_BYTES_S in ui points, and its increase per factor of ten
_THIN_BYTES_S = 100.0


def begin_lost(rec: Any) -> None:
    """Log the style of the lines of packets that were not received."""
    look = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.5), draw_order=_LOST_ORDER)
    rec.log("world/lost_packets", look, static=True)


def add_lost(rows: RerunRows, finished: ReceptionRecords, position_m: FloatArray) -> None:
    """Add the packets that were lost since the previous tick, as lines between the current positions (robots, 2).

    A packet that never went on air has no receiver, and so no line.
    """
    lost = (finished.arena == ARENA) & (finished.receiver >= 0) & (finished.fate != Fate.RECEIVED)
    ends = np.column_stack([finished.sender[lost], finished.receiver[lost]])
    strips, colors = position_m[ends].astype(np.float32), _COLORS[finished.fate[lost]]
    rows.add("world/lost_packets", rr.LineStrips2D.columns, strips=strips, colors=colors)


def log_floor(rec: Any, static: Static) -> None:
    """Log the floor, if the run has one."""
    if static.floor is None:
        return
    grey, (width, height) = _raster(static), static.arena_size_m
    rows, columns = grey.shape
    # An image's pixels are a unit wide; its first row is at the least y, since y points up in the arena.
    transform = rr.Transform3D(translation=[-width / 2, -height / 2, 0.0], scale=[width / columns, height / rows, 1.0])
    rec.log("world/floor", transform, rr.Image(grey, color_model="L", draw_order=_FLOOR_ORDER), static=True)


def _raster(static: Static) -> ByteArray:
    """Return the grey levels of the floor, (rows, columns), the least y first."""
    ground, (width, height) = ground_of(static.floor, static.arena_size_m, static.boundary), static.arena_size_m
    step_m = max(width, height) / LONGER_SIDE_PX
    columns, rows = max(round(width / step_m), 1), max(round(height / step_m), 1)
    x = (np.arange(columns) + 0.5) * width / columns - width / 2
    y = (np.arange(rows) + 0.5) * height / rows - height / 2
    return (_DARKEST + (_BRIGHTEST - _DARKEST) * shades_over(ground, x, y)).astype(np.uint8)


class RerunLeds:
    """The lit LEDs of an arena, as points."""

    def __init__(self, static: Static) -> None:
        """Create points for LEDs of an arena of this run."""
        self._position_m = np.zeros((static.robots, static.max_leds, 2))  # body frame
        for group in static.groups:
            self._position_m[group.start : group.stop, : group.body.led_count] = group.body.led_positions_m[:, :2]
        self._leds: IntArray | None = None  # LEDs of the previous tick
        self._any_lit = False

    def begin(self, rec: Any) -> None:
        """Log the constants."""
        look = rr.Points2D.from_fields(radii=rr.Radius.ui_points(2.5), draw_order=_LEDS)
        rec.log("world/leds", look, static=True)

    def add(self, rows: RerunRows, truth: Truth, robots: slice) -> None:
        """Add a tick of the robots in these rows of the world."""
        were_lit = self._any_lit
        if truth.leds is not self._leds:  # unchanged LEDs are the same array
            self._leds, self._any_lit = truth.leds, bool(truth.leds[robots].any())
        if not (self._any_lit or were_lit):
            return
        rgb, pose = truth.leds[robots], truth.pose[robots]
        robot, led = np.nonzero(rgb)
        ahead_m, left_m = self._position_m[robot, led].T
        c, s = np.cos(pose[robot, 2]), np.sin(pose[robot, 2])
        x_m, y_m = pose[robot, 0] + c * ahead_m - s * left_m, pose[robot, 1] + s * ahead_m + c * left_m
        positions = np.stack([x_m, y_m], axis=1).astype(np.float32)
        colors = ((rgb[robot, led] << 8) | _OPAQUE).astype(np.uint32)
        rows.add("world/leds", rr.Points2D.columns, positions=positions, colors=colors)


class RerunRobots:
    """The robots of an arena: discs, headings and trails in each tick; colours and crosses of the dead on changes."""

    def __init__(self, static: Static) -> None:
        """Create marks for robots of an arena of this run."""
        self._static, self._classes = static, RerunClasses(static)
        radii = [np.full(group.stop - group.start, group.body.radius_m) for group in static.groups]
        self.radius_m = np.concatenate(radii)  # (robots,)
        least = min(_MIN_HEADING, _MIN_HEADING_OF_CROWD / math.sqrt(static.robots))
        self.heading_m = np.maximum(_HEADING_RADII * self.radius_m, least * max(static.arena_size_m))  # (robots,)
        self._arrow_m = self.heading_m[:, None].astype(np.float32)
        self._colored: tuple[bytes, bytes] | None = None  # alive and state of the latest colours
        self._crosses = _NO_CROSSES

    def begin(self, rec: Any) -> None:
        """Log the constants."""
        names = [printable(name) for name in self._static.robot_names]
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
        crosses = rr.LineStrips2D.from_fields(radii=width, colors=DEAD, draw_order=_CROSSES)
        rec.log("world/dead", crosses, static=True)

    def add(self, rows: RerunRows, truth: Truth, robots: slice, *, trails: bool) -> None:
        """Add a tick of the robots in these rows of the world; without `trails`, trails have no point of this tick."""
        pose, alive, state = truth.pose[robots].astype(np.float32), truth.alive[robots], truth.state[robots]
        rows.add("world/robots", _points, pose=pose)
        if trails:
            rows.add("world/trails", _points, pose=pose)
        rows.add("world/headings", self._arrows, pose=pose)
        current = alive.tobytes(), state.tobytes()
        if current != self._colored:
            self._colored = current
            class_id, color = self._classes.assign(rows, alive, state, truth.states)
            rows.add("world/robots", rr.Points2D.columns, class_ids=class_id, colors=color)
            rows.add("world/headings", rr.Arrows2D.columns, colors=color)
        self._cross_out(rows, pose, alive)

    def _cross_out(self, rows: RerunRows, pose: NDArray[np.float32], alive: BoolArray) -> None:
        """Update the crosses over dead robots, since not everyone distinguishes their colour."""
        crosses = _NO_CROSSES
        if not alive.all():
            center_m, size_m = pose[~alive, None, None, :2], self._arrow_m[~alive, :, None, None]
            crosses = (center_m + size_m * _CROSS).reshape(-1, 2, 2)
        if not np.array_equal(crosses, self._crosses):
            self._crosses = crosses
            rows.add("world/dead", rr.LineStrips2D.columns, strips=crosses)

    def _arrows(self, pose: NDArray[np.float32]) -> Any:
        """Return the headings at poses of ticks, (ticks x robots, 3)."""
        ahead = np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1).reshape(-1, self._static.robots, 2)
        ahead *= self._arrow_m
        return rr.Arrows2D.columns(origins=np.ascontiguousarray(pose[:, :2]), vectors=ahead.reshape(-1, 2))


def _points(pose: NDArray[np.float32]) -> Any:
    return rr.Points2D.columns(positions=np.ascontiguousarray(pose[:, :2]))


class RerunTraffic:
    """Lines between the robots of an arena that exchanged frames in the last second."""

    def __init__(self, static: Static) -> None:
        """Start without frames."""
        self._static = static
        self._second: deque[tuple[IntArray, IntArray]] = deque(maxlen=static.rate_hz)  # per tick: links, bytes
        self._drawn = False

    def begin(self, rec: Any) -> None:
        """Log the constants."""
        rec.log(
            "world/traffic", rr.LineStrips2D.from_fields(colors=_TRAFFIC_COLOR, draw_order=_TRAFFIC_ORDER), static=True
        )

    def see(self, finished: ReceptionRecords) -> None:
        """Count the frames received since the previous tick."""
        frames = (finished.arena == ARENA) & (finished.fate == Fate.RECEIVED) & (finished.tag == FRAME_TAG)
        sender, receiver = finished.sender[frames], finished.receiver[frames]
        link = np.minimum(sender, receiver) * self._static.robots + np.maximum(sender, receiver)
        self._second.append((link, finished.size_bytes[frames]))

    def add(self, rows: RerunRows, position_m: FloatArray) -> None:
        """Add a tick's lines between the robots at position_m (robots, 2), if any are or were visible."""
        links, bytes_s = self._rates()
        if not (len(links) or self._drawn):
            return
        self._drawn = bool(len(links))
        lines = link_lines(position_m, np.stack(np.divmod(links, self._static.robots), axis=1), self._static)
        labels = [_rate_text(rate) for rate in bytes_s.tolist()]
        labels += [""] * (len(lines) - len(links))  # on a torus the second halves come last
        radii = _THIN + _PER_DECADE * np.log10(np.maximum(bytes_s / _THIN_BYTES_S, 1.0))
        radii = np.concatenate([radii, np.full(len(lines) - len(links), _THIN)])
        rows.add("world/traffic", _ui_strips, strips=lines.astype(np.float32), points=radii, labels=labels)

    def _rates(self) -> tuple[IntArray, FloatArray]:
        """Return links with frames in the last second (lesser index x robots + greater index), and bytes per second."""
        if not self._second:
            return np.empty(0, np.int64), np.empty(0)
        link, size_bytes = (np.concatenate(column) for column in zip(*self._second, strict=True))
        links, index = np.unique(link, return_inverse=True)
        return links, np.bincount(index, size_bytes, len(links)) * self._static.rate_hz / len(self._second)


def _ui_strips(strips: Any, points: FloatArray, labels: list[str]) -> Any:
    return rr.LineStrips2D.columns(strips=strips, radii=-points, labels=labels)  # rerun's ui points are negative radii


def _rate_text(bytes_s: float) -> str:
    if bytes_s < 1e3:
        return f"{bytes_s:.0f} B/s"
    return f"{bytes_s / 1e3:.1f} kB/s" if bytes_s < 1e6 else f"{bytes_s / 1e6:.1f} MB/s"


class RerunArena:
    """The objects of the arena, with a constant number of calls per tick for any number of robots.

    In rerun's 2D views y points down; a static transform mirrors y, so that the data need no change.
    """

    def __init__(self, static: Static, selected: str) -> None:
        """Create the objects; `selected` is the robot in detail."""
        self._static = static
        self._rows = slice(static.robots)  # robots of the arena
        self._robots = RerunRobots(static)
        self._leds = RerunLeds(static)
        self._traffic = RerunTraffic(static)
        self._selected = RerunSelected(static, selected, self._robots.radius_m, self._robots.heading_m)
        self.links_every_ticks = 1 if static.robots <= LINKS_EVERY_TICK_UP_TO else THINNED_LINKS_EVERY_TICKS

    def begin(self, rec: Any) -> None:
        """Log the constants."""
        rec.log("world", rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
        log_floor(rec, self._static)
        self._log_fixed(rec)
        links = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_LINK_COLOR, draw_order=_LINKS)
        rec.log("world/links", links, static=True)
        begin_lost(rec)
        self._traffic.begin(rec)
        self._robots.begin(rec)
        self._leds.begin(rec)
        self._selected.begin(rec)

    def add(self, rows: RerunRows, truth: Truth) -> None:
        """Add a tick."""
        full = truth.tick % self.links_every_ticks == 0
        self._robots.add(rows, truth, self._rows, trails=full)
        self._leds.add(rows, truth, self._rows)
        self._selected.add(rows, truth, full=full)
        if truth.movable is not None:
            self._add_movable(rows, truth.movable[ARENA])
        if truth.finished is not None:
            self._traffic.see(truth.finished)
        if full:
            self._add_radio(rows, truth, truth.pose[self._rows, :2])

    def _add_movable(self, rows: RerunRows, pose: FloatArray) -> None:
        strips = [_outline(obstacle) for obstacle in self._static.movable_at(ARENA, pose)]
        rows.add("world/movable", rr.LineStrips2D.columns, strips=strips)

    def _add_radio(self, rows: RerunRows, truth: Truth, position_m: FloatArray) -> None:
        if truth.edges is not None:
            edges = truth.edges[truth.edges[:, 0] < self._static.robots]
            lines = link_lines(position_m, edges, self._static)
            rows.add("world/links", rr.LineStrips2D.columns, strips=lines.astype(np.float32))
        if truth.finished is not None:
            add_lost(rows, truth.finished, position_m)
            self._traffic.add(rows, position_m)

    def _log_fixed(self, rec: Any) -> None:
        static = self._static
        half_x, half_y = (size / 2 for size in static.arena_size_m)
        boundary = _closed(np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]]))
        width = rr.Radius.ui_points(1.2 if static.walled else 0.5)
        rec.log("world/boundary", rr.LineStrips2D([boundary], radii=width, colors=WALL), static=True)
        thin = rr.Radius.ui_points(1.2)
        outlines = [_outline(obstacle) for obstacle in static.fixed(ARENA)]
        if outlines:
            rec.log("world/obstacles", rr.LineStrips2D(outlines, radii=thin, colors=WALL), static=True)
        if static.movable:
            rec.log("world/movable", rr.LineStrips2D.from_fields(radii=thin, colors=WALL), static=True)
        lights = [(light.x_m, light.y_m) for light in static.lights[ARENA]] if static.lights else []
        if lights:
            disc = rr.Radius.ui_points(6.0)
            rec.log("world/lights", rr.Points2D(lights, radii=disc, colors=LIGHT, draw_order=_LIGHTS), static=True)


def _outline(obstacle: Obstacle) -> FloatArray:
    """Return a closed line around an obstacle, (points, 2) in m, arena frame."""
    if obstacle.shape == "cylinder":
        center = np.array([obstacle.x_m, obstacle.y_m])
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        return center + obstacle.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return _closed(obstacle.corners_m)


def _closed(corners: FloatArray) -> FloatArray:
    return np.concatenate([corners, corners[:1]])
