"""Burst losses of links, without a medium."""

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray, KeyArray
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.stages.burst_loss import BurstLoss
from swarmwire.comms.radio.stages.losses import LossChain


class BurstLinks:
    """The links between `robots` in each arena, under burst losses alone."""

    def __init__(self, bursts: Bursts, keys: KeyArray, robots: int) -> None:
        self._keys, self._rows = keys, len(keys) * robots
        self._loss = BurstLoss(bursts, self._rows)

    def __len__(self) -> int:
        return len(self._loss)

    def change(self, bursts: Bursts, at_ns: int) -> None:
        """Other bursts from a time on."""
        previous, self._loss = self._loss, BurstLoss(bursts, self._rows)
        self._loss.go_on_from(previous, at_ns)

    def lost(self, sender: IntArray, receiver: IntArray, sequence: IntArray, at_ns: IntArray) -> BoolArray:
        """Whether each packet (k,) is lost, between robot rows."""
        links = Links.under_way(np.zeros(len(sender), np.int64), sender, receiver, sequence, at_ns, 0)
        LossChain([self._loss]).decide(links, np.zeros((self._rows, 3)), self._keys, count_only=False)
        return links.fate == Fate.BURST
