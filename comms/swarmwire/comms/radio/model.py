"""The interface of a radio model, and the edges of its radio graph. The unit disk and the PHY implement it.

Two robots are joined in the radio graph if a lone packet is delivered in both directions with at least `min_delivery`,
fast fading left out. A radio model finds the candidate pairs, and computes the delivery of each.
"""

from abc import ABC, abstractmethod

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray, Table
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.liveness import LivenessHistory
from swarmwire.comms.robot.packets import NO_TX_STATUSES, SentPackets, TxStatuses

# Tolerance: 1 - 0.9 is slightly below 0.1 in floating point.
ROUNDING = 1e-9


class RadioModel(ABC):
    """The radios and the channel between them: packets go in, links with fates come out.

    `pass_time` and `disrupt` append links with fates, and a PHY also their packets, to the tables of the medium. A fate
    may become final later than the time that has passed. Poses (rows, 4) are x, y in m, heading in rad and height in m.
    """

    @property
    @abstractmethod
    def queued(self) -> Table:
        """Packets that wait or are on air and have no links yet, of type PACKET."""

    @abstractmethod
    def set_poses(self, pose: FloatArray) -> None:
        """Use `pose` (rows, 4) and the active disruption from now on; the array must not change."""

    def expect(self, pose: FloatArray) -> None:  # noqa: B027 - a model may have nothing to do
        """Prepare for the next poses, `pose` (rows, 4), which `set_poses` then sets."""

    @abstractmethod
    def tune(self, at_ns: int, radio: Radio) -> None:
        """Use the parameters of `radio` from `at_ns` on; packets that wait or are on air stay."""

    @abstractmethod
    def accept(
        self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int, counts: AnyArray
    ) -> int:
        """Queue packets that are sent at `sent_at_ns` (k,), and count them in `counts` (arenas,) of type COUNTS.

        `others_alive` (rows,) is the number of intended receivers of a robot's broadcast. Return NO_PACKET; or the
        first packet without a receiver, and none is queued.
        """

    @abstractmethod
    def pass_time(self, until_ns: int, liveness: LivenessHistory) -> None:
        """Let time pass to just before `until_ns`."""

    @abstractmethod
    def disrupt(self, at_ns: int, disruption: Disruption, liveness: LivenessHistory) -> None:
        """Apply a disruption: dead robots lose their queues, radios that are off lose their receptions.

        Called while any robot is dead or any radio off, and once when that has ended: paused queues then go on air.
        """

    def tx_status(self, alive: BoolArray) -> TxStatuses:
        """Return the transmit statuses since the last call, of senders `alive` (rows,).

        Without acknowledgements there are none.
        """
        return NO_TX_STATUSES

    @abstractmethod
    def drain(self) -> Table:
        """Remove all packets queued or on air, as the run ends; `intended` counts receivers without a fate."""

    @abstractmethod
    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Return the edges of the radio graph: robot rows a < b, sorted, (e, 2)."""


def is_enough(delivery: FloatArray | float, min_delivery: float) -> BoolArray:
    """Return True if two robots with this delivery in the worse direction are joined."""
    return np.asarray(delivery >= min_delivery - ROUNDING)


def edges_above(pairs: IntArray, delivery: FloatArray | float, min_delivery: float) -> IntArray:
    """Return the pairs of robot rows (k, 2) whose `delivery` in the worse direction is enough, (e, 2).

    `delivery` is (k,), or one number for all pairs. The edges are in the order of the pairs: a < b in each, sorted.
    """
    joined = is_enough(delivery, min_delivery)
    return pairs if joined.all() else pairs[np.broadcast_to(joined, len(pairs))]
