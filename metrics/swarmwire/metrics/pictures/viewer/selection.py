"""One robot of a recording in detail: a ring around it, its radio's range, and its sensor readings."""

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

ARENA = 0  # that recordings and live views show: its robots are the first rows
_FRAME = "world/selected"  # moves with the robot, axes as the arena's
_NAME = f"{_FRAME}/name"
EYE = f"{_FRAME}/eye"  # a view from there has y pointing up
_HITS: NDArray[np.uint32] = np.array(
    [packed((120, 125, 145), 90), packed(MARK, 255), packed((255, 60, 50), 255)], np.uint32
)
_NOTHING, _THING, _ROBOT = range(3)  # nearest thing on a ray
_LIGHT_BAR = packed(LIGHT, 200)
_RANGE_ALPHA, _RING_ALPHA = 110, 230
_LIGHT_RADII = 2.0  # length of a photocell's bar at full light, in body radii
_DRAWN = ("proximity.value", "light.value")  # sensors
_RING_HEADINGS = 0.9  # radius of the ring in lengths of the heading's arrow
_ORDER = 5.0
_RADIO_SHARE = 0.5  # of the radio's range: half the width of the close-up,
_LEAST_NEAR, _MOST_NEAR = 3.0, 8.0  # but so many times as far as its rays reach, at least and at most
_NAME_BELOW = 1.5  # where the name stands below the robot, in radii of the ring
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 65)


def selected_robot(static: Static, name: str | None, where: str) -> str:
    """This robot; None: the first of the first group whose body has proximity sensors or photocells, else of all.

    BadInput, naming `where`, if there is no such robot.
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
    """The index of the selected robot; while it is dead, of the next one alive in its group, if there is one.

    `alive` (robots,) is of one arena.
    """
    group = _group(static, selected)
    in_turn = (*range(selected, group.stop), *range(group.start, selected))
    return next((index for index in in_turn if alive[index]), selected)


def close_up_m(static: Static, selected: str) -> float:
    """Half the width of the close-up of a robot: its rays are seen, and neighbours by radio unless these are far."""
    body = _group(static, static.robot_names.index(selected)).body
    near_m = body.radius_m + (body.proximity.range_m if body.proximity else 2.0 * body.radius_m)
    radio_m = 0.0 if static.range_m is None else _RADIO_SHARE * static.range_m
    return float(np.clip(radio_m, _LEAST_NEAR * near_m, _MOST_NEAR * near_m))


class RerunSelected:
    """The selected robot, or while it is dead the next one alive in its group.

    Its rays end where the reading says that something is, noise and all.

    Of the rays that see more than noise could feign, those on which a robot stands are red, the others white.
    Bars outwards from the rim show how much light each photocell sees. Between a robot's turns these are what it
    sensed last; sensors that its agent does not use are not there.
    """

    def __init__(self, static: Static, selected: str, radius_m: FloatArray, heading_m: FloatArray) -> None:
        """Follow this robot; radius_m and heading_m (robots,) are how large robots are drawn, and their arrows."""
        self._static = static
        self._selected = static.robot_names.index(selected)
        self._index: int = NO_ROBOT  # of the robot that is shown; none yet
        self._group, self._ring_m = _group(static, self._selected), _RING_HEADINGS * float(heading_m[self._selected])
        self._radius_m = radius_m
        self._sensed: dict[str, FloatArray] = {}
        self._sees = False  # whether any sensor reads more than 0
        self._drawn = False  # whether there are rays to be seen

    def begin(self, rec: Any) -> None:
        """Log the constant marks that move with the robot."""
        import rerun as rr

        around = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=1)
        circles, colors = [self._ring_m * around], [packed(MARK, _RING_ALPHA)]
        if self._static.range_m is not None:
            circles.append(self._static.range_m * around)
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
        saw, self._sees = self._sees, any(bool(value.any()) for value in self._sensed.values())
        if not (full or saw or self._sees or not truth.alive[self._index]):
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
        """Show the selected robot, or one alive in its place, and its name."""
        import rerun as rr

        index = living_robot(self._static, self._selected, truth.alive[: self._static.robots])
        if index != self._index:
            self._index, self._sensed = index, {}
            below = np.array([[0.0, -_NAME_BELOW * self._ring_m]], np.float32)
            rows.add(_NAME, rr.Points2D.columns, positions=below, labels=[self._static.robot_names[index]])

    def _remember(self, truth: Truth) -> None:
        """Keep the robot's readings of this tick; a dead robot has none."""
        readings = truth.readings.get(self._group.name)
        if not truth.alive[self._index]:
            self._sensed = {}
        elif readings is not None:
            at = int(np.searchsorted(readings.rows, self._index))
            if at < len(readings.rows) and readings.rows[at] == self._index:
                self._sensed = {name: readings.fields[name][at].copy() for name in _DRAWN if name in readings.fields}

    def _bars(self, sheet: ProximitySpec | LightSpec, length_m: FloatArray, heading_rad: float) -> FloatArray:
        """Lines of these lengths outwards from the rim, (sensors, 2, 2) from the robot's centre."""
        angle, rim_m = sheet.angle_rad + heading_rad, self._group.body.radius_m
        lines = np.empty((len(angle), 2, 2))
        lines[:, :, 0], lines[:, :, 1] = np.cos(angle)[:, None], np.sin(angle)[:, None]
        lines[:, 0] *= rim_m
        lines[:, 1] *= (rim_m + length_m)[:, None]
        return lines

    def _hits(self, truth: Truth, sheet: ProximitySpec, rays: FloatArray) -> NDArray[np.uint32]:
        """The colour of each ray, (rays,): of a robot, of another thing, or of nothing."""
        seen = self._sensed["proximity.value"] > sheet.noise
        if not seen.any():
            return np.full(len(rays), _HITS[_NOTHING])
        centre = truth.pose[: self._static.robots, :2] - truth.pose[self._index, :2]
        others = np.flatnonzero(np.hypot(centre[:, 0], centre[:, 1]) < 2.0 * (sheet.range_m + self._radius_m.max()))
        others = others[others != self._index]
        outwards = rays[:, 0] / self._group.body.radius_m
        along = outwards @ centre[others].T  # (rays, others)
        beside = np.abs(outwards[:, :1] * centre[others, 1] - outwards[:, 1:] * centre[others, 0])
        reach_m = self._group.body.radius_m + sheet.range_m + self._radius_m[others]
        robot = ((along > 0.0) & (along < reach_m) & (beside < self._radius_m[others])).any(axis=1)
        return _HITS[np.where(seen, np.where(robot, _ROBOT, _THING), _NOTHING)]


def _group(static: Static, index: int) -> Group:
    return next(group for group in static.groups if group.start <= index < group.stop)
