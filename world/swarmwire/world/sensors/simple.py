"""The battery's gauge: its charge, and a voltage that falls evenly with it."""

# pyright: basic, reportUnknownMemberType=false

from math import pi

import numpy as np
from numba import njit

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
from swarmwire.comms.kernels import kernel
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Field, Noise, Scene


class BatterySensor:
    """Sense `battery`: charge (n,), 1 full to 0 empty, and voltage_v (n,)."""

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


# --- The bumper: whether the body touched anything in the tick before.


class BumperSensor:
    """Sense `bumper`: pressed (n,), 1 if the body touched a robot, an obstacle or a wall in the tick before, else 0."""

    def __init__(self, scene: Scene, group: Group, spec: BumperSpec) -> None:
        self._scene, self._group = scene, group
        self.fields = (Field("pressed", blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Which robots of the group touched anything."""
        return (self._scene.touched[:, self._group.start : self._group.stop].copy(),)


# --- The compass: heading in the arena's frame, with a normal error that is new in every tick.


class CompassSensor:
    """Sense `compass`: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    def __init__(self, scene: Scene, group: Group, spec: CompassSpec) -> None:
        self._scene, self._group = scene, group
        noise = Noise("normal", spec.noise_rad)
        self.fields = (Field("heading_rad", noise=noise, step=spec.step, angle=True, span=(-pi, pi)),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The heading of every robot of the group, with the full turns that it has made."""
        return (self._scene.state[:, self._group.start : self._group.stop, 2].copy(),)


# --- Positioning: where a robot is in the arena's frame, with a normal error that is new in every tick.


class PositioningSensor:
    """Sense `positioning`: x_m, y_m (n,), in m, arena frame. An outlier is anywhere in the arena."""

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


# --- Wheel encoders: travel since the start, with errors that add up, in whole steps.


SLIP, WHEEL = purpose("odometry slip"), purpose("odometry wheel")


class OdometrySensor:
    """Sense `odometry`: left_m, right_m (n,), travel since the start, rounded down to whole encoder steps.

    Errors belong to the travel, each tick's slip and each wheel's size, so they are part of what is counted, not of a
    reading.
    """

    def __init__(self, scene: Scene, group: Group, spec: OdometrySpec) -> None:
        self._scene, self._group, self._spec = scene, group, spec
        self.fields = (Field("left_m", step=spec.step), Field("right_m", step=spec.step))
        self._rolled_m = scene.travel_m[:, group.start : group.stop].copy()
        self._told_m = self._rolled_m.copy()
        robots = np.arange(group.start, group.stop)
        drawn = normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(2), WHEEL)
        self._scale = 1.0 + spec.wheel_error_std * drawn  # (arenas, n, wheels)

    def follow(self, tick: int) -> None:
        """Add the travel since the last tick, with a slip of its own: how often an agent looks changes nothing."""
        scene, start = self._scene, self._group.start
        of, arenas = (self._told_m, self._rolled_m, scene.travel_m), (scene.keys, scene.running)
        _add_travel(*of, start, self._scale, *arenas, tick, self._spec.slip)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The travel that the encoders of every robot show."""
        self.follow(tick)
        step_m = self._spec.step_m
        shown = np.floor(self._told_m / step_m) * step_m if step_m > 0.0 else self._told_m
        return shown[:, :, 0].copy(), shown[:, :, 1].copy()


@njit(cache=True)
def _add_travel(told, rolled, travel, start, scale, keys, running, tick, slip):
    """Add the new travel of both wheels to what was told: times the wheel's scale, times 1 + slip x a normal draw."""
    for arena in range(told.shape[0]):
        if not running[arena]:
            continue
        for i in range(told.shape[1]):
            for wheel in range(2):
                now = travel[arena, start + i, wheel]
                new = (now - rolled[arena, i, wheel]) * scale[arena, i, wheel]
                if slip > 0.0:
                    new *= 1.0 + slip * normal(keys[arena], start + i, tick, wheel, SLIP)
                told[arena, i, wheel] += new
                rolled[arena, i, wheel] = now


# --- Ground colour: the shade of the floor at points of the body's frame. Compiled.


class GroundSensor:
    """Sense `ground`: shade (n, points), 0 black to 1 white, of the floor under each point. Noise is uniform."""

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
