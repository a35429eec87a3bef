"""Readings of passive infrared."""

from functools import cached_property

from swarmwire.agent.readings.around import Around, AroundMany, AroundOne
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sheets import Infrared


class _Shining(Around[Infrared]):
    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal sensor answers `value`; the reach if no robot is seen, (…, rays)."""
        return self.sheet.response.distance_m(self.value)


class InfraredReading(_Shining, AroundOne[Infrared]):
    """One robot's rays, (rays,) each: value is 0 for no robot, 1 for touching one."""


class InfraredReadings(_Shining, AroundMany[Infrared]):
    """The rays of n robots, (n, rays) each but the angles."""
