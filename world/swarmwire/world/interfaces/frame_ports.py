"""Frames of robots' interfaces on the radio medium: read from the TAP devices, and written to them."""

import os
import select
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.ethernet import ADDRESS_BYTES, FRAME_TAG, HEADER_BYTES, LATE_S, addressee, exchanged
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads, ReceivedPackets, SentPackets
from swarmwire.world.backends.pacing import LatencyHistogram, LatencySummary, Pace
from swarmwire.world.interfaces.namespaces import RobotInterface
from swarmwire.world.interfaces.programs import robot_event

INTERFACE_LOST = "interface_lost"  # action of the event
TAG = FRAME_TAG.to_bytes(TAG_BYTES, "little")
MAX_FRAME_BYTES = HEADER_BYTES + 65_535
MAX_READS = 64  # frames of one device in a sub-tick: a program that floods its device must not stop the world
NO_DESCRIPTOR = -1
LATENCY_BATCH = 1024  # latencies that are counted at once, since a batch costs as much as one


@dataclass(frozen=True)
class InterfacesReport:
    """Frames of robots' interfaces over a run; a frame received by several robots counts once for each."""

    sent: int  #: frames read from the devices, which are packets on the medium
    sent_bytes: int
    delivered: int  #: frames written to the devices
    delivered_bytes: int
    late: int  #: frames written more than LATE_S of wall time after their reception by the modelled radio
    delivery: LatencySummary | None  #: wall time from that reception to the delivery


class FramePorts:
    """The devices of the robots of a run's only arena, in the order of their indices."""

    tag = FRAME_TAG

    def __init__(self, interfaces: Sequence[RobotInterface], pace: Pace) -> None:
        self._interfaces, self._pace = interfaces, pace
        self._epoll = select.epoll()
        self._robot_of = {interface.tap: robot for robot, interface in enumerate(interfaces)}
        self._interface_of = {interface.link_changes: interface for interface in interfaces}
        self._robot_of_process = {interface.process: robot for robot, interface in enumerate(interfaces)}
        for descriptor in {*self._robot_of, *self._interface_of, *self._robot_of_process} - {NO_DESCRIPTOR}:
            self._epoll.register(descriptor, select.EPOLLIN)
        self._lost: list[int] = []  # robots that lost their device since the last `pop_events`
        self._counts = Counter[str]()
        self._delivery = LatencyHistogram()
        self._latencies_ns: list[int] = []  # wall time; latencies that are not in the histogram yet
        self._buffer = bytearray(MAX_FRAME_BYTES)
        self._sent = self._sent_bytes = self._delivered = self._delivered_bytes = self._late = 0

    def pop_packets(self) -> list[SentPackets]:
        """Remove and return the frames that programs sent, as packets of each robot."""
        frames = dict[int, list[bytes]]()  # robot -> frames
        for _ in range(MAX_READS):
            ready = self._epoll.poll(0)  # cheaper than a read without a frame
            if not ready:
                break
            for descriptor, _ in ready:
                if descriptor in self._interface_of:
                    self._interface_of[descriptor].restore_routes()
                    continue
                if descriptor in self._robot_of_process:
                    self._leave(self._robot_of_process[descriptor])
                    break  # its other descriptors are closed
                robot, frame = self._robot_of[descriptor], self._read(descriptor)
                if frame[ADDRESS_BYTES : 2 * ADDRESS_BYTES] == self._interfaces[robot].addresses.mac:
                    frames.setdefault(robot, []).append(frame)
                elif frame:  # a bridge's frame: an ad hoc station cannot send with another address
                    self._counts["frames_of_other_stations"] += 1
        return [_as_packets(robot, robot_frames) for robot, robot_frames in frames.items()]

    def pop_events(self, start_ns: int) -> tuple[EventRecord, ...]:
        """Return an event for each robot that has lost its device since the last call."""
        lost, self._lost = self._lost, []
        return tuple(robot_event(start_ns, INTERFACE_LOST, robot, len(self._interfaces)) for robot in lost)

    def count_sent(self, packets: SentPackets) -> None:
        """Count frames that were put on the medium."""
        self._sent += len(packets)
        self._sent_bytes += len(packets.payloads.data)

    def deliver(self, received: ReceivedPackets) -> ReceivedPackets:
        """Write the frames among these packets to their receivers' devices; return the other packets."""
        if not len(received):
            return received
        # Lists cost less than arrays for the few packets of a sub-tick.
        rows = received.payload.tolist()
        frames = {row: exchanged(data) for row in set(rows) if (data := received.payloads.row(row))[:TAG_BYTES] == TAG}
        indices = [index for index, row in enumerate(rows) if row in frames]
        if not indices:
            return received
        received_ns, receivers = received.received_at_ns.tolist(), received.receiver.tolist()
        indices.sort(key=received_ns.__getitem__)  # receivers may answer one another
        for index in indices:
            self._write(receivers[index], frames[rows[index]])
        self._add_latencies([received_ns[index] for index in indices])
        if len(indices) == len(rows):
            return ReceivedPackets.none(tuple(received.measured))
        return received.select(np.setdiff1d(np.arange(len(rows)), indices))

    def report(self) -> InterfacesReport:
        """Return the report so far."""
        self._count_latencies()
        return InterfacesReport(
            self._sent,
            self._sent_bytes,
            self._delivered,
            self._delivered_bytes,
            self._late,
            self._delivery.summary(),
        )

    def counts(self) -> dict[str, int]:
        """Return the numbers of frames that never became packets, or were received and never delivered, by reason."""
        return dict(self._counts)

    def count_dropped(self) -> None:
        """Count the frames that the kernel dropped, at the end of the run."""
        dropped = sum(interface.dropped() for interface in self._interfaces)
        if dropped:
            self._counts["frames_dropped_by_kernel"] = dropped

    def close(self) -> None:
        """Release the devices; safe to call more than once."""
        self._epoll.close()

    def _read(self, tap: int) -> bytes:
        """Read a frame of a device; b"" if a program has deleted the device, which is not read again."""
        try:
            size = os.readv(tap, [self._buffer])
        except BlockingIOError:  # a program has set the device down, which empties its queue
            return b""
        except OSError:  # EBADFD: deleted, or its namespace has ended
            self._lose(self._robot_of[tap])
            return b""
        return bytes(self._buffer[:size])

    def _lose(self, robot: int) -> None:
        """Count a device that is gone, and read it no more."""
        tap = self._interfaces[robot].tap
        self._epoll.unregister(tap)
        del self._robot_of[tap]
        self._counts["interfaces_lost"] += 1
        self._lost.append(robot)

    def _leave(self, robot: int) -> None:
        """Close the interface in a namespace whose process has ended, so that the namespace can end, too."""
        interface = self._interfaces[robot]
        if interface.tap in self._robot_of:
            self._lose(robot)
        for descriptor in {interface.process, interface.link_changes} - {NO_DESCRIPTOR}:
            self._epoll.unregister(descriptor)
        interface.close()

    def _write(self, receiver: int, frame: bytes) -> None:
        try:
            os.write(self._interfaces[receiver].tap, frame)
        except OSError:  # a program has set the device down, or deleted it
            self._counts["frames_refused_by_device"] += 1
            return
        self._delivered += 1
        self._delivered_bytes += len(frame)

    def _add_latencies(self, received_at_ns: list[int]) -> None:
        self._latencies_ns += self._pace.latencies_ns(received_at_ns)
        if len(self._latencies_ns) >= LATENCY_BATCH:
            self._count_latencies()

    def _count_latencies(self) -> None:
        latencies_ns = np.array(self._latencies_ns, np.int64)
        self._latencies_ns.clear()
        self._delivery.add(latencies_ns)
        self._late += int((latencies_ns > to_ns(LATE_S)).sum())


def _as_packets(robot: int, frames: list[bytes]) -> SentPackets:
    """Return the frames of a robot's programs as packets."""
    to, payloads = [addressee(frame) for frame in frames], [exchanged(frame) for frame in frames]
    return SentPackets(np.array([robot] * len(to)), np.array(to), Payloads.from_rows(payloads))
