"""The reading of the ground sensors."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class GroundReading:
    """The floor under the sensors, in the data sheet's order."""

    shade: FloatArray  # (…, points) 0 black to 1 white
