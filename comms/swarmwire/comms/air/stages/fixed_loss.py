"""Fixed loss: the medium loses the same share everywhere, each packet for each receiver on its own."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.fates import Fate

LOSS = purpose("fixed loss")


class FixedLoss(Stage):
    """A Bernoulli trial with probability `loss` for each packet and receiver."""

    name = "fixed_loss"
    keys = ("loss",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio loses anything."""
        return FixedLoss(medium) if medium.radio.loss > 0.0 else None

    def __init__(self, medium: Medium) -> None:
        self._loss, self._keys, self._robots = medium.radio.loss, medium.keys, medium.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Lost links end; they were in range."""
        ends = lost(self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate, self._loss)
        links.fate[ends] = Fate.LOST

    def delivery(self, links: Links, pose: FloatArray) -> float:
        """1 - loss."""
        return 1.0 - self._loss


@njit(cache=True)
def lost(keys, robots, sender, receiver, sequence, fate, loss):
    """Which of the links under way are lost: u < loss, u keyed by (sender, receiver, sequence), (k,)."""
    ends = np.zeros(len(sender), np.bool_)
    for i in range(len(ends)):
        if fate[i] == HEARD:
            key = keys[sender[i] // robots]
            ends[i] = uniform(key, sender[i] % robots, receiver[i] % robots, sequence[i], LOSS) < loss
    return ends
