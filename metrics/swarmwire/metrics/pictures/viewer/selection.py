"""The selected robot of a recording: a ring around it, its radio's range, and its sensor readings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.observe.truth import Group, Static, Truth
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.metrics.pictures.viewer.rows import RerunRows
from swarmwire.metrics.pictures.viewer.style import LIGHT, MARK, packed

ARENA = 0  # arena of recordings and live views; its robots are the first rows
_FRAME = "world/selected"  # frame at the robot, with the arena's axes
_NAME = f"{_FRAME}/name"
EYE = f"{_FRAME}/eye"  # origin of a view with y pointing up
_HITS: NDArray[np.uint32] = np.array(
    [packed((120, 125, 145), 90), packed(MARK, 255), packed((255, 60, 50), 255)], np.uint32
)
_FREE, _OBJECT, _ROBOT = range(3)  # nearest object on a ray
_LIGHT_BAR = packed(LIGHT, 200)
_RANGE_ALPHA, _RING_ALPHA = 110, 230
_LIGHT_RADII = 2.0  # length of a photocell's bar at full light, in body radii
_DRAWN = ("proximity.value", "light.value")  # sensors
_RING_HEADINGS = 0.9  # radius of the ring, in lengths of the heading's arrow
_ORDER = 5.0
_RADIO_SHARE = 0.5  # half width of the close-up as a share of the radio's range
_MIN_NEAR, _MAX_NEAR = 3.0, 8.0  # its bounds, in lengths of the robot's rays
_NAME_BELOW = 1.5  # distance of the name below the robot, in radii of the ring
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 65)


def selected_robot(static: Static, name: str | None, where: str) -> str:
    """Return this robot; None: the first robot of the first group with proximity sensors or photocells, or of all.

    BadInput, naming `where`, for an unknown robot.
    """
    if name in static.robot_names:
        return name
    if name is not None:
        raise BadInput(where, "selected", f"expected a robot such as {static.robot_names[0]}; got {name!r}")
    for group in static.groups:
        if group.body.proximity or group.body.light:
            return static.robot_names[group.start]
    return static.robot_names[0]


def living_robot(static: Static, selected: int, alive: BoolArray) -> int:
    """Return the index of the selected robot; while it is dead, of the next living robot of its group, if any.

    `alive` (robots,) is that of an arena.
    """
    group = _group(static, selected)
    candidates = (*range(selected, group.stop), *range(group.start, selected))
    return next((index for index in candidates if alive[index]), selected)


def close_up_m(static: Static, selected: str) -> float:
    """Return half the width of a robot's close-up, which contains its rays, and neighbours by radio unless far away."""
    body = _group(static, static.robot_names.index(selected)).body
    near_m = body.radius_m + (body.proximity.range_m if body.proximity else 2.0 * body.radius_m)
    radio_m = 0.0 if static.range_m is None else _RADIO_SHARE * static.range_m
    return float(np.clip(radio_m, _MIN_NEAR * near_m, _MAX_NEAR * near_m))


class RerunSelected:
    """The selected robot, or while it is dead the next living robot of its group.

    Its rays end at the distance of the reading, with noise. Rays with a reading above the noise are red if they meet a
    robot, else white. Bars outwards from the rim show the light at each photocell. Between the robot's steps, the
    latest readings are shown; sensors that its agent does not use are absent.
    """

    def __init__(self, static: Static, selected: str, radius_m: FloatArray, heading_m: FloatArray) -> None:
        """Follow this robot; radius_m and heading_m (robots,) are the drawn sizes of robots and of their arrows."""
        self._static = static
        self._selected = static.robot_names.index(selected)
        self._index: int = NO_ROBOT  # shown robot
        self._group, self._ring_m = _group(static, self._selected), _RING_HEADINGS * float(heading_m[self._selected])
        self._radius_m = radius_m
        self._sensed: dict[str, FloatArray] = {}
        self._has_readings = False  # any sensor reads more than 0
        self._drawn = False  # rays are visible

    def begin(self, rec: Any) -> None:
        """Log the constant marks that move with the robot."""
        import rerun as rr

        circle = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=1)
        circles, colors = [self._ring_m * circle], [packed(MARK, _RING_ALPHA)]
        if self._static.range_m is not None:
            circles.append(self._static.range_m * circle)
            colors.append(packed(MARK, _RANGE_ALPHA))
        thin = rr.Radius.ui_points(0.7)
        marks = rr.LineStrips2D(circles, radii=thin, colors=colors, draw_order=_ORDER)
        rec.log(f"{_FRAME}/marks", marks, static=True)
        rec.log(EYE, rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
        look = rr.Points2D.from_fields(radii=rr.Radius.ui_points(0.0), colors=packed(MARK, 255), show_labels=True)
        rec.log(_NAME, look, static=True)
        rays = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.8), draw_order=_ORDER)
        rec.log(f"{_FRAME}/rays", rays, static=True)

    def add(self, rows: RerunRows, truth: Truth, *, full: bool) -> None:
        """Add a tick; unless `full`, rays without a hit are not updated."""
        import rerun as rr

        self._select(rows, truth)
        x_m, y_m, heading_rad = truth.pose[self._index].tolist()
        rows.add(_FRAME, rr.Transform3D.columns, translation=[[x_m, y_m, 0.0]])
        self._remember(truth)
        had_readings = self._has_readings
        self._has_readings = any(bool(value.any()) for value in self._sensed.values())
        if not (full or had_readings or self._has_readings or not truth.alive[self._index]):
            return
        strips, colors = [np.empty((0, 2, 2))], [_HITS[:0]]
        body = self._group.body
        if body.proximity and "proximity.value" in self._sensed:
            distance_m = body.proximity.response.distance_m(self._sensed["proximity.value"])
            near = self._bars(body.proximity, distance_m, heading_rad)
            strips.append(near)
            colors.append(self._hits(truth, body.proximity, near))
        if body.light and "light.value" in self._sensed:
            length_m = _LIGHT_RADII * body.radius_m * self._sensed["light.value"]
            strips.append(self._bars(body.light, length_m, heading_rad))
            colors.append(np.full(len(length_m), _LIGHT_BAR, np.uint32))
        lines = np.concatenate(strips).astype(np.float32)
        if len(lines) or self._drawn:
            rows.add(f"{_FRAME}/rays", rr.LineStrips2D.columns, strips=lines, colors=np.concatenate(colors))
        self._drawn = len(lines) > 0

    def _select(self, rows: RerunRows, truth: Truth) -> None:
        """Show the selected robot, or a living robot of its group, with its name."""
        import rerun as rr

        index = living_robot(self._static, self._selected, truth.alive[: self._static.robots])
        if index != self._index:
            self._index, self._sensed = index, {}
            below = np.array([[0.0, -_NAME_BELOW * self._ring_m]], np.float32)
            rows.add(_NAME, rr.Points2D.columns, positions=below, labels=[self._static.robot_names[index]])

    def _remember(self, truth: Truth) -> None:
        """Store the robot's readings of this tick; a dead robot has none."""
        readings = truth.readings.get(self._group.name)
        if not truth.alive[self._index]:
            self._sensed = {}
        elif readings is not None:
            row = int(np.searchsorted(readings.rows, self._index))
            if row < len(readings.rows) and readings.rows[row] == self._index:
                self._sensed = {name: readings.fields[name][row].copy() for name in _DRAWN if name in readings.fields}

    def _bars(self, sheet: ProximitySpec | LightSpec, length_m: FloatArray, heading_rad: float) -> FloatArray:
        """Return lines of these lengths outwards from the rim, (sensors, 2, 2) relative to the robot's centre."""
        angle, rim_m = sheet.angle_rad + heading_rad, self._group.body.radius_m
        lines = np.empty((len(angle), 2, 2))
        lines[:, :, 0], lines[:, :, 1] = np.cos(angle)[:, None], np.sin(angle)[:, None]
        lines[:, 0] *= rim_m
        lines[:, 1] *= (rim_m + length_m)[:, None]
        return lines

    def _hits(self, truth: Truth, sheet: ProximitySpec, rays: FloatArray) -> NDArray[np.uint32]:
        """Return the colour of each ray, (rays,), for a robot, another object, or a free ray."""
        hit = self._sensed["proximity.value"] > sheet.noise
        if not hit.any():
            return np.full(len(rays), _HITS[_FREE])
        center = truth.pose[: self._static.robots, :2] - truth.pose[self._index, :2]
        others = np.flatnonzero(np.hypot(center[:, 0], center[:, 1]) < 2.0 * (sheet.range_m + self._radius_m.max()))
        others = others[others != self._index]
        direction = rays[:, 0] / self._group.body.radius_m
        along_m = direction @ center[others].T  # (rays, others)
        across_m = np.abs(direction[:, :1] * center[others, 1] - direction[:, 1:] * center[others, 0])
        reach_m = self._group.body.radius_m + sheet.range_m + self._radius_m[others]
        robot = ((along_m > 0.0) & (along_m < reach_m) & (across_m < self._radius_m[others])).any(axis=1)
        return _HITS[np.where(hit, np.where(robot, _ROBOT, _OBJECT), _FREE)]


def _group(static: Static, index: int) -> Group:
    return next(group for group in static.groups if group.start <= index < group.stop)
