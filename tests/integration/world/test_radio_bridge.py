"""The radio and the tracker of robots behind gateways."""

import math
from contextlib import contextmanager

import numpy as np
import pytest

from swarmwire.agent.radios import world_radio
from swarmwire.agent.radios.tracker import Tracker as RobotsTracker
from swarmwire.agent.radios.world_radio import WorldRadio
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxResult, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.world.gateways.radio_bridge import BridgedRadio, EmulatedTracker, RadioBridge
from tests.support.clocks import FakeClock, until
from tests.support.metrics.truths import static
from tests.support.refusals import refused_input
from tests.support.swarms import ANY_PORT, KEYS, ROBOTS, KeptLog, Wide, Word, peers, received_by, words

MEASURES = ("range_m", "bearing_rad")
AIR = BridgedRadio(ROBOTS, 10, 20, MEASURES, ("radio.range", "radio.bearing", "radio.tx_status"))
ROWS = {"flock-1": 1, "flock-2": 2}  # flock-0 is not behind the bridge
POSE = np.array([[1.0, 2.0, 0.5], [-1.0, 0.25, math.pi], [3.0, 0.0, -1.0]])
ALL = np.ones(3, np.bool_)


class DatedClock(FakeClock):
    """A clock with a date."""

    def utc_ns(self) -> int:
        return self.time_ns


@contextmanager
def bridged(medium=AIR):
    """A bridge, and a function that opens sessions to it."""
    bridge, sessions = RadioBridge(Network(listen=ANY_PORT), KEYS, ROWS, medium), []
    endpoints = bridge.open()

    def session():
        sessions.append(open_swarm(Network(connect=endpoints)))
        return sessions[-1]

    try:
        yield bridge, session
    finally:
        for opened in sessions:
            opened.close()
        bridge.close()
        bridge.close()


def joined_radio(session, robot="flock-1", clock=None, **options) -> WorldRadio:
    """A radio that has joined the bridge."""
    radio = WorldRadio(session, KEYS, ROBOTS, robot, clock or WallClock(), **options)
    radio.open()
    return radio


def received(*packets: tuple[int, int, int, int], payloads=None) -> ReceivedPackets:
    """Receiver, sender, sequence, and time of each packet, sorted; each is a word with its sequence."""
    columns = [np.array(column, np.int64) for column in zip(*packets, strict=True)]
    receiver, sender, sequence, at_ns = columns
    payloads = payloads or Payloads.from_rows([Word(number=float(number)).encode() for number in sequence])
    measured = {"range_m": 0.5 + sender, "bearing_rad": -0.5 * sender}
    return ReceivedPackets(receiver, sender, sequence, at_ns, measured, np.arange(len(packets)), payloads)


def exchange(bridge: RadioBridge, radio: WorldRadio) -> None:
    """Publish until the radio receives, and nothing is in flight."""
    row = ROWS[radio._robot]
    number = 1000

    def reached() -> bool:
        nonlocal number
        number += 1
        bridge.publish(0, received((row, 0, number, 0)), NO_TX_STATUSES)
        return len(radio.received(0)[0]) > 0

    until(reached)
    number += 1
    bridge.publish(0, received((row, 0, number, 0)), NO_TX_STATUSES)
    until(lambda: number in radio.received(0)[0].sequence.tolist())


def pop_packets(bridge: RadioBridge, packets: int) -> SentPackets:
    parts: list[SentPackets] = []
    until(lambda: parts.append(bridge.pop_packets()) or sum(map(len, parts)) >= packets)
    return SentPackets.joined(parts)


def test_last_notes_of_an_agent_reach_the_world_once():
    nothing = SparseTable.from_dense(np.array([0]), np.array([[math.nan]]))
    with bridged() as (bridge, session):
        radio = joined_radio(session())
        for state, value in (("search", 1.0), ("wait", 2.5)):
            row, slot = np.array([1]), np.zeros(1, np.int64)
            radio.note(SparseTable(row, slot, np.zeros(1), (state,)), SparseTable(row, slot, np.array([value])))
        radio.note(nothing, SparseTable(row, slot, np.array([3.5])))
        radio.send(words(1.0))
        until(lambda: len(bridge.pop_packets()))
        states, values = bridge.pop_notes()
        assert (states.rows.tolist(), states.names, states.integers.tolist()) == ([1], ("wait",), [0])
        assert (values.rows.tolist(), values.value.tolist()) == ([1], [3.5])
        assert [len(table) for table in bridge.pop_notes()] == [0, 0]


def test_packets_reach_the_bridge_with_rows_and_tx_status_ids():
    with bridged() as (bridge, session):
        first, second = joined_radio(session(), "flock-1"), joined_radio(session(), "flock-2")
        assert (first.measures, first.terms) == (MEASURES, AIR.info(1))
        payloads = Payloads.from_rows([Word(number=1).encode(), Wide(x_m=2, y_m=3).encode()])
        first.send(SentPackets(np.array([1, 1]), np.array([BROADCAST, 2]), payloads, np.array([-1, 7])))
        sent = pop_packets(bridge, 2)
        assert (sent.sender.tolist(), sent.to.tolist()) == ([1, 1], [BROADCAST, 2])
        assert sent.tx_status_ids.tolist() == [-1, 7]
        assert [sent.payloads.row(i) for i in range(2)] == [payloads.row(i) for i in range(2)]
        for number in range(5):
            second.send(words(float(number), row=2))
        sent = pop_packets(bridge, 5)
        assert sent.sender.tolist() == [2] * 5
        assert [Word.decode(sent.payloads.row(i)).number for i in range(5)] == [0, 1, 2, 3, 4]
        assert len(bridge.pop_packets()) == 0
        assert bridge.counts() == {"packets_from_robots": 7}


def test_bridge_delivers_packets_and_tx_status_to_each_robot():
    with bridged() as (bridge, session):
        first, second = joined_radio(session(), "flock-1"), joined_radio(session(), "flock-2")
        exchange(bridge, first)
        exchange(bridge, second)
        shared = Payloads.from_rows([Word(number=8).encode(), Word(number=9).encode()])
        receiver, sender, sequence, at_ns = np.array([[0, 1, 1, 2], [1, 0, 2, 0], [4, 8, 9, 8], [5, 6, 7, 8]])
        measured = {"range_m": np.arange(4.0), "bearing_rad": -np.arange(4.0)}
        table = ReceivedPackets(receiver, sender, sequence, at_ns, measured, np.array([1, 0, 1, 0]), shared)
        statuses = TxStatuses(np.array([0, 1, 2]), np.array([3, 4, 5]), np.array([0, TxResult.QUEUE_FULL, 0]))
        bridge.publish(7, table, statuses)
        results: list[tuple[ReceivedPackets, TxStatuses]] = []

        def results_of(radio: WorldRadio, count: int) -> tuple[ReceivedPackets, TxStatuses]:
            results.clear()
            until(lambda: results.append(radio.received(NS_PER_S)) or len(results[-1][0]) == count)
            return results[-1]

        packets, tx_status = results_of(first, 2)
        assert (packets.receiver.tolist(), packets.sender_index.tolist()) == ([1, 1], [0, 2])
        assert packets.sequence.tolist() == [8, 9]
        assert packets.measured["range_m"].tolist() == [1.0, 2.0]
        assert packets.measured["bearing_rad"].tolist() == [-1.0, -2.0]
        assert [Word.decode(packets.payloads.row(at)).number for at in packets.payload] == [8, 9]
        assert (tx_status.row.tolist(), tx_status.id.tolist()) == ([1], [4])
        assert tx_status.result.tolist() == [TxResult.QUEUE_FULL]
        packets, tx_status = results_of(second, 1)
        assert (packets.receiver.tolist(), packets.sequence.tolist(), tx_status.id.tolist()) == ([2], [8], [5])


def test_bridge_sends_no_frame_without_packets(monkeypatch):
    with bridged() as (bridge, _):
        published: list[int] = []
        encode = "swarmwire.world.gateways.radio_bridge.encode_bridged"
        monkeypatch.setattr(encode, lambda *_: published.append(1) or b"")
        bridge.publish(1, ReceivedPackets.none(MEASURES), NO_TX_STATUSES)
        bridge.publish(2, received((0, 1, 1, 1)), NO_TX_STATUSES)  # no receiver behind the bridge
        assert not published
        bridge.publish(3, received((1, 0, 1, 1), (1, 2, 2, 2), (2, 0, 3, 3)), NO_TX_STATUSES)
        assert len(published) == 2


def test_reception_times_follow_the_clock_of_the_agent():
    with bridged() as (bridge, session):
        log, clock = KeptLog(), DatedClock()
        radio = joined_radio(session(), clock=clock, log=log)
        exchange(bridge, radio)
        log.received_packets.clear()
        bridge.publish(20, received((1, 0, 5, 2 * NS_PER_S - 30_000_000)), NO_TX_STATUSES)
        until(lambda: len(radio._inbox._waiting) == 1)
        clock.time_ns += 10_000_000
        packets, _ = radio.received(5 * NS_PER_S)
        assert packets.received_at_ns.tolist() == [5 * NS_PER_S - 40_000_000]
        (packet,) = log.received_packets
        assert (packet.sender, packet.sequence, packet.to) == (0, 5, BROADCAST)
        assert (packet.latency_ns, packet.distance_m, packet.delivered) == (None, 0.5, True)


def test_oversized_packet_is_logged_and_sent_to_the_world():
    with bridged() as (bridge, session):
        log = KeptLog()
        radio = joined_radio(session(), log=log)
        large = Payloads.from_rows([bytes(20), bytes(21)])
        radio.send(SentPackets(np.full(2, 1), np.full(2, BROADCAST), large))
        assert pop_packets(bridge, 2).payloads.sizes.tolist() == [20, 21]
        assert [(packet.sequence, packet.fate) for packet in log.sent_packets] == [(0, "sent"), (1, "too_large")]
        assert radio.counts() == {"packets_sent": 1, "packets_too_large": 1}


@pytest.mark.parametrize(
    ("robot", "robots", "medium", "message"),
    [
        ("flock-0", ROBOTS, AIR, "lends its radio to: flock-1, flock-2"),
        ("flock-1", ROBOTS, None, "a world with a radio"),
        ("flock-1", ROBOTS[::-1], AIR, "in its order: flock-0, flock-1, flock-2"),
    ],
)
def test_robot_that_does_not_fit_the_world_is_refused(robot, robots, medium, message):
    with bridged(medium) as (_, session), refused_input(match=message):
        WorldRadio(session(), KEYS, robots, robot, WallClock()).open()


def test_missing_world_is_reported_after_a_timeout():
    session = open_swarm(Network(listen=ANY_PORT))
    clock = DatedClock()
    try:
        with refused_input(match="flock-1"):
            WorldRadio(session, KEYS, ROBOTS, "flock-1", clock, wall=clock).open()
    finally:
        close_session(session)
    assert clock.slept_until[-1] - clock.slept_until[0] > 5 * NS_PER_S


def test_slow_robot_counts_dropped_frames(monkeypatch):
    monkeypatch.setattr(world_radio, "MAX_WAITING", 10)
    with bridged() as (bridge, session):
        radio = joined_radio(session())
        exchange(bridge, radio)
        for tick in range(14):
            bridge.publish(tick, received((1, 0, tick, tick * NS_PER_S // 10)), NO_TX_STATUSES)
        until(lambda: radio.counts().get("frames_dropped") == 4)
        assert [number for _, number, _ in received_by(radio, 10)] == list(range(10))


def test_radio_and_bridge_survive_the_end_of_the_other():
    with bridged() as (bridge, session):
        radio = joined_radio(peer := session())
        bridge.close()
        radio.send(words(1.0))
        close_session(peer)
        radio.send(words(1.0))
        radio.close()
        assert radio.counts()["packets_refused"] == 1


@contextmanager
def trackers(truth, robots):
    """The tracker of a run, the tracker of a robot that subscribes to it, and their clock and session."""
    with peers(2) as (world, robot):
        tracker = RobotsTracker(robot, KEYS, robots)
        tracker.open()
        clock = DatedClock()
        emulated = EmulatedTracker(world, KEYS, clock)
        emulated.begin(truth)
        yield emulated, tracker, clock, world
        emulated.end()


def test_emulated_tracker_publishes_poses_of_living_robots():
    truth = static(3)
    with trackers(truth, truth.robot_names) as (emulated, tracker, clock, _):
        alive = np.array([True, False, True])
        until(lambda: (emulated.publish(POSE, alive), tracker.pose("flock-2", clock.utc_ns()))[1])
        poses = [tracker.pose(name, clock.utc_ns()) for name in truth.robot_names]
        assert poses == [tuple(POSE[0]), None, tuple(POSE[2])]
        clock.time_ns += 2_000_000_000
        assert tracker.pose("flock-0", clock.utc_ns()) is None
        emulated.publish(POSE + 1.0, alive)
        until(lambda: tracker.pose("flock-2", clock.utc_ns()) == tuple(POSE[2] + 1.0))
        assert tracker.counts() == {"poses_malformed": 0, "poses_of_unknown": 0}
        assert emulated.counts() == {}


def test_emulated_tracker_publishes_the_first_arena():
    truth = static(1, arenas=3)
    with trackers(truth, truth.robot_names) as (emulated, tracker, clock, _):
        pose = until(lambda: (emulated.publish(POSE, ALL), tracker.pose("flock-0", clock.utc_ns()))[1])
        assert pose == tuple(POSE[0])


def test_emulated_tracker_counts_poses_after_the_network_is_closed():
    truth = static(3)
    with trackers(truth, truth.robot_names) as (emulated, _, _, world):
        world.close()
        emulated.publish(POSE, ALL)
        assert emulated.counts() == {"tracker_poses_refused": 3}
        emulated.end()
