"""Disruption: receivers that are dead, radios that are off, and robots that a partition keeps apart."""

import numpy as np

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.fates import Fate


class Disrupted(Stage):
    """Ends links by the disruption that holds. They were in range: that asks for path loss and walls alone."""

    name = "disrupted"
    keys = ()  # events bring them

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage; every radio has it, since events may come."""
        return Disrupted(medium)

    def __init__(self, medium: Medium) -> None:
        self._disruption = medium.disruption

    def decide(self, links: Links, pose: FloatArray) -> None:
        """RECEIVER_DEAD before BLACKOUT before PARTITIONED; that the sender is dead or off, its own side has told."""
        now, receiver = self._disruption, links.receiver
        if not now.anything:
            return
        under_way = links.fate == HEARD
        for ends, fate in (
            (now.apart(links.sender, receiver), Fate.PARTITIONED),
            (~now.radio_on[receiver], Fate.BLACKOUT),
            (~now.alive[receiver], Fate.RECEIVER_DEAD),
        ):
            links.fate[under_way & ends] = fate

    @property
    def lets_all_pass(self) -> bool:
        """As it mostly is."""
        return not self._disruption.anything

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """0 where a radio is off or a partition between, be it one-way, else 1; the radio graph knows the dead."""
        return self._disruption.joined(links.sender, links.receiver).astype(np.float64)
