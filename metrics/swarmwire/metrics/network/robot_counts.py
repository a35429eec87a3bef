"""What became of each robot's packets: of those it sent, and of those that were meant for it."""

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.comms.truth import NO_ROBOT, ReceptionRecords, Static, TransmissionRecords

FATES = len(FATE_NAMES)


class RobotCounts:
    """Packets counted for each robot row, as sender and as receiver; O(robots) memory.

    Attributes:
        packets: (rows,) that left its radio, refused ones too.
        packets_on_air: (rows,) of these, that it put on air.
        on_air_ns: (rows,) their airtime.
        intended: (rows,) receivers that its packets were meant for.
        as_sender: (rows, fates) these receivers by what became of the packet for them, as far as it is final.
        as_receiver: (rows, fates) packets that might have reached it, by what became of them for it.
        received_bytes: (rows,) payload that it received, with tags.
    """

    def __init__(self, static: Static) -> None:
        self._robots, self._rows = static.robots, static.arenas * static.robots
        self.packets, self.packets_on_air, self.on_air_ns = self._zeros(), self._zeros(), self._zeros()
        self.intended, self.received_bytes = self._zeros(), self._zeros()
        self.as_sender: IntArray = np.zeros((self._rows, FATES), np.int64)
        self.as_receiver: IntArray = np.zeros((self._rows, FATES), np.int64)

    def see(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add what a tick brought."""
        self._add_departed(departed)
        sender = finished.arena * self._robots + finished.sender
        _add(self.as_sender, sender * FATES + finished.fate, finished.receivers)
        receiver, fate, size_bytes = (
            finished.arena * self._robots + finished.receiver,
            finished.fate,
            finished.size_bytes,
        )
        linked = finished.receiver != NO_ROBOT
        if not linked.all():
            receiver, fate, size_bytes = receiver[linked], fate[linked], size_bytes[linked]
        _add(self.as_receiver, receiver * FATES + fate)
        _add(self.received_bytes, receiver, np.where(fate == Fate.RECEIVED, size_bytes, 0))

    @property
    def in_flight(self) -> IntArray:
        """Receivers of packets that left the radio for whom nothing is final yet, (rows,)."""
        return self.intended - self.as_sender.sum(axis=1)

    def _add_departed(self, departed: TransmissionRecords) -> None:
        sender = departed.arena * self._robots + departed.sender
        _add(self.packets, sender)
        _add(self.packets_on_air, sender[departed.fate == Fate.RECEIVED])
        _add(self.on_air_ns, sender, departed.off_air_at_ns - departed.on_air_at_ns)
        _add(self.intended, sender, departed.intended)
        _add(self.as_sender, sender * FATES + Fate.OUT_OF_RANGE, departed.out_of_range)

    def _zeros(self) -> IntArray:
        return np.zeros(self._rows, np.int64)


def _add(to: IntArray, place: IntArray, amount: IntArray | None = None) -> None:
    """Add amounts, 1 each if left out, at places of the flattened table."""
    np.add.at(to.reshape(-1), place, 1 if amount is None else amount)
