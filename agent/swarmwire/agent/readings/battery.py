"""Readings of the battery."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class BatteryReading:
    """One robot's battery."""

    charge: float  # 1 full, 0 empty: the motors stop
    voltage_v: float


@dataclass(frozen=True)
class BatteryReadings:
    """The batteries of n robots."""

    charge: FloatArray  # (n,)
    voltage_v: FloatArray  # (n,)
