"""Intake: what agents sent becomes numbered packets at their radios."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST, NOWHERE, Sent


class Intake:
    """Counts the packets that each radio was handed."""

    def __init__(self, rows: int) -> None:
        self._sent_before = np.zeros(rows, np.int64)

    def take(self, sent_at_ns: IntArray, sent: Sent, others_alive: IntArray, epoch: int) -> Transmissions:
        """The packets, sorted by sender, as if each were on air at once, for no time; those to NOWHERE only count.

        `sent_at_ns` (rows,) is when each robot sends, `others_alive` (rows,) whom a robot's broadcast intends: those of
        the epoch.
        """
        if (sent.sender[1:] < sent.sender[:-1]).any():  # nothing may depend on how the crew was divided
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
            fate=np.full(len(sender), int(Fate.HEARD)),
            outcome_id=sent.outcome_ids.copy(),
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
