"""What a user may tell the driver of an e-puck2."""

from dataclasses import dataclass
from math import radians

from swarmwire.comms.config import parameter
from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.epuck2.readings import CHIPS, GROUND_BLACK, GROUND_WHITE, Calibration, Compass


@dataclass(frozen=True)
class Epuck2Options:
    """Time-outs, and what is to be known of one robot."""

    calibrate: bool = parameter(
        False, help="have the robot calibrate its proximity sensors at the start: nothing may be near it then"
    )
    north_deg: float | None = parameter(
        None,
        help="heading of magnetic north in the arena, counter-clockwise from its +x; without it there is no compass",
        unit="deg",
        at_least=-360,
        at_most=360,
    )
    magnetometer: str = parameter(CHIPS[0], help="the robot's chip; the second in robots from 2025 on", choices=CHIPS)
    offset_x_ut: float = parameter(
        0.0, help="middle of what the magnetometer's x reads in a full turn of the robot", unit="uT"
    )
    offset_y_ut: float = parameter(0.0, help="the same of its y", unit="uT")
    turn_offset_radps: float = parameter(0.0, help="what the gyro tells of a robot at rest", unit="rad/s")
    ground_black: float = parameter(GROUND_BLACK, help="what the ground sensors tell on black")
    ground_white: float = parameter(GROUND_WHITE, help="what they tell on white")
    connect_s: float = parameter(3.0, help="the robot must take a connection and answer within", unit="s", above=0)
    answer_s: float = parameter(
        0.1, help="wait for a new reading at most; then the one before is told once more", unit="s", above=0
    )
    silent_s: float = parameter(1.0, help="a robot that is silent for longer is lost", unit="s", above=0)

    def check(self) -> None:
        """BadInput if two of these do not go together."""
        if self.ground_white <= self.ground_black:
            expected = f"expected more than ground_black, {self.ground_black:g}; got {self.ground_white:g}"
            raise BadInput("driver epuck2", "ground_white", expected)

    @property
    def calibration(self) -> Calibration:
        """What of these its readings depend on."""
        compass = Compass(self.magnetometer, radians(self.north_deg or 0.0), self.offset_x_ut, self.offset_y_ut)
        return Calibration(compass, self.turn_offset_radps, self.ground_black, self.ground_white)
