"""The table of links, on which all stages of the channel work: fates of packets at their receivers."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio import transmissions
from swarmwire.comms.radio.transmissions import Column, Transmissions

THE_REST = -1
RECEIVED, OUT_OF_RANGE = int(Fate.RECEIVED), int(Fate.OUT_OF_RANGE)

COLUMNS = 8
PACKET, SENDER, RECEIVER, SEQUENCE, RECEIVERS, IN_RANGE, FATE, FINAL_AT = range(COLUMNS)


class Links:
    """A row per packet and possible receiver, and one row per packet for the rest of its intended receivers.

    The row for the rest (receiver THE_REST) only counts: receivers out of range by subtraction, or all receivers with
    the fate at the sender's radio. Stages never see it. Until the chain has ended, fate RECEIVED means "still under
    way".

    Attributes:
        table: (COLUMNS, k) the columns of whole numbers.
        rssi_dbm: (k,) strength at the receiver; NaN where there is none.
        given: (k, columns) measurements of the receiver, in the order of the radio's `measures.columns`.
    """

    __slots__ = ("given", "rssi_dbm", "table")

    packet = Column(PACKET)  # (k,) row in the table of transmissions
    sender = Column(SENDER)  # (k,) robot row
    receiver = Column(RECEIVER)  # (k,) robot row, or THE_REST
    sequence = Column(SEQUENCE)  # (k,) of the packet
    receivers = Column(RECEIVERS)  # (k,) number of intended receivers of the row
    in_range = Column(IN_RANGE)  # (k,) number of them in range after path loss and walls
    fate = Column(FATE)  # (k,) a Fate
    final_at_ns = Column(FINAL_AT)  # (k,) time at which the fate becomes final

    def __init__(self, table: IntArray, rssi_dbm: FloatArray, given: FloatArray) -> None:
        self.table, self.rssi_dbm, self.given = table, rssi_dbm, given

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
        one = np.ones(k, np.int64)
        table = np.stack([packet, sender, receiver, sequence, one, one, np.full(k, RECEIVED), final_at_ns])
        return cls(table, np.full(k, np.nan), np.zeros((k, columns)))

    @classmethod
    def with_the_rest(
        cls, packets: Transmissions, packet: IntArray, receiver: IntArray, in_range: IntArray, columns: int
    ) -> "Links":
        """Links still under way of packets that go on air, then the row of each packet for the rest.

        `packet` and `receiver` are columns of the links. `in_range` (packets,) is the number of receivers in range of a
        packet that never goes on air, else 0.
        """
        table = _with_the_rest(packet, receiver, packets.table, in_range)
        rows = table.shape[1]
        return cls(table, np.full(rows, np.nan), np.zeros((rows, columns)))

    @classmethod
    def none(cls, columns: int) -> "Links":
        """No links."""
        return cls(np.empty((COLUMNS, 0), np.int64), np.empty(0), np.empty((0, columns)))

    def __len__(self) -> int:
        return self.table.shape[1]

    def select(self, index: IntArray) -> "Links":
        """The rows of `index`, in its order."""
        return Links(self.table.take(index, axis=1), self.rssi_dbm.take(index), self.given.take(index, axis=0))

    def first(self, rows: int) -> "Links":
        """The first `rows` rows, as views."""
        return Links(self.table[:, :rows], self.rssi_dbm[:rows], self.given[:rows])

    def followed_by(self, later: "Links") -> "Links":
        """These rows and then the later ones."""
        if not len(self):
            return later
        return Links(
            np.concatenate((self.table, later.table), axis=1),
            np.concatenate((self.rssi_dbm, later.rssi_dbm)),
            np.concatenate((self.given, later.given)),
        )


@njit()
def _with_the_rest(packet, receiver, packets, in_range):
    """The table of `Links`, (COLUMNS, links + packets), of a table of `Transmissions`."""
    sender, sequence = packets[transmissions.SENDER], packets[transmissions.SEQUENCE]
    off_air_at_ns, fate = packets[transmissions.OFF_AIR_AT], packets[transmissions.FATE]
    links, count = len(packet), len(sender)
    table = np.empty((COLUMNS, links + count), np.int64)
    others = packets[transmissions.INTENDED].copy()
    for row in range(links):
        p = packet[row]
        others[p] -= 1
        table[PACKET, row], table[SENDER, row], table[RECEIVER, row] = p, sender[p], receiver[row]
        table[SEQUENCE, row], table[RECEIVERS, row], table[IN_RANGE, row] = sequence[p], 1, 1
        table[FATE, row], table[FINAL_AT, row] = RECEIVED, off_air_at_ns[p]
    for p in range(count):
        row = links + p
        table[PACKET, row], table[SENDER, row], table[RECEIVER, row] = p, sender[p], THE_REST
        table[SEQUENCE, row], table[RECEIVERS, row], table[IN_RANGE, row] = sequence[p], others[p], in_range[p]
        table[FATE, row] = OUT_OF_RANGE if fate[p] == RECEIVED else fate[p]
        table[FINAL_AT, row] = off_air_at_ns[p]
    return table
