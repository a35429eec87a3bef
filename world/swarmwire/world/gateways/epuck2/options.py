"""What a user may tell the gateway of emulated e-puck2s."""

from dataclasses import dataclass
from math import radians

from swarmwire.comms.config import parameter
from swarmwire.comms.robots.epuck2.readings import CHIPS, Compass


@dataclass(frozen=True)
class Epuck2GatewayOptions:
    """How the robots differ from the firmware's defaults."""

    stream: bool = parameter(
        False, help="answer the last command once more with each new reading, as the WiFi firmware does unasked"
    )
    north_deg: float = parameter(
        0.0, help="heading of magnetic north in the arena", unit="deg", at_least=-360, at_most=360
    )
    magnetometer: str = parameter(CHIPS[0], help="the robots' chip, which says where its axes lie", choices=CHIPS)

    @property
    def compass(self) -> Compass:
        """The magnetometer that these robots have."""
        return Compass(self.magnetometer, radians(self.north_deg))
