"""Readings of the proximity sensor."""

from functools import cached_property

from swarmwire.agent.readings.around import Around, AroundMany, AroundOne
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sheets import Proximity


class _Near(Around[Proximity]):
    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal sensor answers `value`; the reach if nothing is seen, (…, rays)."""
        return self.sheet.response.distance_m(self.value)


class ProximityReading(_Near, AroundOne[Proximity]):
    """One robot's rays, (rays,) each: value is 0 for nothing, 1 for touching."""


class ProximityReadings(_Near, AroundMany[Proximity]):
    """The rays of n robots, (n, rays) each but the angles."""
