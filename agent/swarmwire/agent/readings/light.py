"""Readings of the photocells."""

from swarmwire.agent.readings.around import AroundMany, AroundOne
from swarmwire.comms.sheets import Light


class LightReading(AroundOne[Light]):
    """One robot's photocells, (cells,) each: value is 0 for dark."""


class LightReadings(AroundMany[Light]):
    """The photocells of n robots, (n, cells) each but the angles."""
