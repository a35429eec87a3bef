"""The figures of a body's data sheet in words, with round units that people use for robots of its size."""

import math

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.custom import CustomSensorSpec
from swarmwire.comms.bodies.drives import Holonomic, Twist, Wheels
from swarmwire.comms.sensors.camera import CameraSpec
from swarmwire.comms.sensors.imu import ImuSpec
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import RayArraySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.sensors.sensor import SensorSpec
from swarmwire.comms.sensors.simple import (
    BatterySpec,
    BumperSpec,
    CompassSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)


def facts_of(body: Body) -> list[tuple[str, str]]:
    """Name and value of each; a fact without a name goes on with the one above."""
    drive = body.drive
    facts = [
        ("size", f"{_length(2.0 * body.radius_m)} across, {_length(body.height_m)} high"),
        ("mass", f"{body.mass_kg:g} kg"),
        ("wheels", "none, it is holonomic" if isinstance(drive, Holonomic) else _apart(drive)),
        ("top speed", f"{body.max_linear_mps:.3g} m/s"),
        ("turns", f"{math.degrees(body.max_angular_radps):.0f} degrees/s"),
        ("drive", f"{drive.max_force_n:g} N, {drive.max_torque_nm:g} N m"),
    ]
    if body.altitude_m:
        facts.append(("flies", f"{_length(body.altitude_m)} up"))
    if body.leds:
        facts.append(("LEDs", f"{body.led_count}{', the last a beacon' if body.leds.beacon_height_m else ''}"))
    for name, sheet in body.sensors.items():
        facts.extend(zip((name, *[""] * 9), _told(sheet, body.altitude_m), strict=False))
    facts.extend((name, _own(sheet.kind)) for name, sheet in body.actuators.items())
    return facts


def _told(sheet: SensorSpec, altitude_m: float) -> list[str]:
    match sheet:
        case RayArraySpec():
            return [f"{len(sheet.angles_deg)} rays of {_length(sheet.range_m)}", *_noise(sheet.noise)]
        case ScanSpec():
            return [
                f"{_count(sheet.rays, 'ray')} of {_length(sheet.range_m)}",
                _error(_length(sheet.noise_m), sheet.noise_m),
            ]
        case GroundSpec():
            return [f"{len(sheet.points_m)} points under the body", *_noise(sheet.noise)]
        case CameraSpec():
            return [f"LEDs within {_length(sheet.reach_m(altitude_m))}"]
        case LightSpec():
            return [_count(len(sheet.angles_deg), "photocell"), *_noise(sheet.noise)]
        case CompassSpec():
            return [_error(f"{math.degrees(sheet.noise_rad):.2g} degrees", sheet.noise_rad)]
        case OdometrySpec():
            step = f", step {sheet.step_m * 1000:.2g} mm" if sheet.step_m else ""
            return [f"slip {100 * sheet.slip:.2g} %{step}"]
        case PositioningSpec():
            return [_error(_length(sheet.noise_m), sheet.noise_m)]
        case BumperSpec():
            return ["the whole rim"]
        case ImuSpec():
            return [f"noise {sheet.noise_mps2:.2g} m/s²", f"{math.degrees(sheet.noise_radps):.2g} degrees/s"]
        case BatterySpec():
            return [f"{sheet.capacity_wh:g} Wh, {sheet.full_v:g} V"]
        case CustomSensorSpec():
            return [_own(sheet.kind)]
        case _:
            return ["yes"]


def _own(kind: str) -> str:
    """A class of the user's own, without the folders of its file."""
    return f"by {kind.rpartition('/')[2]}"


def _apart(drive: Wheels | Twist) -> str:
    return f"{_length(drive.wheel_base_m)} apart"


def _noise(half_width: float) -> list[str]:
    return [f"noise ±{half_width:g} of 1"] if half_width else []


def _error(told: str, size: float) -> str:
    return f"error {told}" if size else "no error"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _length(metres: float) -> str:
    return f"{100.0 * metres:.3g} cm" if metres < 1.0 else f"{metres:.3g} m"
