"""Frames of robots' interfaces on the radio medium, beside the agents' messages.

`FramePorts` reads the frames that programs sent from the TAP devices, and writes received ones to them.
`InterfacesBackend` gives a backend in real time a medium on which frames travel, too: in every sub-tick it reads what
the devices hold, which is sent within the next one (`spread`), and writes what has been received. The backend inside
sees the agents' packets alone.
"""

import os
import select
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.draws import derive_key, purpose
from swarmwire.comms.base.ethernet import ADDRESS_BYTES, FRAME_TAG, HEADER_BYTES, LATE_S, addressee, exchanged
from swarmwire.comms.observe.interfaces import SubtickMedium, SubtickPackets, TimedBackend
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.radio.send_times import keyed_ns
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.world.backends.pacing import LatencyHistogram, LatencySummary, Pace
from swarmwire.world.interfaces.namespaces import RobotInterface
from swarmwire.world.interfaces.programs import robot_event

INTERFACE_LOST = "interface_lost"  # what the events of a run call it
TAG = FRAME_TAG.to_bytes(TAG_BYTES, "little")
MAX_FRAME_BYTES = HEADER_BYTES + 65_535
MAX_READS = 64  # frames of one device in a sub-tick: a program that floods its device must not stop the world
MANY_LATE = 1024  # deliveries whose lateness is counted at once, since that costs as much for one
SPREAD_KEY, SPREAD = np.array([derive_key("frames")], np.uint64), purpose("send time of frames")


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
        self._changed = {interface.link_changes: interface for interface in interfaces}
        for descriptor in (*self._robot_of, *self._changed):
            self._epoll.register(descriptor, select.EPOLLIN)
        self._lost: list[int] = []  # robots without a device, since the last `follow`
        self._counts = Counter[str]()
        self._delivery = LatencyHistogram()
        self._late_ns: list[int] = []  # in wall time, of deliveries that are not in the histogram yet
        self._buffer = bytearray(MAX_FRAME_BYTES)
        self._sent = self._sent_bytes = self._delivered = self._delivered_bytes = self._late = 0

    def take(self) -> list[SentPackets]:
        """The frames that programs sent since the last call, each as a packet: of each robot with some."""
        frames = dict[int, list[bytes]]()  # by robot
        for _ in range(MAX_READS):
            ready = self._epoll.poll(0)  # costs less than a read that finds nothing
            if not ready:
                break
            for descriptor, _ in ready:
                if descriptor in self._changed:
                    self._changed[descriptor].restore_routes()
                    continue
                robot, frame = self._robot_of[descriptor], self._read(descriptor)
                if frame[ADDRESS_BYTES : 2 * ADDRESS_BYTES] == self._interfaces[robot].addresses.mac:
                    frames.setdefault(robot, []).append(frame)
                elif frame:  # a bridge: an ad hoc station cannot send as another
                    self._counts["frames_of_other_stations"] += 1
        return [_as_packets(robot, of_robot) for robot, of_robot in frames.items()]

    def follow(self, start_ns: int) -> tuple[EventRecord, ...]:
        """An event for each robot that has lost its device since the last call."""
        lost, self._lost = self._lost, []
        return tuple(robot_event(start_ns, INTERFACE_LOST, robot, len(self._interfaces)) for robot in lost)

    def count_sent(self, frames: SentPackets) -> None:
        """Count frames that are on the medium now."""
        self._sent += len(frames)
        self._sent_bytes += len(frames.payloads.data)

    def deliver(self, received: ReceivedPackets) -> ReceivedPackets:
        """Write the frames among these packets to their receivers' devices; returns the other packets."""
        if not len(received):
            return received
        # Lists: of the few packets of a sub-tick they cost less than arrays.
        rows = received.payload.tolist()
        frames = {row: exchanged(data) for row in set(rows) if (data := received.payloads.row(row))[:TAG_BYTES] == TAG}
        places = [place for place, row in enumerate(rows) if row in frames]
        if not places:
            return received
        at_ns, receivers = received.received_at_ns.tolist(), received.receiver.tolist()
        places.sort(key=at_ns.__getitem__)  # in the order of time, also of receivers that answer one another
        for place in places:
            self._write(receivers[place], frames[rows[place]])
        self._count_lateness([at_ns[place] for place in places])
        if len(places) == len(rows):
            return ReceivedPackets.none(tuple(received.measured))
        return received.select(np.setdiff1d(np.arange(len(rows)), places))

    def report(self) -> InterfacesReport:
        """The frames so far."""
        self._add_lateness()
        return InterfacesReport(
            self._sent,
            self._sent_bytes,
            self._delivered,
            self._delivered_bytes,
            self._late,
            self._delivery.summary(),
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

    def _read(self, tap: int) -> bytes:
        """A frame of a device; nothing if a program has deleted the device, which is not read again then."""
        try:
            size = os.readv(tap, [self._buffer])
        except BlockingIOError:  # a program has emptied the queue of the device, by setting it down
            return b""
        except OSError:  # EBADFD: deleted, or its namespace has ended
            self._epoll.unregister(tap)
            self._counts["interfaces_lost"] += 1
            self._lost.append(self._robot_of[tap])
            return b""
        return bytes(self._buffer[:size])

    def _write(self, receiver: int, frame: bytes) -> None:
        try:
            os.write(self._interfaces[receiver].tap, frame)
        except OSError:  # a program has set it down, or deleted it
            self._counts["frames_refused_by_device"] += 1
            return
        self._delivered += 1
        self._delivered_bytes += len(frame)

    def _count_lateness(self, received_at_ns: list[int]) -> None:
        self._late_ns += self._pace.latencies_ns(received_at_ns)
        if len(self._late_ns) >= MANY_LATE:
            self._add_lateness()

    def _add_lateness(self) -> None:
        late_ns = np.array(self._late_ns, np.int64)
        self._late_ns.clear()
        self._delivery.add(late_ns)
        self._late += int((late_ns > to_ns(LATE_S)).sum())


def _as_packets(robot: int, frames: list[bytes]) -> SentPackets:
    """The frames that a robot's programs sent, as packets."""
    to, payloads = [addressee(frame) for frame in frames], [exchanged(frame) for frame in frames]
    return SentPackets(np.array([robot] * len(to)), np.array(to), Payloads.from_rows(payloads))


class InterfacesBackend:
    """A backend in real time with frames of interfaces beside its packets."""

    def __init__(self, backend: TimedBackend, ports: FramePorts, subtick_ns: int) -> None:
        """`subtick_ns` is the interval at which frames are read, in simulated time."""
        self._backend, self._ports, self._subtick_ns = backend, ports, subtick_ns
        self._waiting: list[SubtickPackets] = []  # in order, from one tick into the next
        self._reads = 0
        self.start, self.act, self.close = backend.start, backend.act, backend.close

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """As of the backend, whose medium also carries frames."""
        messages = self._ports.deliver(received)
        return self._backend.act_in_time(tick, readings, messages, tx_status, _MediumWithFrames(medium, self))

    def counts(self) -> dict[str, int]:
        """Faults of the backend and of the interfaces, by name."""
        return {**self._backend.counts(), **self._ports.counts()}

    def send_waiting(self, medium: SubtickMedium, until_ns: int) -> None:
        """Put the frames on the medium whose time has come."""
        while self._waiting and self._waiting[0].at_ns <= until_ns:
            put = self._waiting.pop(0)
            self._ports.count_sent(put.sent)
            medium.send(put)

    def exchange(self, received: ReceivedPackets, now_ns: int) -> ReceivedPackets:
        """Deliver frames and read new ones; returns the packets that are no frames."""
        messages, frames = self._ports.deliver(received), self._ports.take()
        if frames:
            from_ns = max(now_ns, self._waiting[-1].at_ns) if self._waiting else now_ns
            self._waiting += spread(frames, from_ns, self._subtick_ns, self._reads)
            self._reads += 1
        return messages


def spread(frames: Sequence[SentPackets], from_ns: int, subtick_ns: int, number: int) -> list[SubtickPackets]:
    """The frames of one reading, by robot, each robot's at a moment of its own within the subtick from `from_ns` on.

    Programs sent them at any moment of the subtick before. All at once they would collide, since a station that finds
    the medium idle sends at once. The frames of one robot alone need not wait. `number` of the reading keys the draws.
    """
    if len(frames) == 1:
        return [SubtickPackets(from_ns, None, frames[0])]
    offsets_ns = keyed_ns(SPREAD_KEY, number, SPREAD, np.full(len(frames), subtick_ns)).tolist()
    order = sorted(range(len(frames)), key=offsets_ns.__getitem__)
    return [SubtickPackets(from_ns + offsets_ns[k], None, frames[k]) for k in order]


class _MediumWithFrames:
    """A medium during a tick that takes frames from devices, and delivers frames to them."""

    def __init__(self, medium: SubtickMedium, frames: InterfacesBackend) -> None:
        self._medium, self._frames = medium, frames

    def send(self, packets: SubtickPackets) -> None:
        """As of the medium."""
        self._frames.send_waiting(self._medium, packets.at_ns)
        self._medium.send(packets)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """As of the medium, without frames; those that programs have sent by now are sent from `until_ns` on."""
        self._frames.send_waiting(self._medium, until_ns)
        received, tx_status = self._medium.advance(until_ns)
        return self._frames.exchange(received, until_ns), tx_status
