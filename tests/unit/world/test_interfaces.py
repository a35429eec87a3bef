"""Addresses of robots' interfaces, and their frames as packets, without a kernel's devices."""

import socket
from collections.abc import Callable, Generator
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
import pytest

from swarmwire.comms.base.ethernet import FRAME_TAG, LATE_S, exchanged, station
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.interfaces import SubtickMedium, SubtickPackets
from swarmwire.comms.radio.config.checks import check_radio
from swarmwire.comms.radio.config.radio import Interface, Radio
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.ports import PortsBackend
from swarmwire.world.interfaces.addresses import Addresses, addresses_of, check_unused
from swarmwire.world.interfaces.frame_ports import INTERFACE_LOST, MAX_READS, FramePorts
from tests.support.clocks import MS, FakeClock
from tests.support.refusals import refused_input
from tests.support.world.mediums import ScriptedMedium

ROBOTS = 3
IPV4 = b"\x08\x00"
ETHERNET_BROADCAST = b"\xff" * 6
ROUTES = """Iface	Destination	Gateway 	Flags	RefCnt	Use	Metric	Mask		MTU	Window	IRTT
eth0	00000000	010200C0	0003	0	0	0	00000000	0	0	0
eth0	00034D0A	00000000	0001	0	0	0	00FFFFFF	0	0	0
vpn0	0000000A	010200C0	0003	0	0	0	000000FF	0	0	0
"""  # eth0 is in 10.77.3.0/24, and vpn0 leads to 10.0.0.0/8


@dataclass
class Device:
    """A socket in place of a TAP device; programs write to the other end."""

    addresses: Addresses
    tap: int
    program: socket.socket
    changes: socket.socket  # notices of link changes
    ends: socket.socket  # readable after the end of the process whose namespace it is
    restored: int = 0
    is_closed: bool = False

    @property
    def link_changes(self) -> int:
        return self.changes.fileno()

    @property
    def process(self) -> int:
        return self.ends.fileno()

    def close(self) -> None:
        self.is_closed = True

    def restore_routes(self) -> None:
        self.changes.recv(2048)
        self.restored += 1


@dataclass
class Rig:
    ports: FramePorts
    devices: list[Device]
    clock: FakeClock

    def send(self, robot: int, to: bytes, data: bytes = b"data", source: bytes | None = None) -> bytes:
        frame = to + (station(robot) if source is None else source) + IPV4 + data
        self.devices[robot].program.send(frame)
        return frame

    def pop_sent(self) -> SentPackets:
        return SentPackets.joined(self.ports.pop_packets())

    def received_frames(self, robot: int) -> list[bytes]:
        frames: list[bytes] = []
        while True:
            try:
                frames.append(self.devices[robot].program.recv(2048))
            except BlockingIOError:
                return frames


@pytest.fixture
def rig() -> Generator[Rig]:
    with ExitStack() as stack:
        devices: list[Device] = []
        for addresses in addresses_of(Interface(), ROBOTS, 1500, ""):
            world, program = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            for end in (world, program):
                stack.enter_context(end)
                end.setblocking(False)
            changes, ends = (stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) for _ in range(2))
            for notices in (changes, ends):
                notices.bind("")  # the kernel chooses the address
            devices.append(Device(addresses, world.fileno(), program, changes, ends))
        clock = FakeClock()
        pace = Pace(clock, 10, 1.0, lambda _: None)
        pace.begin()
        ports = FramePorts(devices, pace)
        stack.callback(ports.close)
        yield Rig(ports, devices, clock)


def received(*packets: tuple[int, bytes, int]) -> ReceivedPackets:
    """Packets of a receiver, with a payload and a time of reception."""
    receiver, payloads, at_ns = zip(*packets, strict=True)
    numbers = np.arange(len(packets))
    payload = Payloads.from_rows(list(payloads))
    return ReceivedPackets(np.array(receiver), numbers, numbers, np.array(at_ns), {}, numbers, payload)


def test_robots_have_the_first_addresses_of_the_network():
    first, *_, last = addresses_of(Interface("192.168.7.0/28"), 14, 1500, "")
    assert first.mac_text == "02:53:57:00:00:01"
    assert (str(first.ipv4), str(last.ipv4)) == ("192.168.7.1/28", "192.168.7.14/28")
    assert (str(first.ipv6), str(last.ipv6)) == ("fd53:57::1/64", "fd53:57::e/64")


def test_network_with_too_few_addresses_is_refused():
    with refused_input(key="radio.interface.network", match="at least 15 addresses"):
        addresses_of(Interface("192.168.7.0/28"), 15, 1500, "")


def test_ipv6_needs_its_smallest_mtu():
    assert [addresses_of(Interface(), 1, mtu, "")[0].ipv6 is None for mtu in (1279, 1280)] == [True, False]


@pytest.mark.parametrize("network", ["10.77.0.0/16", "10.77.3.128/25"])
def test_network_in_use_on_the_machine_is_refused(network):
    with refused_input(match="eth0 has 10.77.3.0/24"):
        check_unused(Interface(network), "", ROUTES)


def test_network_behind_a_gateway_is_accepted():
    check_unused(Interface("10.78.0.0/16"), "", ROUTES)


@pytest.mark.parametrize("network", ["10.77.0.1/16", "fd00::/64", "robots", "127.8.0.0/16", "224.1.0.0/24"])
def test_network_must_be_ipv4(network):
    with refused_input(key="radio.interface.network"):
        check_radio(Radio(range_m=1.0, interface=Interface(network)), "")


def test_radio_with_payloads_too_small_for_ipv4_is_refused():
    with refused_input(key="radio.max_payload_bytes"):
        check_radio(Radio(range_m=1.0, max_payload_bytes=81, interface=Interface()), "")
    check_radio(Radio(range_m=1.0, max_payload_bytes=82, interface=Interface()), "")


@pytest.mark.parametrize(
    ("to", "expected"),
    [
        (station(2), 2),
        (ETHERNET_BROADCAST, BROADCAST),
        (bytes.fromhex("01005e0000fb"), BROADCAST),  # IPv4 multicast
        (bytes.fromhex("333300000001"), BROADCAST),  # IPv6 multicast
    ],
)
def test_frame_becomes_a_packet_to_its_receiver(rig, to, expected):
    frame = rig.send(1, to)
    sent = rig.pop_sent()
    assert (sent.sender.tolist(), sent.to.tolist()) == ([1], [expected])
    assert exchanged(sent.payloads.row(0)) == frame
    assert sent.payloads.tags().tolist() == [FRAME_TAG]


@pytest.mark.parametrize("to", [bytes.fromhex("025357000000"), bytes.fromhex("0a0b0c0d0e0f"), station(ROBOTS)])
def test_frame_to_a_foreign_address_has_no_receiver(rig, to):
    rig.send(0, to)
    assert rig.pop_sent().to[0] >= ROBOTS


def test_frames_with_a_foreign_source_are_counted_and_dropped(rig):
    rig.send(0, station(1), source=station(2))
    assert not len(rig.pop_sent())
    assert rig.ports.counts() == {"frames_of_other_stations": 1}


def test_flood_of_frames_waits_for_the_next_subtick(rig):
    for _ in range(MAX_READS + 1):
        rig.send(0, station(1))
    rig.send(2, station(1))
    assert [len(rig.pop_sent()) for _ in range(3)] == [MAX_READS + 1, 1, 0]


def test_received_frames_go_to_devices_and_messages_to_agents(rig):
    frame = station(2) + station(0) + IPV4 + b"data"
    messages = rig.ports.deliver(received((1, b"\1\0message", 5), (2, exchanged(frame), 5), (2, b"\2\0", 6)))
    assert [messages.payloads.row(row) for row in messages.payload] == [b"\1\0message", b"\2\0"]
    assert [rig.received_frames(robot) for robot in range(ROBOTS)] == [[], [], [frame]]


def test_frames_arrive_in_the_order_of_their_reception(rig):
    frames = [station(1) + station(0) + IPV4 + bytes([i]) for i in range(3)]
    rig.ports.deliver(received(*((1, exchanged(frames[i]), at_ns) for i, at_ns in ((0, 1), (2, 9), (1, 4)))))
    assert rig.received_frames(1) == frames


def test_late_deliveries_are_counted(rig):
    frame = exchanged(station(1) + station(0) + IPV4)
    rig.clock.time_ns += 10 * MS
    limit_ns = round(LATE_S * 1000) * MS
    rig.ports.deliver(received((1, frame, 10 * MS), (1, frame, 10 * MS - limit_ns), (1, frame, 10 * MS - limit_ns - 1)))
    report = rig.ports.report()
    assert (report.delivered, report.delivered_bytes, report.late) == (3, 3 * len(frame), 1)
    assert report.delivery is not None
    assert report.delivery.count == 3
    assert report.delivery.worst_s == pytest.approx(LATE_S, rel=0.01)


class TickingBackend:
    """A backend whose tick is a list of calls on its medium."""

    def __init__(self, advances: list[Callable[[SubtickMedium], None]]) -> None:
        self._advances = advances
        self.start = self.act = self.close = None

    def act_in_time(self, tick, readings, received, tx_status, medium) -> None:
        for advance in self._advances:
            advance(medium)

    def counts(self) -> dict[str, int]:
        return {}


def test_frames_of_several_robots_are_sent_at_different_times(rig):
    """Frames of the same moment would collide on a radio with carrier sense."""

    def first(medium: SubtickMedium) -> None:
        for robot in (2, 0, 1, 0):
            rig.send(robot, ETHERNET_BROADCAST)
        medium.advance(10 * MS)

    medium = ScriptedMedium()
    ticking = TickingBackend([first, lambda medium: medium.advance(11 * MS), lambda medium: medium.advance(12 * MS)])
    PortsBackend(ticking, rig.ports, MS).act_in_time(0, {}, ReceivedPackets.none(), NO_TX_STATUSES, medium)
    times_ns = [packets.at_ns for packets in medium.sent]
    assert times_ns == sorted(set(times_ns))
    assert 10 * MS < times_ns[0] < times_ns[-1] < 11 * MS
    assert sorted(packets.sent.sender.tolist() for packets in medium.sent) == [[0, 0], [1], [2]]
    assert rig.ports.report().sent == 4


def test_frames_of_a_single_robot_are_sent_at_once_in_order(rig):
    def first(medium: SubtickMedium) -> None:
        for to in (1, 2, 1):
            rig.send(0, station(to))
        medium.advance(10 * MS)

    medium = ScriptedMedium()
    message = SubtickPackets(10 * MS + 5, 3, SentPackets(np.array([1]), np.array([0]), Payloads.from_rows([b"\1\0"])))
    ticking = TickingBackend([first, lambda medium: medium.send(message), lambda medium: medium.advance(11 * MS)])
    PortsBackend(ticking, rig.ports, MS).act_in_time(0, {}, ReceivedPackets.none(), NO_TX_STATUSES, medium)
    sent = [(packets.at_ns, packets.sent.sender.tolist()) for packets in medium.sent]
    assert sent == [(10 * MS, [0, 0, 0]), (10 * MS + 5, [1])]


def test_packet_of_an_agent_that_passes_for_a_frame_is_dropped_and_counted(rig):
    spoofed, message = exchanged(station(1) + station(0) + IPV4), b"\1\0"
    sent = SentPackets(np.array([0, 1]), np.array([1, 0]), Payloads.from_rows([spoofed, message]))
    medium = ScriptedMedium()
    steps = [lambda medium: medium.send(SubtickPackets(MS, None, sent)), lambda medium: medium.advance(MS)]
    backend = PortsBackend(TickingBackend(steps), rig.ports, MS)
    backend.act_in_time(0, {}, ReceivedPackets.none(), NO_TX_STATUSES, medium)
    assert [packets.sent.sender.tolist() for packets in medium.sent] == [[1]]
    assert backend.counts()["packets_with_reserved_tag"] == 1


def test_frame_that_a_device_refuses_is_counted(rig):
    rig.devices[1].program.close()
    rig.ports.deliver(received((1, exchanged(station(1) + station(0) + IPV4), 1)))
    assert rig.ports.counts() == {"frames_refused_by_device": 1}
    assert rig.ports.report().delivered == 0


def test_interface_lost_by_one_robot_is_an_event_and_others_go_on(rig):
    rig.ports.deliver(received((1, exchanged(station(1) + station(0) + IPV4), 1)))
    rig.devices[1].program.close()  # has an unread frame: reads and writes fail afterwards
    frame = rig.send(0, station(2))
    assert [exchanged(rig.pop_sent().payloads.row(0)), len(rig.pop_sent())] == [frame, 0]
    rig.ports.deliver(received((1, exchanged(frame), 2)))
    assert rig.ports.counts() == {"interfaces_lost": 1, "frames_refused_by_device": 1}
    (event,) = rig.ports.pop_events(5 * MS)
    assert (event.do, event.at_s, event.changed.tolist()) == (INTERFACE_LOST, 0.005, [False, True, False])
    assert rig.ports.pop_events(6 * MS) == ()


def test_routes_are_restored_where_links_change(rig):
    device = rig.devices[2]
    device.changes.sendto(b"change", device.changes.getsockname())
    assert not len(rig.pop_sent())
    assert [each.restored for each in rig.devices] == [0, 0, 1]


def test_robot_leaves_a_namespace_whose_process_ends_and_others_go_on(rig):
    rig.devices[1].ends.sendto(b"end", rig.devices[1].ends.getsockname())
    frame = rig.send(0, station(2))
    sent = [SentPackets.joined(rig.ports.pop_packets()) for _ in range(2)]
    assert [len(packets) for packets in sent] == [1, 0]
    assert exchanged(sent[0].payloads.row(0)) == frame
    (event,) = rig.ports.pop_events(5 * MS)
    assert (event.do, event.changed.tolist()) == (INTERFACE_LOST, [False, True, False])
    assert rig.ports.counts() == {"interfaces_lost": 1}
    assert [device.is_closed for device in rig.devices] == [False, True, False]
