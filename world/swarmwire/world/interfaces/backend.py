"""Frames of robots' interfaces on the radio medium, beside the agents' messages.

`FramePorts` reads the frames that programs sent from the TAP devices, and writes received ones to them.
`InterfacesBackend` gives a backend in real time a medium on which frames travel, too: in every sub-tick it puts what
the devices hold on the medium, as packets sent at that moment, and writes what has been received. The backend inside
sees the agents' packets alone.
"""

import os
import select
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.ethernet import ADDRESS_BYTES, FRAME_TAG, HEADER_BYTES, addressee, exchanged
from swarmwire.comms.interfaces import SubtickMedium, SubtickPackets, TimedBackend
from swarmwire.comms.packets import Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.world.backends.pacing import LatencyHistogram, LatencySummary, Pace
from swarmwire.world.interfaces.namespaces import RobotInterface

MAX_FRAME_BYTES = HEADER_BYTES + 65_535
MAX_READS = 64  # frames of one device in a sub-tick: a program that floods its device must not stop the world
LATE_S = 0.003  # wall time after its due time from which a delivered frame counts as late


@dataclass(frozen=True)
class InterfacesReport:
    """Frames of robots' interfaces over a run; a frame received by several robots counts once for each."""

    sent: int  # read from the devices: packets on the medium
    sent_bytes: int
    delivered: int  # written to the devices
    delivered_bytes: int
    late: int  # of these, written more than LATE_S of wall time after their reception by the modelled radio
    delivery: LatencySummary | None  # of the deliveries after that reception, wall time


class FramePorts:
    """The devices of the robots of a run's only arena, in the order of their indices."""

    def __init__(self, interfaces: Sequence[RobotInterface], pace: Pace) -> None:
        self._interfaces, self._pace = interfaces, pace
        self._epoll = select.epoll()
        self._robot_of = {interface.tap: robot for robot, interface in enumerate(interfaces)}
        for tap in self._robot_of:
            self._epoll.register(tap, select.EPOLLIN)
        self._counts = Counter[str]()
        self._delivery = LatencyHistogram()
        self._sent = self._sent_bytes = self._delivered = self._delivered_bytes = self._late = 0

    def take(self) -> SentPackets:
        """The frames that the robots' programs sent since the last call, each as a packet."""
        robots: list[int] = []
        to: list[int] = []
        payloads: list[bytes] = []
        for tap, _ in self._epoll.poll(0):
            robot = self._robot_of[tap]
            address = self._interfaces[robot].addresses.mac
            for frame in _frames(tap):
                if frame[ADDRESS_BYTES : 2 * ADDRESS_BYTES] != address:
                    self._counts["frames_of_other_stations"] += 1  # a bridge: an ad hoc station cannot send as another
                    continue
                robots.append(robot)
                to.append(addressee(frame))
                payloads.append(exchanged(frame))
        if not robots:
            return SentPackets.none()
        self._sent += len(robots)
        self._sent_bytes += sum(map(len, payloads))
        return SentPackets(np.array(robots), np.array(to), Payloads.of(payloads))

    def deliver(self, received: ReceivedPackets) -> ReceivedPackets:
        """Write the frames among these packets to their receivers' devices; returns the other packets."""
        if not len(received):
            return received
        is_frame = (received.payloads.tags() == FRAME_TAG)[received.payload]
        places = np.flatnonzero(is_frame)
        if not len(places):
            return received
        rows = {row: exchanged(received.payloads.row(row)) for row in np.unique(received.payload[places]).tolist()}
        # In the order of time, also of receivers that answer one another.
        order = places[np.argsort(received.received_at_ns[places], kind="stable")]
        for receiver, row in zip(received.receiver[order].tolist(), received.payload[order].tolist(), strict=True):
            self._write(receiver, rows[row])
        self._count_lateness(received.received_at_ns[order])
        return received.select(np.flatnonzero(~is_frame))

    def report(self) -> InterfacesReport:
        """The frames so far."""
        return InterfacesReport(
            self._sent,
            self._sent_bytes,
            self._delivered,
            self._delivered_bytes,
            self._late,
            self._delivery.delays(),
        )

    def counts(self) -> dict[str, int]:
        """Frames that never were packets, or were received and never delivered, by reason."""
        return dict(self._counts)

    def count_dropped(self) -> None:
        """Count what the kernel dropped of the devices' frames, now that the run is over."""
        dropped = sum(interface.dropped() for interface in self._interfaces)
        if dropped:
            self._counts["frames_dropped_by_kernel"] = dropped

    def close(self) -> None:
        """Let go of the devices; safe to call more than once."""
        self._epoll.close()

    def _write(self, receiver: int, frame: bytes) -> None:
        try:
            os.write(self._interfaces[receiver].tap, frame)
        except OSError:  # its program has set it down
            self._counts["frames_refused_by_device"] += 1
            return
        self._delivered += 1
        self._delivered_bytes += len(frame)

    def _count_lateness(self, received_at_ns: IntArray) -> None:
        late_ns = self._pace.behind_ns(received_at_ns)
        self._delivery.add(late_ns)
        self._late += int((late_ns > to_ns(LATE_S)).sum())


def _frames(tap: int) -> list[bytes]:
    """The frames that wait at a device, at most MAX_READS."""
    found: list[bytes] = []
    with suppress(BlockingIOError):
        for _ in range(MAX_READS):
            found.append(os.read(tap, MAX_FRAME_BYTES))  # noqa: PERF401 - those before the error are kept
    return found


class InterfacesBackend:
    """A backend in real time with frames of interfaces beside its packets."""

    def __init__(self, backend: TimedBackend, ports: FramePorts) -> None:
        self._backend, self._ports = backend, ports
        self.start, self.act, self.close = backend.start, backend.act, backend.close

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """As of the backend, whose medium also carries frames."""
        messages = self._ports.deliver(received)
        return self._backend.act_in_time(tick, readings, messages, tx_status, _MediumWithFrames(medium, self._ports))

    def counts(self) -> dict[str, int]:
        """Faults of the backend and of the interfaces, by name."""
        return {**self._backend.counts(), **self._ports.counts()}


class _MediumWithFrames:
    """A medium during a tick that takes frames from devices, and delivers frames to them."""

    def __init__(self, medium: SubtickMedium, ports: FramePorts) -> None:
        self._medium, self._ports = medium, ports
        self.send = medium.send

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """As of the medium, without frames; those that programs sent by now are sent at `until_ns`."""
        received, tx_status = self._medium.advance(until_ns)
        messages = self._ports.deliver(received)
        frames = self._ports.take()
        if len(frames):
            self._medium.send(SubtickPackets(until_ns, None, frames))
        return messages, tx_status
