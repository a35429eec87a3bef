"""The reading of the battery."""

from dataclasses import dataclass
from typing import Generic

from swarmwire.agent.readings.number import N


@dataclass(frozen=True)
class BatteryReading(Generic[N]):
    """The battery's gauge."""

    charge: N  # 1 full, 0 empty: the motors stop
    voltage_v: N
