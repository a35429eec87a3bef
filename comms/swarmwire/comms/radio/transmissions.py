"""Packets at or beyond their sender's radio, as a table."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.packets import BROADCAST, NOWHERE, Fate, Payloads, SentPackets


class Transmissions(NamedTuple):
    """A row per packet, those of one sender in the order in which it sent them.

    A packet that its sender's radio refused never goes on air: its three times are then all `sent_at_ns`.
    """

    sender: IntArray  # (k,) robot row
    to: IntArray  # (k,) index in the arena of the one receiver, or BROADCAST
    sequence: IntArray  # (k,) packets that the sender had sent before this one, refused ones too
    intended: IntArray  # (k,) receivers that it is meant for
    epoch: IntArray  # (k,) of `Lives` when it was sent: a broadcast is meant for those alive then
    tag: IntArray  # (k,) topic
    sent_at_ns: IntArray  # (k,) handed to the sender's radio
    on_air_at_ns: IntArray  # (k,) the first bit
    off_air_at_ns: IntArray  # (k,) the end of the last bit
    fate: IntArray  # (k,) RECEIVED: accepted, to be decided for each receiver; else the fate for all of them
    tx_status_id: IntArray  # (k,) under which the sender is told what became of it, or UNTOLD
    payloads: Payloads  # (k,)

    @classmethod
    def none(cls) -> "Transmissions":
        """No packets."""
        return cls._make([*[np.empty(0, np.int64)] * 11, Payloads.joined([])])

    def __bool__(self) -> bool:
        return len(self.sender) > 0

    def select(self, index: IntArray) -> "Transmissions":
        """The packets of `index`, in its order."""
        if len(index) == len(self.sender) and (index[1:] > index[:-1]).all():  # then it is all of them, in order
            return self
        return Transmissions._make([*_taken(self[:-1], index), self.payloads.rows(index)])

    def parted(self, which: BoolArray) -> "tuple[Transmissions, Transmissions]":
        """Those of the packets `which` (k,), and the others."""
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


@njit(cache=True)
def _taken(columns, index):
    """The rows of `index` of all columns, (columns, k)."""
    out = np.empty((len(columns), len(index)), np.int64)
    for c in range(len(columns)):
        column = columns[c]
        for k in range(len(index)):
            out[c, k] = column[index[k]]
    return out


# --- Intake: what agents sent becomes numbered packets at their radios.


class Admission:
    """Counts the packets that each radio was handed."""

    def __init__(self, rows: int) -> None:
        self._sent_before = np.zeros(rows, np.int64)

    def take(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """The packets, sorted by sender, as if each were on air at once, for no time; those to NOWHERE only count.

        `sent_at_ns` (rows,) is when each robot sends, `others_alive` (rows,) whom a robot's broadcast intends: those of
        the epoch.
        """
        if (sent.sender[1:] < sent.sender[:-1]).any():  # nothing may depend on how the backend was divided
            sent = sent.select(np.argsort(sent.sender, kind="stable"))
        sequence = _numbers(sent.sender.copy(), self._sent_before)
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


@njit(cache=True)
def _numbers(sender, sent_before):
    """The sequence number of each packet, (k,); `sent_before` (rows,) counts on."""
    sequence = np.empty(len(sender), np.int64)
    for p in range(len(sender)):
        sequence[p] = sent_before[sender[p]]
        sent_before[sender[p]] += 1
    return sequence
