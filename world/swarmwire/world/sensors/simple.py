"""Sensors that read the robot's own state: battery, bumper, compass, positioning, flow, odometry and ground colour."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import normal as normals
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.geometry.ground import shade_at
from swarmwire.comms.base.kernels import kernel, njit
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
        """Charge and voltage of every robot of the group."""
        charge = self.scene.charge[:, self.group.start : self.group.stop].copy()
        empty_v = self.spec.empty_v
        return charge, empty_v + charge * (self.spec.full_v - empty_v)


class BumperSensor(BuiltInSensor[BumperSpec]):
    """Sensor `bumper`: pressed (n,), 1 if the body touched anything in the tick before, else 0."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The contact flag of every robot of the group."""
        return (self.scene.touched[:, self.group.start : self.group.stop].copy(),)


class CompassSensor(BuiltInSensor[CompassSpec]):
    """Sensor `compass`: heading_rad (n,), in (-pi, pi], 0 along the arena's +x; normal noise, new in every tick."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The heading of every robot of the group, not wrapped."""
        return (self.scene.state[:, self.group.start : self.group.stop, 2].copy(),)


class PositioningSensor(BuiltInSensor[PositioningSpec]):
    """Sensor `positioning`: x_m, y_m (n,), in m, arena frame; normal noise, new in every tick.

    An outlier is anywhere in the arena.
    """

    @property
    def fields(self) -> tuple[Field, ...]:
        """As the spec declares them, with the arena as the range of outliers."""
        sides_m = zip(self.spec.reading_fields(), self.scene.size_m, strict=True)
        return tuple(replace(field, span=(-0.5 * side_m, 0.5 * side_m)) for field, side_m in sides_m)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The position of every robot of the group."""
        state = self.scene.state[:, self.group.start : self.group.stop]
        return state[:, :, 0].copy(), state[:, :, 1].copy()


class FlowSensor(BuiltInSensor[FlowSpec]):
    """Sensor `flow`: forward_mps, left_mps (n,), the velocity in the body's frame; normal noise, new in every tick."""

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The velocity of every robot of the group."""
        state = self.scene.state[:, self.group.start : self.group.stop]
        heading, vx, vy = state[:, :, 2], state[:, :, 3], state[:, :, 4]
        cos, sin = np.cos(heading), np.sin(heading)
        return cos * vx + sin * vy, cos * vy - sin * vx


class OdometrySensor(BuiltInSensor[OdometrySpec]):
    """Sensor `odometry`: left_m, right_m (n,), travel since the start, rounded down to whole encoder steps.

    Errors add up: slip changes the travel of each tick, the size of a wheel changes all of it. They are part of the
    measured travel, not of a reading.
    """

    def start(self) -> None:
        """Draw the sizes of the wheels."""
        scene, group, spec = self.scene, self.group, self.spec
        self._counted_m = scene.travel_m[:, group.start : group.stop].copy()
        self._measured_m = self._counted_m.copy()
        robots = np.arange(group.start, group.stop)
        drawn = normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(2), WHEEL)
        self._scale = 1.0 + spec.wheel_error_std * drawn  # (arenas, n, wheels)

    def follow(self, tick: int) -> None:
        """Add the travel since the last tick, with its slip; the result does not depend on how often an agent reads."""
        scene, start = self.scene, self.group.start
        travel, arena_state = (self._measured_m, self._counted_m, scene.travel_m), (scene.keys, scene.running)
        _add_travel(*travel, start, self._scale, *arena_state, tick, self.spec.slip)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The travel that the encoders of every robot measure."""
        self.follow(tick)
        step_m = self.spec.step_m
        shown = np.floor(self._measured_m / step_m) * step_m if step_m > 0.0 else self._measured_m
        return shown[:, :, 0].copy(), shown[:, :, 1].copy()


@njit()
def _add_travel(measured, counted, travel, start, scale, keys, running, tick, slip):
    """Add the new travel of both wheels to `measured`: times the wheel's scale, times 1 + slip x a normal draw."""
    for arena in range(measured.shape[0]):
        if not running[arena]:
            continue
        for i in range(measured.shape[1]):
            for wheel in range(2):
                total = travel[arena, start + i, wheel]
                step_travel = (total - counted[arena, i, wheel]) * scale[arena, i, wheel]
                if slip > 0.0:
                    step_travel *= 1.0 + slip * normal(keys[arena], start + i, tick, wheel, SLIP)
                measured[arena, i, wheel] += step_travel
                counted[arena, i, wheel] = total


class GroundSensor(BuiltInSensor[GroundSpec]):
    """Sensor `ground`: shade (n, points), 0 black to 1 white, of the floor under each point. Noise is uniform."""

    def start(self) -> None:
        """Convert the points once."""
        self._points = np.array(self.spec.points_m, np.float64)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The shade under every point of every robot of the group."""
        scene, group = self.scene, self.group
        shade = np.empty((len(scene.keys), group.stop - group.start, len(self._points)))
        _look_down(shade, scene.state, scene.running, group.start, self._points, scene.ground)
        return (shade,)


@kernel(from_python=True)
def _look_down(shade, state, running, start, points, ground):
    """Set shade (arenas, n, points)."""
    for arena in range(shade.shape[0]):
        if not running[arena]:
            continue
        for i in range(shade.shape[1]):
            x, y, heading = state[arena, start + i, 0], state[arena, start + i, 1], state[arena, start + i, 2]
            c, s = np.cos(heading), np.sin(heading)
            for k in range(len(points)):
                ahead, left = points[k, 0], points[k, 1]
                shade[arena, i, k] = shade_at(ground, x + c * ahead - s * left, y + s * ahead + c * left)
