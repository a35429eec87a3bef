"""Intake: what agents sent becomes numbered packets at their radios."""

import numpy as np

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
        # By sender, so that nothing depends on how the crew was divided.
        order = np.argsort(sent.sender, kind="stable")
        sequence = self._numbers(sent.sender[order])
        somewhere = sent.to[order] != NOWHERE
        if not somewhere.all():
            order, sequence = order[somewhere], sequence[somewhere]
        sender, to, payloads = sent.sender[order], sent.to[order], sent.payloads.rows(order)
        return Transmissions(
            sender=sender,
            to=to,
            sequence=sequence,
            intended=np.where(to == BROADCAST, others_alive[sender], 1),
            epoch=np.full(len(sender), epoch),
            tag=payloads.tags(),
            sent_at_ns=sent_at_ns[sender],
            on_air_at_ns=sent_at_ns[sender],
            off_air_at_ns=sent_at_ns[sender],
            fate=np.full(len(sender), int(Fate.HEARD)),
            outcome_id=sent.outcome_ids[order],
            payloads=payloads,
        )

    def _numbers(self, sender: IntArray) -> IntArray:
        """The sequence numbers of packets sorted by sender."""
        sequence = self._sent_before[sender] + np.arange(len(sender)) - np.searchsorted(sender, sender)
        self._sent_before += np.bincount(sender, minlength=len(self._sent_before))
        return sequence
