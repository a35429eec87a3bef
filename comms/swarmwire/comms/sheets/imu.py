"""The IMU: an accelerometer of two axes and a gyro."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import Sheet


@dataclass(frozen=True)
class Imu(Sheet):
    """Accelerometer and gyro, with white noise, a constant bias of each robot's own, and a bias that drifts.

    Sense: forward_mps2, left_mps2, turn_radps (n,), in the body's frame, means over the tick before.
    """

    noise_mps2: float = parameter(
        0.0, help="standard deviation of the accelerations' noise, new in each reading", unit="m/s²", at_least=0
    )
    bias_std_mps2: float = parameter(
        0.0, help="standard deviation of the accelerations' constant bias, among robots", unit="m/s²", at_least=0
    )
    drift_mps2: float = parameter(
        0.0, help="standard deviation of what the accelerations' bias drifts in 1 s", unit="m/s²", at_least=0
    )
    noise_radps: float = parameter(
        0.0, help="standard deviation of the turn rate's noise, new in each reading", unit="rad/s", at_least=0
    )
    bias_std_radps: float = parameter(
        0.0, help="standard deviation of the turn rate's constant bias, among robots", unit="rad/s", at_least=0
    )
    drift_radps: float = parameter(
        0.0, help="standard deviation of what the turn rate's bias drifts in 1 s", unit="rad/s", at_least=0
    )
