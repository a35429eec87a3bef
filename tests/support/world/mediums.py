"""A radio medium between ticks whose packets are received at set times."""

from dataclasses import dataclass, field, replace

import numpy as np

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.interfaces import SubtickPackets
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable
from tests.support.agent.hosts import MEASURES, received_from


@dataclass
class ScriptedMedium:
    """Collects sent packets, and delivers a packet of `sender` to all `receivers` at each of `due_ns`."""

    due_ns: list[int] = field(default_factory=list[int])
    payload: bytes = b"\0\0"
    sender: int = 0
    receivers: tuple[int, ...] = (1,)
    sent: list[SubtickPackets] = field(default_factory=list[SubtickPackets])
    times_ns: list[int] = field(default_factory=list[int])

    def send(self, packets: SubtickPackets) -> None:
        assert packets.at_ns >= (self.times_ns or [0])[-1]
        if len(packets.sent):
            self.sent.append(packets)

    def set_poses(self, at_ns: int, poses: SparseTable) -> None:
        assert at_ns >= (self.times_ns or [0])[-1]

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        self.times_ns.append(until_ns)
        if not self.due_ns or self.due_ns[0] > until_ns:
            return ReceivedPackets.none(MEASURES), NO_TX_STATUSES
        sent = SentPackets(np.array([self.sender]), np.array([BROADCAST]), Payloads.from_rows([self.payload]))
        received = received_from(sent, list(self.receivers))
        at_ns = np.full(len(received), self.due_ns.pop(0))
        return replace(received, received_at_ns=at_ns), NO_TX_STATUSES
