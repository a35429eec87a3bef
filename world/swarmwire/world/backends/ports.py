"""Packets of programs on the radio medium, in addition to the agents' messages.

`PortsBackend` wraps a backend in real time with a medium that also carries the packets of `PacketPorts`, such as
frames of robots' interfaces: in every sub-tick, or tick, it reads their packets, which are sent within the next
sub-tick (`spread`), and passes received ones on to them. The wrapped backend gets only the agents' packets.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol, cast

import numpy as np

from swarmwire.comms.base.draws import derive_key, purpose
from swarmwire.comms.observe.interfaces import AgentBackend, SubtickMedium, SubtickPackets, TimedBackend
from swarmwire.comms.radio.send_times import keyed_ns
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, SparseTable

SPREAD_KEY, SPREAD = np.array([derive_key("frames")], np.uint64), purpose("send time of frames")


class PacketPorts(Protocol):
    """The programs of robots at the medium.

    Attributes:
        tag: of their packets. Packets of agents with it are dropped and counted: they would pass for those of programs.
    """

    tag: int

    def deliver(self, received: ReceivedPackets) -> ReceivedPackets:
        """Pass received packets on to programs; return those for the agents."""
        ...

    def pop_packets(self) -> list[SentPackets]:
        """Remove and return the packets that programs sent, one item for each robot with packets."""
        ...

    def count_sent(self, packets: SentPackets) -> None:
        """Count packets that were put on the medium."""
        ...

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults, by name."""
        ...


class PortsBackend:
    """A backend in real time with packets of programs in addition to its own."""

    def __init__(
        self,
        backend: AgentBackend | TimedBackend,
        ports: PacketPorts,
        subtick_ns: int,
        accept_statuses: Callable[[TxStatuses], TxStatuses] | None = None,
    ) -> None:
        """`subtick_ns` is the interval at which packets are read, in simulated time; 0 without sub-ticks.

        `accept_statuses` gets all transmit statuses, and returns those of the agents' packets; None: the ports' packets
        have none.
        """
        self._backend, self._ports, self._subtick_ns = backend, ports, subtick_ns
        self._accept_statuses = accept_statuses
        self._waiting: list[SubtickPackets] = []  # sorted by time; some wait for the next tick
        self._reads = self._spoofed = 0
        self.start, self.close = backend.start, backend.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Act as the wrapped backend; packets that programs sent within the tick are sent as those of agents."""
        actions = self._backend.act(tick, readings, self._ports.deliver(received), self.agents_statuses(tx_status))
        packets = SentPackets.joined(self._ports.pop_packets())
        self._ports.count_sent(packets)
        return replace(actions, sent=SentPackets.joined([self.of_agents(actions.sent), packets]))

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Act as the wrapped backend; its medium also carries packets of programs."""
        messages, backend = self._ports.deliver(received), cast("TimedBackend", self._backend)
        statuses = self.agents_statuses(tx_status)
        return backend.act_in_time(tick, readings, messages, statuses, _MediumWithPorts(medium, self))

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults of the backend and of the ports, by name."""
        spoofed = {"packets_with_reserved_tag": self._spoofed} if self._spoofed else {}
        return {**self._backend.counts(), **self._ports.counts(), **spoofed}

    def agents_statuses(self, tx_status: TxStatuses) -> TxStatuses:
        """Return the statuses of the agents' packets."""
        return self._accept_statuses(tx_status) if self._accept_statuses else tx_status

    def of_agents(self, sent: SentPackets) -> SentPackets:
        """Return the packets without those that pass for packets of programs, which it counts."""
        is_spoofed = sent.payloads.tags() == self._ports.tag
        if not is_spoofed.any():
            return sent
        self._spoofed += int(is_spoofed.sum())
        return sent.select(np.flatnonzero(~is_spoofed))

    def send_waiting(self, medium: SubtickMedium, until_ns: int) -> None:
        """Put the packets on the medium that are due."""
        while self._waiting and self._waiting[0].at_ns <= until_ns:
            packets = self._waiting.pop(0)
            self._ports.count_sent(packets.sent)
            medium.send(packets)

    def exchange(self, received: ReceivedPackets, now_ns: int) -> ReceivedPackets:
        """Deliver packets and read new ones; return the packets for the agents."""
        messages, packets = self._ports.deliver(received), self._ports.pop_packets()
        if packets:
            start_ns = max(now_ns, self._waiting[-1].at_ns) if self._waiting else now_ns
            self._waiting += spread(packets, start_ns, self._subtick_ns, self._reads)
            self._reads += 1
        return messages


def spread(packets: Sequence[SentPackets], start_ns: int, subtick_ns: int, number: int) -> list[SubtickPackets]:
    """Spread the packets of a reading over the sub-tick that starts at `start_ns`, with a time for each robot.

    Programs sent them at any time of the last sub-tick. At the same time they would collide, since a station on an idle
    medium sends at once. The packets of a single robot need not wait. `number` of the reading keys the draws.
    """
    if len(packets) == 1:
        return [SubtickPackets(start_ns, None, packets[0])]
    offsets_ns = keyed_ns(SPREAD_KEY, number, SPREAD, np.full(len(packets), subtick_ns)).tolist()
    order = sorted(range(len(packets)), key=offsets_ns.__getitem__)
    return [SubtickPackets(start_ns + offsets_ns[k], None, packets[k]) for k in order]


class _MediumWithPorts:
    """A medium during a tick that also carries packets of programs."""

    def __init__(self, medium: SubtickMedium, ports: PortsBackend) -> None:
        self._medium, self._ports = medium, ports

    def send(self, packets: SubtickPackets) -> None:
        """Send packets, after those of programs that are due before them."""
        self._ports.send_waiting(self._medium, packets.at_ns)
        self._medium.send(packets._replace(sent=self._ports.of_agents(packets.sent)))

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Advance the medium, and exchange packets; those that programs sent until now go out after `until_ns`."""
        self._ports.send_waiting(self._medium, until_ns)
        received, tx_status = self._medium.advance(until_ns)
        return self._ports.exchange(received, until_ns), self._ports.agents_statuses(tx_status)

    def set_poses(self, at_ns: int, poses: SparseTable) -> None:
        """Set poses, after the packets of programs that are due before them."""
        self._ports.send_waiting(self._medium, at_ns)
        self._medium.set_poses(at_ns, poses)
