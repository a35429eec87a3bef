"""The table of packets at or beyond their sender's radio, and the admission of sent packets to the queues."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import BROADCAST, NOWHERE, Fate, Payloads, SentPackets


class Transmissions(NamedTuple):
    """A row per packet, those of one sender in the order in which it sent them.

    A packet refused by its sender's radio never goes on air: all three of its times are `sent_at_ns`.
    """

    sender: IntArray  # (k,) robot row
    to: IntArray  # (k,) index in the arena of the one receiver, or BROADCAST
    sequence: IntArray  # (k,) number of packets that the sender sent before, refused ones included
    intended: IntArray  # (k,) number of intended receivers
    epoch: IntArray  # (k,) epoch of `LivenessHistory` when it was sent: a broadcast intends the robots alive then
    tag: IntArray  # (k,) the message's class, as a tag on the wire
    sent_at_ns: IntArray  # (k,) arrival at the sender's radio
    on_air_at_ns: IntArray  # (k,) start of the first bit
    off_air_at_ns: IntArray  # (k,) end of the last bit
    fate: IntArray  # (k,) RECEIVED: accepted, fate decided per receiver; else the fate at all of them
    tx_status_id: IntArray  # (k,) ID of the transmit status for the sender, or NOT_MEASURED
    payloads: Payloads  # (k,)

    @classmethod
    def none(cls) -> "Transmissions":
        """No packets."""
        return cls._make([*[np.empty(0, np.int64)] * 11, Payloads.joined([])])

    def __bool__(self) -> bool:
        return len(self.sender) > 0

    def select(self, index: IntArray) -> "Transmissions":
        """The packets of `index`, in its order."""
        if len(index) == len(self.sender) and (index[1:] > index[:-1]).all():  # all of them, in order
            return self
        return Transmissions._make([*_take(self[:-1], index), self.payloads.rows(index)])

    def parted(self, which: BoolArray) -> "tuple[Transmissions, Transmissions]":
        """The packets `which` (k,), and the others."""
        if which.all():
            return self, Transmissions.none()
        if not which.any():
            return Transmissions.none(), self
        return self.select(np.flatnonzero(which)), self.select(np.flatnonzero(~which))

    def followed_by(self, later: "Transmissions") -> "Transmissions":
        """These packets and then the later ones."""
        if not (self and later):
            return self or later
        columns = [np.concatenate(pair) for pair in zip(self[:-1], later[:-1], strict=True)]
        return Transmissions._make([*columns, Payloads.joined([self.payloads, later.payloads])])


@njit()
def _take(columns, index):
    """The rows of `index` of all columns, (columns, k)."""
    out = np.empty((len(columns), len(index)), np.int64)
    for c in range(len(columns)):
        column = columns[c]
        for k in range(len(index)):
            out[c, k] = column[index[k]]
    return out


class Admission:
    """Numbers sent packets and turns them into transmissions; counts the packets of each radio."""

    def __init__(self, rows: int) -> None:
        self._sent_before = np.zeros(rows, np.int64)

    def take(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """The packets sorted by sender, with all times at `sent_at_ns`; packets to NOWHERE only take a number.

        `sent_at_ns` (rows,) is the send time of each robot, `others_alive` (rows,) the number of intended receivers of
        its broadcasts in this epoch.
        """
        if (sent.sender[1:] < sent.sender[:-1]).any():  # results must not depend on how the backend was divided
            sent = sent.select(np.argsort(sent.sender, kind="stable"))
        sequence = _sequence_numbers(sent.sender.copy(), self._sent_before)
        somewhere = sent.to != NOWHERE
        if not somewhere.all():
            sent, sequence = sent.select(np.flatnonzero(somewhere)), sequence[somewhere]
        sender, to = sent.sender.copy(), sent.to.copy()
        return Transmissions(
            sender=sender,
            to=to,
            sequence=sequence,
            intended=np.where(to == BROADCAST, others_alive[sender], 1),
            epoch=np.full(len(sender), epoch),
            tag=sent.payloads.tags(),
            sent_at_ns=sent_at_ns[sender],
            on_air_at_ns=sent_at_ns[sender],
            off_air_at_ns=sent_at_ns[sender],
            fate=np.full(len(sender), int(Fate.RECEIVED)),
            tx_status_id=sent.tx_status_ids.copy(),
            payloads=sent.payloads,
        )


@njit()
def _sequence_numbers(sender, sent_before):
    """The sequence number of each packet, (k,); increments `sent_before` (rows,)."""
    sequence = np.empty(len(sender), np.int64)
    for p in range(len(sender)):
        sequence[p] = sent_before[sender[p]]
        sent_before[sender[p]] += 1
    return sequence
