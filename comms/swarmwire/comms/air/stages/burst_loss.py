"""Burst loss: links that are bad for a while lose more."""

import numpy as np

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.reception.burst_states import BurstStates
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.fates import Fate


class BurstLoss(Stage):
    """Gilbert's and Elliott's chain for each directed link, in continuous time."""

    name = "burst_loss"
    keys = ("bursts",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio has bursts; of a signal, its reception asks for them."""
        return BurstLoss(medium) if medium.radio.bursts is not None and not medium.radio.is_signal else None

    remembers = True

    def __init__(self, medium: Medium) -> None:
        assert medium.radio.bursts is not None
        self._bursts, self._loss = medium.radio.bursts, medium.radio.bursts.loss
        self._states = BurstStates(medium.radio.bursts, medium.keys, medium.robots)

    def go_on_from(self, before: Stage, at_ns: int) -> None:
        """Links are as good or bad as they were."""
        assert isinstance(before, BurstLoss)
        before._states.change(self._bursts, at_ns)
        self._states = before._states

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links end that a burst takes; they were in range. A link's packets come in the order of their time."""
        index = np.flatnonzero(links.fate == HEARD)
        index = index[np.argsort(links.final_at_ns[index], kind="stable")]
        sender, receiver, at_ns = links.sender[index], links.receiver[index], links.final_at_ns[index]
        ends = self._states.lost(sender, receiver, links.sequence[index], at_ns)
        links.fate[index[ends]] = Fate.BURST

    def delivery(self, links: Links, pose: FloatArray) -> float:
        """1 - loss, in the long run."""
        return 1.0 - self._loss
