"""Specs of the sensors that measure the robot itself, the floor under it, and the LEDs around it.

Each spec's docstring names the fields of its readings, with shapes for n robots.
"""

from dataclasses import dataclass
from math import hypot, radians, tan
from typing import ClassVar

from swarmwire.comms.bodies.spec import RangedSensorSpec, SensorSpec
from swarmwire.comms.config import parameter


@dataclass(frozen=True)
class BatterySpec(SensorSpec):
    """The battery; a robot whose battery is empty is dead. Readings: charge (n,), 0 to 1, and voltage_v (n,).

    The robot draws `idle_w`, `drive_w_per_mps` times the mean commanded speed of its wheels (of a body without wheels,
    the commanded speed in the plane), and `led_w` for each lit LED. The voltage falls linearly with the charge.
    """

    capacity_wh: float = parameter(help="energy of a full battery", unit="Wh", above=0)
    idle_w: float = parameter(0.0, help="power that is always drawn", unit="W", at_least=0)
    drive_w_per_mps: float = parameter(0.0, help="power drawn for each m/s of the wheels", unit="W s/m", at_least=0)
    led_w: float = parameter(0.0, help="power drawn by an LED that is lit", unit="W", at_least=0)
    start: float = parameter(1.0, help="charge at the start of a run, as a share", at_least=0, at_most=1)
    full_v: float = parameter(4.2, help="voltage when full; of one lithium cell, if left out", unit="V", above=0)
    empty_v: float = parameter(3.4, help="voltage when empty; of one lithium cell, if left out", unit="V", at_least=0)
    noise: float = parameter(0.0, help="standard deviation of the charge's error", at_least=0, at_most=1)
    noise_v: float = parameter(0.0, help="standard deviation of the voltage's error", unit="V", at_least=0)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `SensorSpec.fault`."""
        if self.empty_v > self.full_v:
            return "empty_v", f"expected at most full_v, {self.full_v:g} V; got {self.empty_v!r}"
        return None


@dataclass(frozen=True)
class BumperSpec(SensorSpec):
    """A touch-sensitive rim. Readings: pressed (n,), 1 if the body touched anything in the previous tick, else 0."""


@dataclass(frozen=True)
class CameraSpec(SensorSpec):
    """An omnidirectional camera: a mirror above the body shows the lit LEDs of other robots, the nearest first.

    Readings: distance_m, bearing_rad, colour (n, most_blobs), nan after the last blob.
    """

    height_m: float = parameter(help="height of the mirror above the body's lower side", unit="m", above=0)
    aperture_deg: float = parameter(
        help="angle between straight down and the farthest that it sees", unit="deg", above=0, below=90
    )
    most_blobs: int = parameter(
        32, help="largest number of blobs in a reading: the nearest ones", at_least=1, at_most=1000
    )
    noise_relative: float = parameter(
        0.0, help="standard deviation of the error of a distance, as a share of it", at_least=0, at_most=1
    )

    def reach_m(self, altitude_m: float) -> float:
        """Radius in m of the visible floor, for a body at this altitude."""
        return (altitude_m + self.height_m) * tan(radians(self.aperture_deg))


@dataclass(frozen=True)
class CompassSpec(RangedSensorSpec):
    """The heading in the arena's frame. Readings: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    is_global: ClassVar[bool] = True

    noise_rad: float = parameter(0.0, help="standard deviation of the error, new in each tick", unit="rad", at_least=0)


@dataclass(frozen=True)
class GroundSpec(RangedSensorSpec):
    """Ground sensors: the shade of the floor under points of the body. Readings: shade (n, points), 0 black to 1."""

    points_m: tuple[tuple[float, float], ...] = parameter(
        help="where each sensor looks: ahead of the body's centre, and to its left", unit="m"
    )
    noise: float = parameter(0.0, help="half width of the uniform noise", at_least=0, at_most=1)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `SensorSpec.fault`."""
        for i, (ahead_m, left_m) in enumerate(self.points_m):
            if hypot(ahead_m, left_m) > radius_m:
                expected = f"expected a point under the body, whose radius is {radius_m:g} m; got {[ahead_m, left_m]}"
                return f"points_m[{i}]", expected
        return None


@dataclass(frozen=True)
class ImuSpec(SensorSpec):
    """An accelerometer of two axes and a gyro, with white noise, a constant bias per robot, and a drifting bias.

    Readings: forward_mps2, left_mps2, turn_radps (n,), in the body's frame, means over the previous tick.
    """

    noise_mps2: float = parameter(
        0.0, help="standard deviation of the accelerations' noise, new in each reading", unit="m/s²", at_least=0
    )
    bias_std_mps2: float = parameter(
        0.0, help="standard deviation of the accelerations' constant bias, among robots", unit="m/s²", at_least=0
    )
    drift_mps2: float = parameter(
        0.0, help="standard deviation of what the accelerations' bias drifts in 1 s", unit="m/s²", at_least=0
    )
    noise_radps: float = parameter(
        0.0, help="standard deviation of the turn rate's noise, new in each reading", unit="rad/s", at_least=0
    )
    bias_std_radps: float = parameter(
        0.0, help="standard deviation of the turn rate's constant bias, among robots", unit="rad/s", at_least=0
    )
    drift_radps: float = parameter(
        0.0, help="standard deviation of what the turn rate's bias drifts in 1 s", unit="rad/s", at_least=0
    )


@dataclass(frozen=True)
class OdometrySpec(SensorSpec):
    """Encoders on the two wheels. Readings: left_m, right_m (n,), travel since the start, in whole encoder steps.

    Each wheel has a constant error (its diameter) and a slip drawn in each tick. The agent computes heading and
    position from the travel.
    """

    slip: float = parameter(0.0, help="standard deviation of a tick's relative error", at_least=0, at_most=1)
    wheel_error_std: float = parameter(
        0.0, help="standard deviation of each wheel's relative error, drawn once per robot", at_least=0, at_most=1
    )
    step_m: float = parameter(0.0, help="travel per encoder step; 0: not quantised", unit="m", at_least=0)


@dataclass(frozen=True)
class PositioningSpec(RangedSensorSpec):
    """The position in the arena's frame, as a tracking camera measures it. Readings: x_m, y_m (n,)."""

    is_global: ClassVar[bool] = True

    noise_m: float = parameter(
        0.0, help="standard deviation of the error along each axis, new in each tick", unit="m", at_least=0
    )
