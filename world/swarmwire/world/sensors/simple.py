"""Sensors of the robot's own state: battery, bumper, compass, positioning, flow, odometry and ground colour."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, KeyArray
from swarmwire.comms.base.draws import normal as normals
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.geometry.ground import shade_at
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.robot.sensors.sensor import Field
from swarmwire.comms.robot.sensors.simple import (
    BatterySpec,
    BumperSpec,
    CompassSpec,
    FlowSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)
from swarmwire.world.sensors.sensor import BuiltInSensor

SLIP, WHEEL = purpose("odometry slip"), purpose("odometry wheel")


class BatterySensor(BuiltInSensor[BatterySpec]):
    """Sensor `battery`: charge (n,), 1 full to 0 empty, and voltage_v (n,), which falls linearly with the charge."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the charge and the voltage of every robot of the group."""
        charge = self.scene.charge[:, self.group.start : self.group.stop].copy()
        empty_v = self.spec.empty_v
        return charge, empty_v + charge * (self.spec.full_v - empty_v)


class BumperSensor(BuiltInSensor[BumperSpec]):
    """Sensor `bumper`: pressed (n,), 1 if the body touched anything in the tick before, else 0."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the contact flag of every robot of the group."""
        return (self.scene.touched[:, self.group.start : self.group.stop].copy(),)


class CompassSensor(BuiltInSensor[CompassSpec]):
    """Sensor `compass`: heading_rad (n,), in (-pi, pi], 0 along the arena's +x; normal noise, new in every tick."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the heading of every robot of the group, not wrapped."""
        return (self.scene.state[:, self.group.start : self.group.stop, 2].copy(),)


class PositioningSensor(BuiltInSensor[PositioningSpec]):
    """Sensor `positioning`: x_m, y_m (n,), in m, arena frame; normal noise, new in every tick.

    An outlier is anywhere in the arena.
    """

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields of the spec, with the arena as the range of outliers."""
        sides_m = zip(self.spec.reading_fields(), self.scene.size_m, strict=True)
        return tuple(replace(field, span=(-0.5 * side_m, 0.5 * side_m)) for field, side_m in sides_m)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the position of every robot of the group."""
        state = self.scene.state[:, self.group.start : self.group.stop]
        return state[:, :, 0].copy(), state[:, :, 1].copy()


class FlowSensor(BuiltInSensor[FlowSpec]):
    """Sensor `flow`: forward_mps, left_mps (n,), the velocity in the body's frame; normal noise, new in every tick."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the velocity of every robot of the group."""
        state = self.scene.state[:, self.group.start : self.group.stop]
        heading, vx, vy = state[:, :, 2], state[:, :, 3], state[:, :, 4]
        cos, sin = portable.cos(heading), portable.sin(heading)
        return cos * vx + sin * vy, cos * vy - sin * vx


class TravelArrays(NamedTuple):
    """The memory of a group's encoders for the kernel, and the arrays of the scene."""

    measured_m: FloatArray  # (arenas, n, wheels) travel with errors, written in place
    counted_m: FloatArray  # (arenas, n, wheels) true travel that `measured_m` contains, written in place
    scale: FloatArray  # (arenas, n, wheels) size of a wheel, 1: nominal
    slip: float
    first: int  # robot index of the group's first robot
    keys: KeyArray  # (arenas,)
    running: BoolArray  # (arenas,)
    travel_m: FloatArray  # (arenas, robots, wheels) true travel


class OdometrySensor(BuiltInSensor[OdometrySpec]):
    """Sensor `odometry`: left_m, right_m (n,), travel since the start, rounded down to whole encoder steps.

    Errors accumulate: slip changes the travel of each tick, the size of a wheel scales all travel. They are part of
    the measured travel, not of a reading.
    """

    def start(self) -> None:
        """Draw the sizes of the wheels."""
        scene, group, spec = self.scene, self.group, self.spec
        travel_m = scene.travel_m[:, group.start : group.stop]
        robots = np.arange(group.start, group.stop)
        drawn = normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(2), WHEEL)
        self._travel = TravelArrays(
            travel_m.copy(),
            travel_m.copy(),
            1.0 + spec.wheel_error_std * drawn,
            spec.slip,
            group.start,
            scene.keys,
            scene.running,
            scene.travel_m,
        )

    def follow(self, tick: int) -> None:
        """Add the travel since the last tick, with its slip; the result does not depend on how often an agent reads."""
        _add_travel(self._travel, tick)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the travel that the encoders of every robot measure."""
        self.follow(tick)
        step_m, measured_m = self.spec.step_m, self._travel.measured_m
        rounded_m = np.floor(measured_m / step_m) * step_m if step_m > 0.0 else measured_m
        return rounded_m[:, :, 0].copy(), rounded_m[:, :, 1].copy()


@njit()
def _add_travel(travel: Any, tick: int):
    """Add the new travel of both wheels: times the wheel's scale, times 1 + slip x a normal draw."""
    for arena in range(travel.measured_m.shape[0]):
        if not travel.running[arena]:
            continue
        for i in range(travel.measured_m.shape[1]):
            robot = travel.first + i
            for wheel in range(2):
                total_m = travel.travel_m[arena, robot, wheel]
                step_m = (total_m - travel.counted_m[arena, i, wheel]) * travel.scale[arena, i, wheel]
                if travel.slip > 0.0:
                    step_m *= 1.0 + travel.slip * normal(travel.keys[arena], robot, tick, wheel, SLIP)
                travel.measured_m[arena, i, wheel] += step_m
                travel.counted_m[arena, i, wheel] = total_m


class GroundSensor(BuiltInSensor[GroundSpec]):
    """Sensor `ground`: shade (n, points), 0 black to 1 white, of the floor under each point. Noise is uniform."""

    def start(self) -> None:
        """Convert the points once."""
        self._points = np.array(self.spec.points_m, np.float64)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the shade under every point of every robot of the group."""
        scene, group = self.scene, self.group
        shade = np.empty((len(scene.keys), group.stop - group.start, len(self._points)))
        _look_down(shade, scene.state, scene.running, group.start, self._points, scene.ground)
        return (shade,)


@kernel(from_python=True)
def _look_down(shade: AnyArray, state: AnyArray, running: AnyArray, start: Any, points: AnyArray, ground: Any):
    """Set shade (arenas, n, points)."""
    for arena in range(shade.shape[0]):
        if not running[arena]:
            continue
        for i in range(shade.shape[1]):
            x, y, heading = state[arena, start + i, 0], state[arena, start + i, 1], state[arena, start + i, 2]
            c, s = math_compiled.cos(heading), math_compiled.sin(heading)
            for k in range(len(points)):
                ahead, left = points[k, 0], points[k, 1]
                shade[arena, i, k] = shade_at(ground, x + c * ahead - s * left, y + s * ahead + c * left)
