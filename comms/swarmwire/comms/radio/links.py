"""The table of links, on which all stages of the channel work: fates of packets at their receivers."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.transmissions import Transmissions

THE_REST = -1
RECEIVED, OUT_OF_RANGE = int(Fate.RECEIVED), int(Fate.OUT_OF_RANGE)


class Links(NamedTuple):
    """A row per packet and possible receiver, and one row per packet for the rest of its intended receivers.

    The row for the rest (receiver THE_REST) only counts: receivers out of range by subtraction, or all receivers with
    the fate at the sender's radio. Stages never see it. Until the chain has ended, fate RECEIVED means "still under
    way".
    """

    packet: IntArray  # (k,) row in the table of transmissions
    sender: IntArray  # (k,) robot row
    receiver: IntArray  # (k,) robot row, or THE_REST
    sequence: IntArray  # (k,) of the packet
    receivers: IntArray  # (k,) number of intended receivers of the row
    in_range: IntArray  # (k,) number of them in range after path loss and walls
    fate: IntArray  # (k,) a Fate
    final_at_ns: IntArray  # (k,) time at which the fate becomes final
    rssi_dbm: FloatArray  # (k,) strength at the receiver; NaN where there is none
    given: FloatArray  # (k, columns) measurements of the receiver, in the order of the radio's `measures.columns`

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
        """Links still under way, as input of the first stage."""
        k = len(packet)
        one, zero = np.ones(k, np.int64), np.full(k, RECEIVED, np.int64)
        given, rssi_dbm = np.zeros((k, columns)), np.full(k, np.nan)
        return cls(packet, sender, receiver, sequence, one, one.copy(), zero, final_at_ns, rssi_dbm, given)

    @classmethod
    def with_the_rest(
        cls, packets: Transmissions, packet: IntArray, receiver: IntArray, in_range: IntArray, columns: int
    ) -> "Links":
        """Links still under way of packets that go on air, then the row of each packet for the rest.

        `packet` and `receiver` are columns of the links. `in_range` (packets,) is the number of receivers in range of a
        packet that never goes on air, else 0.
        """
        sender, sequence, off_air_at_ns = packets.sender, packets.sequence, packets.off_air_at_ns
        numbers = _with_the_rest(
            packet, receiver, sender, sequence, off_air_at_ns, packets.intended, packets.fate, in_range
        )
        rows = numbers.shape[1]
        return cls._make([*numbers, np.full(rows, np.nan), np.zeros((rows, columns))])

    @classmethod
    def none(cls, columns: int) -> "Links":
        """No links."""
        nothing = np.empty(0, np.int64)
        return cls.under_way(nothing, nothing, nothing, nothing, nothing, columns)

    def select(self, index: IntArray) -> "Links":
        """The rows of `index`, in its order."""
        return Links._make(column.take(index, axis=0) for column in self)

    def first(self, rows: int) -> "Links":
        """The first `rows` rows, as views."""
        return Links._make(column[:rows] for column in self)

    def followed_by(self, later: "Links") -> "Links":
        """These rows and then the later ones."""
        if not len(self.packet):
            return later
        return Links._make(np.concatenate(columns) for columns in zip(self, later, strict=True))


@njit()
def _with_the_rest(packet, receiver, sender, sequence, off_air_at_ns, intended, fate, in_range):
    """The integer columns of `Links` in their order, (8, links + packets)."""
    links, packets = len(packet), len(sender)
    table = np.empty((8, links + packets), np.int64)
    others = intended.copy()
    for row in range(links):
        p = packet[row]
        others[p] -= 1
        table[0, row], table[1, row], table[2, row], table[3, row] = p, sender[p], receiver[row], sequence[p]
        table[4, row], table[5, row], table[6, row], table[7, row] = 1, 1, RECEIVED, off_air_at_ns[p]
    for p in range(packets):
        row = links + p
        table[0, row], table[1, row], table[2, row], table[3, row] = p, sender[p], THE_REST, sequence[p]
        table[4, row], table[5, row], table[7, row] = others[p], in_range[p], off_air_at_ns[p]
        table[6, row] = OUT_OF_RANGE if fate[p] == RECEIVED else fate[p]
    return table
