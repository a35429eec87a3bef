"""Sensors of the robot itself: `battery`, `bumper`, `compass`, `flow`, `odometry`, `positioning`, `ground` below it."""

from dataclasses import dataclass
from math import hypot, pi
from typing import TYPE_CHECKING, ClassVar, Generic, Self

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.sensor import Draw, Field, LazyArray, N, Noise, RangedSensorSpec, SensorSpec


@dataclass(frozen=True)
class BatterySpec(SensorSpec):
    """The battery; a robot whose battery is empty is dead. Readings: charge (n,), 0 to 1, and voltage_v (n,).

    The robot draws `idle_w`, `hover_w` while its motors are on, `drive_w_per_mps` times the mean commanded speed of its
    wheels (of a body without wheels, the commanded speed in the plane), and `led_w` for each lit LED. Only a gateway
    switches motors off, while a robot stands on the floor. The voltage falls linearly with the charge.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.simple:BatterySensor"

    capacity_wh: float = parameter(help="energy of a full battery", unit="Wh", above=0)
    idle_w: float = parameter(0.0, help="power that is always drawn", unit="W", at_least=0)
    hover_w: float = parameter(
        0.0, help="power of motors that keep a flying body up, also at rest", unit="W", at_least=0
    )
    drive_w_per_mps: float = parameter(0.0, help="power drawn for each m/s of the wheels", unit="W s/m", at_least=0)
    led_w: float = parameter(0.0, help="power drawn by an LED that is lit", unit="W", at_least=0)
    start: float = parameter(1.0, help="charge at the start of a run, as a share", at_least=0, at_most=1)
    full_v: float = parameter(4.2, help="voltage when full; default: one lithium cell", unit="V", above=0)
    empty_v: float = parameter(3.4, help="voltage when empty; default: one lithium cell", unit="V", at_least=0)
    noise: float = parameter(0.0, help="standard deviation of the charge's error", at_least=0, at_most=1)
    noise_v: float = parameter(0.0, help="standard deviation of the voltage's error", unit="V", at_least=0)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """Return the expectation for a battery that is emptier at a higher voltage."""
        if self.empty_v > self.full_v:
            return "empty_v", f"expected at most full_v, {self.full_v:g} V; got {self.empty_v!r}"
        return None

    @classmethod
    def example(cls) -> Self:
        """Return a typical battery."""
        return cls(capacity_wh=10.0, idle_w=1.0, noise=0.01, noise_v=0.01)

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields `charge` and `voltage_v`."""
        noise, noise_v = Noise("normal", self.noise), Noise("normal", self.noise_v)
        return (
            Field("charge", 0, noise, self.step, low=0.0, high=1.0, help="1 full, 0 empty"),
            Field("voltage_v", 0, noise_v, low=0.0, unit="V", help="falls linearly with the charge"),
        )

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return a random charge and the voltage that belongs to it."""
        charge = draw(name, 0)
        return charge, 3.4 + 0.8 * charge


@dataclass(frozen=True)
class BatteryReading(Generic[N]):
    """A reading of the battery's gauge."""

    charge: N  #: 1 full, 0 empty; an empty battery stops the motors
    voltage_v: N


@dataclass(frozen=True)
class BumperSpec(SensorSpec):
    """A touch-sensitive rim. Readings: pressed (n,), 1 if the body touched anything in the previous tick, else 0."""

    truth: ClassVar[str] = "swarmwire.world.sensors.simple:BumperSensor"

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the field `pressed`."""
        return (Field("pressed", blank=0.0, help="1 if the body touched anything in the tick before, else 0"),)

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return randomly pressed bumpers."""
        return (np.round(draw(name, 0)),)


@dataclass(frozen=True)
class BumperReading:
    """A reading of one robot's bumper."""

    pressed: bool  #: touched a robot, an obstacle or a wall in the tick before

    @classmethod
    def from_columns(cls, pressed: float) -> "BumperReading":
        """Make the reading from its column."""
        return cls(bool(pressed))


@dataclass(frozen=True)
class BumperReadings:
    """Readings of the bumpers of n robots."""

    pressed: FloatArray  #: (n,) 1 for a robot that touched anything in the tick before, else 0


@dataclass(frozen=True)
class CompassSpec(RangedSensorSpec):
    """The heading in the arena's frame. Readings: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    is_global: ClassVar[bool] = True
    truth: ClassVar[str] = "swarmwire.world.sensors.simple:CompassSensor"

    noise_rad: float = parameter(0.0, help="standard deviation of the error, new in each tick", unit="rad", at_least=0)

    @classmethod
    def example(cls) -> Self:
        """Return a typical compass."""
        return cls(noise_rad=0.1)

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the field `heading_rad`."""
        noise, meaning = Noise("normal", self.noise_rad), "0 along the arena's +x, counter-clockwise"
        return (Field("heading_rad", 0, noise, self.step, angle=True, span=(-pi, pi), unit="rad", help=meaning),)

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random headings."""
        return ((draw(name, 0) * 2.0 - 1.0) * pi,)


@dataclass(frozen=True)
class CompassReading(Generic[N]):
    """A reading of the compass."""

    heading_rad: N  #: 0 along the arena's +x, counter-clockwise, in (-pi, pi]


@dataclass(frozen=True)
class FlowSpec(SensorSpec):
    """Optical flow and height: velocity over the floor in the body's frame. Readings: forward_mps, left_mps (n,)."""

    truth: ClassVar[str] = "swarmwire.world.sensors.simple:FlowSensor"

    noise_mps: float = parameter(
        0.0, help="standard deviation of the error along each axis, new in each tick", unit="m/s", at_least=0
    )

    @classmethod
    def example(cls) -> Self:
        """Return a typical flow sensor."""
        return cls(noise_mps=0.1)

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields `forward_mps` and `left_mps`."""
        noise, step = Noise("normal", self.noise_mps), self.step
        return (
            Field("forward_mps", 0, noise, step, unit="m/s", help="velocity ahead, over the floor"),
            Field("left_mps", 0, noise, step, unit="m/s", help="velocity to the left, over the floor"),
        )

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random velocities from -1 to 1 m/s."""
        return tuple(draw(field.name, 0) * 2.0 - 1.0 for field in self.reading_fields())


@dataclass(frozen=True)
class FlowReading(Generic[N]):
    """Velocity over the floor, in the body's frame."""

    forward_mps: N
    left_mps: N  #: positive to the left


@dataclass(frozen=True)
class GroundSpec(RangedSensorSpec):
    """Ground sensors: the shade of the floor under points of the body. Readings: shade (n, points), 0 black to 1."""

    truth: ClassVar[str] = "swarmwire.world.sensors.simple:GroundSensor"

    points_m: tuple[tuple[float, float], ...] = parameter(
        help="point below each sensor: ahead of the body's centre, and to its left", unit="m"
    )
    noise: float = parameter(0.0, help="half width of the uniform noise", at_least=0, at_most=1)

    @classmethod
    def example(cls) -> Self:
        """Return a typical pair of ground sensors."""
        return cls(points_m=((0.0, 0.01), (0.01, 0.0)), noise=0.1)

    @classmethod
    def unsupported(cls, drive: object, altitude_m: float) -> str | None:
        """Return the reason why a flying body cannot have ground sensors."""
        if altitude_m > 0:
            return f"expected altitude_m = 0: it looks at the floor right below, not from {altitude_m:g} m"
        return None

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """Return the key and the expectation for a point outside the body."""
        for i, (ahead_m, left_m) in enumerate(self.points_m):
            if hypot(ahead_m, left_m) > radius_m:
                expected = f"expected a point under the body, whose radius is {radius_m:g} m; got {[ahead_m, left_m]}"
                return f"points_m[{i}]", expected
        return None

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the field `shade`, with a number per point."""
        noise, meaning = Noise("uniform", self.noise), "floor under each point: 0 black, 1 white"
        return (Field("shade", len(self.points_m), noise, self.step, 0.0, 1.0, help=meaning, per="points"),)

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random shades from 0 to 1."""
        return (draw(name, len(self.points_m)),)


@dataclass(frozen=True)
class GroundReading:
    """A reading of the ground sensors, in the order of the spec."""

    shade: FloatArray  #: (…, points) 0 black to 1 white
    if not TYPE_CHECKING:
        shade = LazyArray()


@dataclass(frozen=True)
class OdometrySpec(SensorSpec):
    """Encoders on the two wheels. Readings: left_m, right_m (n,), travel since the start, in whole encoder steps.

    Each wheel has a constant error (its diameter) and a slip drawn in each tick. The agent computes heading and
    position from the travel.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.simple:OdometrySensor"

    slip: float = parameter(0.0, help="standard deviation of a tick's relative error", at_least=0, at_most=1)
    wheel_error_std: float = parameter(
        0.0, help="standard deviation of each wheel's relative error, drawn once per robot", at_least=0, at_most=1
    )
    step_m: float = parameter(0.0, help="travel per encoder step; 0: not quantised", unit="m", at_least=0)

    @classmethod
    def example(cls) -> Self:
        """Return typical wheel encoders."""
        return cls(slip=0.1, wheel_error_std=0.1, step_m=0.001)

    @classmethod
    def unsupported(cls, drive: object, altitude_m: float) -> str | None:
        """Return the reason why a body without wheels cannot have wheel encoders."""
        return "expected a drive with wheels: holonomic has no wheels" if drive == "holonomic" else None

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields `left_m` and `right_m`."""
        meaning = "travelled by the {} wheel since the start, in whole encoder steps"
        return tuple(
            Field(f"{side}_m", step=self.step, unit="m", help=meaning.format(side)) for side in ("left", "right")
        )

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return travel that grows by 1 cm per tick, with an error."""
        return tuple(tick * 0.01 + draw(side, 0) * 0.01 for side in ("left_m", "right_m"))


@dataclass(frozen=True)
class OdometryReading(Generic[N]):
    """A reading of the wheel encoders."""

    left_m: N  #: travelled by the left wheel since the start
    right_m: N


@dataclass(frozen=True)
class PositioningSpec(RangedSensorSpec):
    """The position in the arena's frame, as a tracking camera measures it. Readings: x_m, y_m (n,)."""

    is_global: ClassVar[bool] = True
    truth: ClassVar[str] = "swarmwire.world.sensors.simple:PositioningSensor"

    noise_m: float = parameter(
        0.0, help="standard deviation of the error along each axis, new in each tick", unit="m", at_least=0
    )

    @classmethod
    def example(cls) -> Self:
        """Return a typical positioning system."""
        return cls(noise_m=0.1)

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields `x_m` and `y_m`."""
        noise = Noise("normal", self.noise_m)
        return tuple(Field(name, 0, noise, self.step, unit="m", help="in the arena's frame") for name in ("x_m", "y_m"))

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random positions within 2 m of the origin along each axis."""
        return tuple(draw(axis, 0) * 4.0 - 2.0 for axis in ("x_m", "y_m"))


@dataclass(frozen=True)
class PositioningReading(Generic[N]):
    """Measured position in the arena's frame."""

    x_m: N
    y_m: N
