"""The figures of a body's data sheet in words, with round units that people use for robots of its size."""

import math

from swarmwire.comms.body import Body
from swarmwire.comms.drives import Holonomic, Twist, Wheels
from swarmwire.comms.sheets import Battery, Bumper, Compass, Imu, Light, Odometry, Positioning, Proximity, Sheet


def facts_of(body: Body) -> list[tuple[str, str]]:
    """Name and value of each; a fact without a name goes on with the one above."""
    drive = body.drive
    facts = [
        ("size", f"{_length(2.0 * body.radius_m)} across, {_length(body.height_m)} high"),
        ("mass", f"{body.mass_kg:g} kg"),
        ("wheels", "none: it moves in every direction" if isinstance(drive, Holonomic) else _apart(drive)),
        ("top speed", f"{body.max_linear_mps:.3g} m/s"),
        ("turns", f"{math.degrees(body.max_angular_radps):.0f} degrees/s"),
        ("drive", f"{drive.max_force_n:g} N, {drive.max_torque_nm:g} N m"),
    ]
    if body.leds:
        facts.append(("LEDs", f"{body.led_count}{', the last a beacon' if body.leds.beacon_height_m else ''}"))
    for name, sheet in body.senses.items():
        facts.extend(zip((name, *[""] * 9), _told(sheet), strict=False))
    return facts


def _told(sheet: Sheet) -> list[str]:
    match sheet:
        case Proximity():
            return [f"{len(sheet.angles_deg)} rays of {_length(sheet.range_m)}", *_noise(sheet.noise)]
        case Light():
            return [f"{len(sheet.angles_deg)} photocells", *_noise(sheet.noise)]
        case Compass():
            return [f"error {math.degrees(sheet.noise_rad):.2g} degrees"]
        case Odometry():
            step = f", step {sheet.step_m * 1000:.2g} mm" if sheet.step_m else ""
            return [f"slip {100 * sheet.slip:.2g} %{step}"]
        case Positioning():
            return [f"error {_length(sheet.noise_m)}"]
        case Bumper():
            return ["the whole rim"]
        case Imu():
            return [f"noise {sheet.noise_mps2:.2g} m/s², {math.degrees(sheet.noise_radps):.2g} degrees/s"]
        case Battery():
            return [f"{sheet.capacity_wh:g} Wh, {sheet.full_v:g} V"]
        case _:
            return ["yes"]


def _apart(drive: Wheels | Twist) -> str:
    return f"{_length(drive.wheel_base_m)} apart"


def _noise(half_width: float) -> list[str]:
    return [f"noise ±{half_width:g} of 1"] if half_width else []


def _length(metres: float) -> str:
    return f"{100.0 * metres:.3g} cm" if metres < 1.0 else f"{metres:.3g} m"
