"""An accelerometer of two axes and a gyro: the sensor `imu`."""

from dataclasses import dataclass
from typing import ClassVar, Generic, Self

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.sensor import Draw, Field, N, Noise, SensorSpec


@dataclass(frozen=True)
class ImuSpec(SensorSpec):
    """An accelerometer of two axes and a gyro, with white noise, a constant bias per robot, and a drifting bias.

    Readings: forward_mps2, left_mps2, turn_radps (n,), in the body's frame, means over the previous tick.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.imu:ImuSensor"

    noise_mps2: float = parameter(
        0.0, help="standard deviation of the accelerations' noise, new in each reading", unit="m/s²", at_least=0
    )
    bias_std_mps2: float = parameter(
        0.0, help="standard deviation of the accelerations' constant bias, among robots", unit="m/s²", at_least=0
    )
    drift_mps2: float = parameter(
        0.0, help="standard deviation of the drift of the accelerations' bias in 1 s", unit="m/s²", at_least=0
    )
    noise_radps: float = parameter(
        0.0, help="standard deviation of the turn rate's noise, new in each reading", unit="rad/s", at_least=0
    )
    bias_std_radps: float = parameter(
        0.0, help="standard deviation of the turn rate's constant bias, among robots", unit="rad/s", at_least=0
    )
    drift_radps: float = parameter(
        0.0, help="standard deviation of the drift of the turn rate's bias in 1 s", unit="rad/s", at_least=0
    )

    @classmethod
    def example(cls) -> Self:
        """Return a typical IMU."""
        return cls(noise_mps2=0.1, bias_std_mps2=0.1, drift_mps2=0.1, noise_radps=0.1, drift_radps=0.1)

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields `forward_mps2`, `left_mps2` and `turn_radps`."""
        acceleration, turn, step = Noise("normal", self.noise_mps2), Noise("normal", self.noise_radps), self.step
        before = "mean over the tick before"
        return (
            Field("forward_mps2", 0, acceleration, step, unit="m/s²", help=f"acceleration ahead, {before}"),
            Field("left_mps2", 0, acceleration, step, unit="m/s²", help=f"acceleration to the left, {before}"),
            Field("turn_radps", 0, turn, step, unit="rad/s", help=f"turn rate, {before}, positive to the left"),
        )

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random readings from -1 to 1."""
        return tuple(draw(field.name, 0) * 2.0 - 1.0 for field in self.reading_fields())


@dataclass(frozen=True)
class ImuReading(Generic[N]):
    """Acceleration and turn rate in the body's frame: means over the previous tick."""

    forward_mps2: N  #: acceleration ahead
    left_mps2: N  #: acceleration to the left: in a left turn it is positive
    turn_radps: N  #: turn rate, positive to the left
