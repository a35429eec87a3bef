"""Which bodies an e-puck2 can be."""

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Wheels
from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.epuck2.leds import COUNT
from swarmwire.comms.sheets import GroundColour, Light, Proximity, Scan

# Senses of a body that an e-puck2 can tell.
SENSES = frozenset({"proximity", "scan", "ground", "light", "odometry", "imu", "compass", "battery"})


def check_fits(body: Body) -> None:
    """BadInput if the sheet is not one of an e-puck2: two wheels, and as many sensors and LEDs of a kind as it has."""
    senses = body.senses
    proximity, light, scan, ground = (senses.get(name) for name in ("proximity", "light", "scan", "ground"))
    _check(body, "drive.kind", isinstance(body.drive, Wheels), "wheels")
    if isinstance(proximity, Proximity):
        _check(body, "senses.proximity.angles_deg", len(proximity.angles_deg) == 8, "8 angles")
    if isinstance(light, Light):
        _check(body, "senses.light.angles_deg", len(light.angles_deg) == 8, "8 angles")
    if isinstance(scan, Scan):
        _check(body, "senses.scan.rays", scan.rays == 1, "1 ray")
    if isinstance(ground, GroundColour):
        _check(body, "senses.ground.points_m", len(ground.points_m) == 3, "3 points")
    _check(body, "leds", body.led_count in {0, COUNT}, f"{COUNT} LEDs")


def _check(body: Body, key: str, fits: bool, expected: str) -> None:
    if not fits:
        raise BadInput(f"body {body.name}", key, f"expected {expected}, as an e-puck2 has")
