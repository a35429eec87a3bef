"""What in a body's sheet contradicts its size, its drive or how high it flies."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.bodies.leds import Leds

if TYPE_CHECKING:
    from swarmwire.comms.bodies.body import Body

MOST_OF_RADIUS = 1.25  # how far from the axis a ring of LEDs may be: that of ARGoS's e-puck stands out by a fifth
MOST_OF_HEIGHT = 2.0  # how high a LED may be: the foot-bot's beacon stands on a pole


def fault_of_body(body: "Body") -> tuple[str, str] | None:
    """The key of the first thing that does not go with the others, and what was expected; None if all do."""
    diameter_m = 2.0 * body.radius_m
    if not isinstance(body.drive, Holonomic) and body.drive.wheel_base_m > diameter_m:
        expected = f"expected at most the body's diameter, {diameter_m:g} m; got {body.drive.wheel_base_m!r}"
        return "drive.wheel_base_m", expected
    if body.leds is not None and (fault := _fault_of_leds(body.leds, body.radius_m, body.height_m)):
        return fault
    unfit = unfit_senses(body.drive.kind, body.altitude_m)
    for name, sheet in body.senses.items():
        if name in unfit:
            return f"senses.{name}", unfit[name]
        if fault := sheet.fault(body.radius_m):
            return f"senses.{name}.{fault[0]}", fault[1]
    return None


def unfit_senses(drive: object, altitude_m: object) -> Mapping[str, str]:
    """The senses that a body with this kind of drive, at this altitude, cannot have, and why."""
    unfit: dict[str, str] = {}
    if drive == "holonomic":
        unfit["odometry"] = "expected a drive with wheels: holonomic has no wheels"
    if isinstance(altitude_m, int | float) and altitude_m > 0:
        unfit["ground"] = f"expected altitude_m = 0: it looks at the floor right below, not from {altitude_m:g} m"
    return unfit


def _fault_of_leds(leds: Leds, radius_m: float, height_m: float) -> tuple[str, str] | None:
    limits: dict[str, tuple[float, float, str]] = {
        "radius_m": (leds.radius_m, MOST_OF_RADIUS * radius_m, f"{MOST_OF_RADIUS:g} times the body's radius"),
        "height_m": (leds.height_m, MOST_OF_HEIGHT * height_m, "twice the body's height"),
        "beacon_height_m": (leds.beacon_height_m, MOST_OF_HEIGHT * height_m, "twice the body's height"),
    }
    for key, (value, most, what) in limits.items():
        if value > most:
            return f"leds.{key}", f"expected at most {most:g} m, {what}; got {value!r}"
    return None
