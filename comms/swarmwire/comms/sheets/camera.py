"""An omnidirectional camera: a mirror above the body that shows the LEDs of other robots around it."""

from dataclasses import dataclass
from math import radians, tan

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import Sheet


@dataclass(frozen=True)
class Camera(Sheet):
    """A camera that looks down all around and tells the blobs of light that it sees, the nearest first.

    Sense: distance_m, bearing_rad, colour (n, most_blobs), nan where there is no further blob.
    """

    height_m: float = parameter(help="height of the mirror above the body's lower side", unit="m", above=0)
    aperture_deg: float = parameter(
        help="angle between straight down and the farthest that it sees", unit="deg", above=0, below=90
    )
    most_blobs: int = parameter(32, help="blobs told at most: the nearest ones", at_least=1, at_most=1000)
    noise_relative: float = parameter(
        0.0, help="standard deviation of the error of a distance, as a share of it", at_least=0, at_most=1
    )

    def reach_m(self, altitude_m: float) -> float:
        """How far it sees on the floor from a body that hovers so high."""
        return (altitude_m + self.height_m) * tan(radians(self.aperture_deg))
