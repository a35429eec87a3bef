"""The base classes of sensor specs: the keys that all sensors share, and the stages of a reading."""

from dataclasses import dataclass
from typing import ClassVar

from swarmwire.comms.config import parameter


@dataclass(frozen=True, kw_only=True)
class SensorSpec:
    """The keys that all sensors have; a subclass adds those of one sensor.

    A reading passes through these stages, in this order: the truth, taken at `rate_hz`; noise; outliers; rounding to
    steps; clipping to the range; drop-out. The agent gets it `delay_s` later, and until the next one arrives.
    """

    is_global: ClassVar[bool] = False  # True: it measures more than the robot and its surroundings

    rate_hz: float = parameter(
        0.0, help="new readings per second, taken at ticks; 0: one in each tick", unit="Hz", at_least=0
    )
    delay_s: float = parameter(0.0, help="a reading is shown that much later, in whole ticks", unit="s", at_least=0)
    drop_out: float = parameter(0.0, help="probability that a reading is lost", at_least=0, at_most=1)
    step: float = parameter(
        0.0, help="readings are rounded to whole multiples of it, in their unit; 0: they are not", at_least=0
    )

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """A key whose value contradicts the others or this body radius, and the expectation; None if there is none."""
        return None


@dataclass(frozen=True, kw_only=True)
class RangedSensorSpec(SensorSpec):
    """The spec of a sensor whose readings lie within a known range."""

    outlier: float = parameter(
        0.0, help="probability that a reading is anything within the range instead", at_least=0, at_most=1
    )
