"""Sensors that read the robot's own state: battery, bumper, compass, positioning, odometry and ground colour."""

# pyright: basic, reportUnknownMemberType=false

from math import pi

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensor_specs import (
    BatterySpec,
    BumperSpec,
    CompassSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)
from swarmwire.comms.draws import normal as normals
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.geometry.ground import shade_at
from swarmwire.comms.kernels import kernel, njit
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Field, Noise, Scene

SLIP, WHEEL = purpose("odometry slip"), purpose("odometry wheel")


class BatterySensor:
    """Sensor `battery`: charge (n,), 1 full to 0 empty, and voltage_v (n,), which falls linearly with the charge."""

    def __init__(self, scene: Scene, group: Group, spec: BatterySpec) -> None:
        self._scene, self._group, self._spec = scene, group, spec
        self.fields = (
            Field("charge", noise=Noise("normal", spec.noise), step=spec.step, low=0.0, high=1.0),
            Field("voltage_v", noise=Noise("normal", spec.noise_v), low=0.0),
        )

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Charge and voltage of every robot of the group."""
        charge = self._scene.charge[:, self._group.start : self._group.stop].copy()
        empty_v = self._spec.empty_v
        return charge, empty_v + charge * (self._spec.full_v - empty_v)


class BumperSensor:
    """Sensor `bumper`: pressed (n,), 1 if the body touched anything in the tick before, else 0."""

    def __init__(self, scene: Scene, group: Group, spec: BumperSpec) -> None:
        self._scene, self._group = scene, group
        self.fields = (Field("pressed", blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The contact flag of every robot of the group."""
        return (self._scene.touched[:, self._group.start : self._group.stop].copy(),)


class CompassSensor:
    """Sensor `compass`: heading_rad (n,), in (-pi, pi], 0 along the arena's +x; normal noise, new in every tick."""

    def __init__(self, scene: Scene, group: Group, spec: CompassSpec) -> None:
        self._scene, self._group = scene, group
        noise = Noise("normal", spec.noise_rad)
        self.fields = (Field("heading_rad", noise=noise, step=spec.step, angle=True, span=(-pi, pi)),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The heading of every robot of the group, not wrapped."""
        return (self._scene.state[:, self._group.start : self._group.stop, 2].copy(),)


class PositioningSensor:
    """Sensor `positioning`: x_m, y_m (n,), in m, arena frame; normal noise, new in every tick.

    An outlier is anywhere in the arena.
    """

    def __init__(self, scene: Scene, group: Group, spec: PositioningSpec) -> None:
        self._scene, self._group = scene, group
        noise = Noise("normal", spec.noise_m)
        self.fields = tuple(
            Field(name, noise=noise, step=spec.step, span=(-0.5 * side_m, 0.5 * side_m))
            for name, side_m in zip(("x_m", "y_m"), scene.size_m, strict=True)
        )

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The position of every robot of the group."""
        state = self._scene.state[:, self._group.start : self._group.stop]
        return state[:, :, 0].copy(), state[:, :, 1].copy()


class OdometrySensor:
    """Sensor `odometry`: left_m, right_m (n,), travel since the start, rounded down to whole encoder steps.

    Errors add up: slip changes the travel of each tick, the size of a wheel changes all of it. They are part of the
    measured travel, not of a reading.
    """

    def __init__(self, scene: Scene, group: Group, spec: OdometrySpec) -> None:
        self._scene, self._group, self._spec = scene, group, spec
        self.fields = (Field("left_m", step=spec.step), Field("right_m", step=spec.step))
        self._counted_m = scene.travel_m[:, group.start : group.stop].copy()
        self._measured_m = self._counted_m.copy()
        robots = np.arange(group.start, group.stop)
        drawn = normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(2), WHEEL)
        self._scale = 1.0 + spec.wheel_error_std * drawn  # (arenas, n, wheels)

    def follow(self, tick: int) -> None:
        """Add the travel since the last tick, with its slip; the result does not depend on how often an agent reads."""
        scene, start = self._scene, self._group.start
        travel, arena_state = (self._measured_m, self._counted_m, scene.travel_m), (scene.keys, scene.running)
        _add_travel(*travel, start, self._scale, *arena_state, tick, self._spec.slip)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The travel that the encoders of every robot measure."""
        self.follow(tick)
        step_m = self._spec.step_m
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


class GroundSensor:
    """Sensor `ground`: shade (n, points), 0 black to 1 white, of the floor under each point. Noise is uniform."""

    def __init__(self, scene: Scene, group: Group, spec: GroundSpec) -> None:
        self._scene, self._group = scene, group
        self._points = np.array(spec.points_m, np.float64)
        noise = Noise("uniform", spec.noise)
        self.fields = (Field("shade", len(self._points), noise, spec.step, low=0.0, high=1.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The shade under every point of every robot of the group."""
        scene, group = self._scene, self._group
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
