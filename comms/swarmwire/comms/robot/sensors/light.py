"""Photocells around the body: the sensor `light`."""

from dataclasses import dataclass
from typing import ClassVar, Self

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.rays import RadialReading, RadialSpec
from swarmwire.comms.robot.sensors.sensor import Draw, Field, N, Noise


@dataclass(frozen=True)
class LightSpec(RadialSpec):
    """Photocells that respond to the arena's lights. Readings: value (n, sensors), 0 dark to 1."""

    truth: ClassVar[str] = "swarmwire.world.sensors.light:LightSensor"

    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)

    @classmethod
    def example(cls) -> Self:
        """Return a typical set of photocells."""
        return cls(angles_deg=(0.0, 90.0, 200.0), noise=0.1)

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the field `value`, with a number per photocell."""
        noise, width = Noise("uniform", self.noise), len(self.angle_rad)
        meaning = "light on each photocell: 0 dark, also in the shadow of a body or an obstacle"
        return (Field("value", width, noise, self.step, 0.0, 1.0, blank=0.0, help=meaning, per="sensors"),)

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random responses from 0 to 1."""
        return (draw(name, len(self.angles_deg)),)


class LightReading(RadialReading[N, LightSpec]):
    """Responses of the photocells, (…, cells); 0 is dark."""
