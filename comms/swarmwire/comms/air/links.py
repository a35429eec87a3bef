"""What becomes of packets at their receivers, as a table: the one thing that all stages of the channel work on."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.fates import Fate

THE_REST = -1
HEARD = int(Fate.HEARD)


class Links(NamedTuple):
    """A row per packet and receiver that it might reach, and one row per packet for the rest of its intended receivers.

    That last row (receiver THE_REST) only counts: out of range by subtraction, or the fate that the sender's radio gave
    to all. Stages never see it. Fate HEARD means, until the chain has ended, "nothing has stopped it so far".
    """

    packet: IntArray  # (k,) row in the table of transmissions
    sender: IntArray  # (k,) robot row
    receiver: IntArray  # (k,) robot row, or THE_REST
    sequence: IntArray  # (k,) of the packet
    receivers: IntArray  # (k,) how many intended receivers the row stands for
    in_range: IntArray  # (k,) how many of them were in range after path loss and walls
    fate: IntArray  # (k,) a Fate
    final_at_ns: IntArray  # (k,) when the fate becomes final
    rssi_dbm: FloatArray  # (k,) strength at the receiver; NaN where there is none
    given: FloatArray  # (k, columns) what the receiver learns, in the order of the radio's `gives.columns`

    @classmethod
    def under_way(
        cls,
        packet: IntArray,
        sender: IntArray,
        receiver: IntArray,
        sequence: IntArray,
        final_at_ns: IntArray,
        columns: int,
    ) -> "Links":
        """Links that nothing has stopped so far, as the first stage gets them."""
        k = len(packet)
        one, zero = np.ones(k, np.int64), np.full(k, HEARD, np.int64)
        given, rssi_dbm = np.zeros((k, columns)), np.full(k, np.nan)
        return cls(packet, sender, receiver, sequence, one, one.copy(), zero, final_at_ns, rssi_dbm, given)

    @classmethod
    def none(cls, columns: int) -> "Links":
        """No links."""
        nothing = np.empty(0, np.int64)
        return cls.under_way(nothing, nothing, nothing, nothing, nothing, columns)

    def select(self, index: IntArray) -> "Links":
        """The rows of `index`, in its order."""
        return Links._make(column.take(index, axis=0) for column in self)

    def followed_by(self, later: "Links") -> "Links":
        """These rows and then the later ones."""
        if not len(self.packet):
            return later
        return Links._make(np.concatenate(columns) for columns in zip(self, later, strict=True))
