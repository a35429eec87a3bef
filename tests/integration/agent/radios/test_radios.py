from collections.abc import Generator
from contextlib import closing, contextmanager

import numpy as np
import pytest
import zenoh

from swarmwire.agent.radios import zenoh_radio
from swarmwire.agent.radios.radio import ReceivedPacket, RobotRadio, SentPacket
from swarmwire.agent.radios.tracker import Tracker
from swarmwire.agent.radios.world_radio import WorldRadio
from swarmwire.agent.radios.zenoh_radio import PacketHeader
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import Payloads, SentPackets
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import closed_after
from swarmwire.world.gateways.radio_bridge import BridgedRadio, RadioBridge
from tests.support.clocks import until
from tests.support.swarms import (
    ANY_PORT,
    KEYS,
    MAX_BYTES,
    ROBOTS,
    KeptLog,
    Wide,
    Word,
    meet,
    peers,
    radio,
    radios,
    received_by,
    words,
)

NEEDS = {"range_m": "radio.range", "bearing_rad": "radio.bearing", "rssi_dbm": "radio.rssi"}


@contextmanager
def by_zenoh() -> Generator[RobotRadio]:
    with peers(1) as (session,):
        yield radio(session, "flock-1")


@contextmanager
def by_zenoh_and_tracker() -> Generator[RobotRadio]:
    with peers(1) as (session,):
        yield radio(session, "flock-1", tracker=Tracker(session, KEYS, ROBOTS), needs_pose=True)


@contextmanager
def by_air() -> Generator[RobotRadio]:
    bridge = RadioBridge(
        Network(ANY_PORT), KEYS, {"flock-1": 1}, BridgedRadio(ROBOTS, 10, 100, ("rssi_dbm",), ("radio.rssi",))
    )
    with closing(bridge), closed_after(open_swarm(Network(connect=bridge.open()))) as session:
        opened = WorldRadio(session, KEYS, ROBOTS, "flock-1", WallClock())
        opened.open()
        yield opened


@pytest.fixture(params=[by_zenoh, by_zenoh_and_tracker, by_air])
def any_radio(request) -> Generator[RobotRadio]:
    with request.param() as opened:
        yield opened


def test_silence_is_an_empty_table_with_the_measures(any_radio):
    for _ in range(2):
        received, tx_status = any_radio.received(0)
        assert (len(received), len(tx_status)) == (0, 0)
        assert tuple(received.measured) == any_radio.measures
    assert any_radio.needs == {NEEDS[column] for column in any_radio.measures}


def test_sent_packets_are_counted(any_radio):
    any_radio.send(SentPackets.none())
    assert any_radio.counts() == {}
    any_radio.send(words(1.0, 2.0, row=1))
    assert any_radio.counts() == {"packets_sent": 2}
    assert all(type(count) is int for count in any_radio.counts().values())


def test_radio_may_be_closed_twice_and_read_afterwards(any_radio):
    any_radio.close()
    any_radio.close()
    assert len(any_radio.received(0)[0]) == 0


def packet(number: float = 1.0, to: int = BROADCAST, sequence: int = 0, sent_utc_ns: int = 0) -> bytes:
    return PacketHeader(to, sequence, sent_utc_ns).encode() + Word(number=number).encode()


def test_broadcast_is_received_by_all_others_with_sender_and_sequence():
    with radios(3) as (a, b, c):
        a.send(words(1.0, 2.0))
        b.send(words(3.0))
        assert received_by(a, 1) == [(1, 0, 3.0)]
        assert sorted(received_by(b, 2)) == [(0, 0, 1.0), (0, 1, 2.0)]
        assert sorted(received_by(c, 3)) == [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 3.0)]
        a.send(words(4.0))
        assert received_by(b, 1) == [(0, 2, 4.0)]
        assert received_by(c, 1) == [(0, 2, 4.0)]
        assert a.counts()["packets_sent"] == 3
        assert a.counts()["packets_received"] == 1


def test_received_packets_are_sorted_by_their_time():
    with radios(3) as (a, b, c):
        a.send(words(*range(20)))
        b.send(words(*range(20)))
        until(lambda: len(c._inbox._waiting) == 40)
        now_ns = 5 * NS_PER_S
        received, tx_status = c.received(now_ns)
        rows = list(
            zip(
                received.received_at_ns.tolist(),
                received.sender_index.tolist(),
                received.sequence.tolist(),
                strict=True,
            )
        )
        assert rows == sorted(rows)
        assert [sequence for _, sender, sequence in rows if sender == 0] == list(range(20))
        assert 0 < rows[0][0] <= rows[-1][0] <= now_ns
        assert received.receiver.tolist() == [2] * 40
        assert len(tx_status) == 0
        assert received.measured == {}


def test_addressed_packet_is_logged_by_others_as_overheard():
    logs = KeptLog(), KeptLog(), KeptLog()
    with peers(3) as sessions:
        a, b, c = (radio(s, robot, log=log) for s, robot, log in zip(sessions, ROBOTS, logs, strict=True))
        meet(sessions[0], [b, c])
        a.send(words(1.0, to=1))
        assert received_by(b, 1) == [(0, 0, 1.0)]
        until(lambda: len(c.received(0)[0]) or c.counts().get("packets_overheard"))
        assert c.counts().get("packets_received") is None
    (sent,), (overheard,), (received,) = logs[0].sent_packets, logs[2].received_packets, logs[1].received_packets
    assert sent == SentPacket(sent.utc_ns, sequence=0, to=1, size_bytes=6, tag=Word.tag, fate="sent")
    latency_ns = overheard.latency_ns
    assert latency_ns is not None
    assert 0 < latency_ns < NS_PER_S
    assert overheard == ReceivedPacket(
        sent.utc_ns + latency_ns, 0, 0, 1, 6, Word.tag, latency_ns, distance_m=None, delivered=False
    )
    assert received.delivered


def test_oversized_packet_has_a_sequence_but_is_not_sent():
    reports: list[str] = []
    log = KeptLog()
    with peers(2) as sessions:
        a, b = radio(sessions[0], ROBOTS[0], log=log, report=reports.append), radio(sessions[1], ROBOTS[1])
        meet(sessions[0], [b])
        large = Payloads.from_rows(
            [b"\1\2" + bytes(MAX_BYTES - 2), b"\1\2" + bytes(MAX_BYTES - 1), Word(number=3).encode()]
        )
        a.send(SentPackets(np.zeros(3, np.int64), np.full(3, BROADCAST), large))
        a.send(SentPackets(np.zeros(1, np.int64), np.full(1, BROADCAST), large.select(np.array([1]))))
        a.send(words(4.0))
        rows: list[int] = []

        def three() -> bool:
            received, _ = b.received(0)
            rows.extend(received.sequence.tolist())
            return len(rows) == 3

        until(three)
        assert rows == [0, 2, 4]
        assert a.counts()["packets_too_large"] == 2
    assert [packet.fate for packet in log.sent_packets] == ["sent", "too_large", "sent", "too_large", "sent"]
    assert len(reports) == 1
    assert f"{MAX_BYTES + 1} bytes" in reports[0]


def test_packet_to_a_missing_robot_or_the_sender_is_not_sent():
    with radios() as (a, b):
        a.send(words(1.0, to=0))
        a.send(words(1.0, to=3))
        a.send(words(2.0))
        assert received_by(b, 1) == [(0, 2, 2.0)]
        assert a.counts()["packets_to_nobody"] == 2


@pytest.mark.parametrize(
    ("key", "data", "counted"),
    [
        (KEYS.radio("stranger", Word.tag), packet(), "packets_of_unknown"),
        (KEYS.radio("flock-0", Word.tag), packet(), "packets_in_own_name"),
        (KEYS.radio("flock-1", Word.tag), b"", "packets_malformed"),
        (KEYS.radio("flock-1", Word.tag), b"\1", "packets_malformed"),
        (KEYS.radio("flock-1", Word.tag), bytes(40), "packets_malformed"),
        (KEYS.radio("flock-1", Word.tag), packet()[:-5], "packets_malformed"),
        (KEYS.radio("flock-1", Word.tag), packet(to=-2), "packets_malformed"),
        (KEYS.radio("flock-1", Word.tag), packet(to=1), "packets_malformed"),
        (KEYS.radio("flock-1", Word.tag), packet(to=3), "packets_malformed"),
        (KEYS.radio("flock-1", Wide.tag), packet(), "packets_malformed"),
        (f"{KEYS.root}/radio/flock-1/*", packet(), "packets_malformed"),
        (f"{KEYS.root}/**/flock-1/{Word.tag:04x}", packet(), "packets_malformed"),
        ("**", packet(), "packets_of_unknown"),
        (KEYS.radio("flock-1", Word.tag), packet() + bytes(MAX_BYTES), "packets_oversized"),
        (KEYS.radio("flock-1", Word.tag), packet() + bytes(10**6), "packets_oversized"),
    ],
)
def test_packet_against_the_protocol_is_counted_and_dropped(key, data, counted):
    with peers(2) as (session, other):
        a = radio(session, "flock-0")
        meet(other, [a])
        before = a.counts().get(counted, 0)
        # A megabyte fills the queue, and a busy machine takes longer to send it than a put waits that may be dropped.
        other.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK)
        proper = packet(7.0, sequence=3)
        other.put(KEYS.radio("flock-1", Word.tag), proper, congestion_control=zenoh.CongestionControl.BLOCK)
        assert received_by(a, 1) == [(1, 3, 7.0)]
        assert a.counts()[counted] == before + 1


def test_flood_beyond_the_inbox_is_counted_and_the_oldest_received(monkeypatch):
    monkeypatch.setattr(zenoh_radio, "MAX_WAITING", 50)
    with radios() as (a, b):
        a.send(words(*range(80)))
        until(lambda: b.counts().get("packets_dropped") == 30)
        assert [number for _, _, number in received_by(b, 50)] == list(range(50))
        a.send(words(80.0))
        assert received_by(b, 1) == [(0, 80, 80.0)]


def test_peer_that_returns_is_received_again():
    with peers(1) as (stays,):
        a = radio(stays, "flock-0")
        endpoint = endpoints_of(stays, Network(listen=ANY_PORT))
        for life in range(2):
            session = open_swarm(Network(connect=endpoint))
            b = radio(session, "flock-1")
            meet(session, [a])
            b.send(words(1.0, 2.0, 3.0 + life))
            assert [(1, 0, 1.0), (1, 1, 2.0), (1, 2, 3.0 + life)] == received_by(a, 3)
            session.close()
            b.send(words(5.0))
            assert b.counts()["packets_refused"] == 1
            b.close()


def test_peer_that_returns_at_its_endpoint_is_connected_again():
    with peers(1) as (first,):
        endpoint = endpoints_of(first, Network(listen=ANY_PORT))
        with closed_after(open_swarm(Network(connect=endpoint))) as caller:
            b = radio(caller, "flock-1")
            meet(first, [b])
            first.close()
            with closed_after(open_swarm(Network(listen=endpoint))) as again:
                meet(again, [b])
                radio(again, "flock-0").send(words(9.0))
                assert received_by(b, 1) == [(0, 0, 9.0)]


def test_closed_radio_receives_nothing():
    with radios() as (a, b):
        b.close()
        b.close()
        c = radio(b._session, "flock-2")
        meet(a._session, [c])
        a.send(words(1.0))
        assert received_by(c, 1) == [(0, 0, 1.0)]
        assert len(b.received(0)[0]) == 0
