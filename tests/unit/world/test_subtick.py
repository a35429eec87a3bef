"""Sub-ticks."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST, NOWHERE
from swarmwire.comms.observe.interfaces import Observer, SubtickMedium, SubtickPackets
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.results import Results
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Fate, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, SparseTable
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import PacedBackend
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.subtick import SubtickRadio, Subticks
from swarmwire.world.world import World
from tests.support.agent.hosts import MEASURES, assignment, group, one_group, spec
from tests.support.agent.players import Word
from tests.support.clocks import MS, ORIGIN_NS, FakeClock
from tests.support.comms.radio import IEEE_802_15_4, RADIOS, RATE_HZ, TICK_NS, make_medium, scattered
from tests.support.world.mediums import ScriptedMedium
from tests.support.world.scenes import SAMPLE

AIRTIME_NS = 96_000  # airtime of three bytes
PACKET = SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.from_rows([b"\0\0"]))


def packet(sender: int, byte: int = 0) -> SentPackets:
    return SentPackets(np.array([sender]), np.array([BROADCAST]), Payloads.from_rows([bytes([0, 0, byte])]))


def static(robots: int, arenas: int = 1) -> Static:
    names = tuple(f"r{i}" for i in range(robots))
    return Static("", tuple(range(arenas)), RATE_HZ, (6.0, 5.0), "walls", ((),) * arenas, (), names)


def subtick_radio(radio: Radio, robots: int = 4, arenas: int = 1) -> SubtickRadio:
    return SubtickRadio(make_medium(radio, robots, range(arenas)), static(robots, arenas), lambda sent: sent)


def start_tick(medium: SubtickRadio, start_ns: int, robots: int = 4) -> tuple[Results, ReceivedPackets, TxStatuses]:
    """Step the medium with robots at rest and no disruption."""
    return medium.step(start_ns, scattered(robots), None, None)


def received_at(received: ReceivedPackets, receiver: int = 1) -> list[tuple[int, int]]:
    """Sender and time, but for the airtime, of the packets of one receiver."""
    rows = received.receiver == receiver
    times_ns = received.received_at_ns[rows] - AIRTIME_NS
    return list(zip(received.sender_index[rows].tolist(), times_ns.tolist(), strict=True))


def test_packet_sent_within_a_tick_is_received_within_it_once():
    medium = subtick_radio(Radio(99.0, latency_s=0.002))
    start_tick(medium, 0)
    medium.send(SubtickPackets(10 * MS, None, packet(0)))
    assert received_at(medium.advance(12 * MS)[0]) == []
    assert received_at(medium.advance(12 * MS + AIRTIME_NS)[0]) == [(0, 12 * MS)]
    assert received_at(medium.advance(13 * MS)[0]) == []
    results, late, _ = start_tick(medium, TICK_NS)
    assert received_at(results.received) == [(0, 12 * MS)]  # observers
    assert received_at(late) == []  # agents have it already


def test_packets_of_a_step_wait_for_their_slot_and_delay_no_others():
    medium = subtick_radio(Radio(99.0, send_offset=0.05))
    start_tick(medium, 0)
    medium.send(SubtickPackets(1 * MS, 0, packet(0)))
    medium.send(SubtickPackets(2 * MS, None, packet(0)))
    medium.send(SubtickPackets(60 * MS, 0, packet(2)))  # too late for its turn: at once
    assert received_at(medium.advance(100 * MS)[0]) == [(0, 2 * MS), (0, 50 * MS), (2, 60 * MS)]


@pytest.mark.parametrize("radio", [Radio(99.0), IEEE_802_15_4], ids=["disk", "phy"])
def test_packets_meet_the_poses_of_their_subtick(radio: Radio):
    medium, pose = subtick_radio(radio, 2), np.zeros((2, 4))
    pose[1, 0] = 9000.0  # out of range of both radios
    medium.step(0, pose, None, None)
    received_ms = list[int]()
    for at_ms, x_m in ((10, None), (20, 9.0), (30, 9000.0)):
        if x_m is not None:
            medium.set_poses(at_ms * MS, SparseTable(np.array([1]), np.array([0]), np.array([x_m])))
        medium.send(SubtickPackets(at_ms * MS, None, packet(0)))
        received_ms += (medium.advance((at_ms + 9) * MS)[0].received_at_ns // MS).tolist()
    results = medium.step(TICK_NS, pose, None, None)[0]
    assert received_ms == [20]
    assert results.tally.fates[0, [Fate.RECEIVED, Fate.OUT_OF_RANGE]].tolist() == [1, 2]


def test_packets_whose_slot_is_ticks_later_are_sent_or_in_flight():
    medium = subtick_radio(Radio(99.0, send_offset=0.25))
    start_tick(medium, 0)
    medium.send(SubtickPackets(1 * MS, 0, packet(0)))
    medium.send(SubtickPackets(2 * MS, 0, packet(1)))
    for tick in (1, 2):
        assert not len(start_tick(medium, tick * TICK_NS)[0].received)
    assert received_at(start_tick(medium, 3 * TICK_NS)[0].received) == [(0, 250 * MS)]
    medium.send(SubtickPackets(301 * MS, 3, packet(3)))
    medium.end()
    assert medium._medium.end().intended.sum() == 3


@settings(max_examples=60, deadline=None)
@given(RADIOS, st.integers(0, 1000), st.lists(st.integers(0, 99), max_size=30), st.booleans())
def test_fates_add_up_and_subticks_change_nothing(radio: Radio, seed: int, subticks_ms: list[int], one_leaves: bool):
    """Packets of steps and immediate ones in two arenas, one of which may leave; read in subticks, or only at ticks."""
    looked, not_looked = (packets_of_five_ticks(radio, seed, looks, one_leaves) for looks in (sorted(subticks_ms), []))
    assert looked == not_looked
    assert looked[1] == looked[2]


def packets_of_five_ticks(radio: Radio, seed: int, looks_ms: list[int], one_leaves: bool) -> tuple[Any, int, int]:
    rng = np.random.default_rng(seed)
    medium, robots = subtick_radio(radio, 5, 2), 5
    received, tallies = list[Any](), list[PacketCounts]()

    def collect(packets: ReceivedPackets) -> None:
        columns = packets.receiver, packets.sender_index, packets.sequence, packets.received_at_ns
        received.extend(zip(*(column.tolist() for column in columns), strict=True))

    for tick in range(5):
        start_ns = tick_start_ns(tick, RATE_HZ)
        news, late, _ = start_tick(medium, start_ns, 2 * robots)
        tallies.append(news.tally)
        collect(late)
        arenas = 1 if one_leaves and tick > 2 else 2
        packets = [
            (start_ns + int(at), int(rng.integers(0, arenas * robots)), bool(rng.integers(2)))
            for at in sorted(rng.integers(0, TICK_NS, 4))
        ]
        for at_ns, sender, at_once in sorted([*packets, *((start_ns + look * MS, -1, True) for look in looks_ms)]):
            if sender < 0:
                collect(medium.advance(at_ns)[0])
            else:
                medium.send(SubtickPackets(at_ns, None if at_once else tick, packet(sender)))
        collect(medium.advance(tick_start_ns(tick + 1, RATE_HZ))[0])  # end of the tick
        if one_leaves and tick == 2:
            over = np.array([False, True])
            medium.leave(over)
            tallies.append(medium._medium.leave(over))
    medium.end()
    tallies.append(medium._medium.end())
    total = sum(tallies[1:], tallies[0])
    return (sorted(received), total.fates.tolist(), total.in_range.tolist()), total.fates.sum(), total.intended.sum()


@dataclass
class Sender:
    """A backend whose robot 0 sends in the middle of each tick; it collects received packets."""

    invalid_to: int = 99
    received_packets: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    def start(self) -> None:
        """Ready."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        raise AssertionError("act_in_time is called instead")

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        start_ns = tick_start_ns(tick, 10)
        self.received_packets += received_at(received)
        medium.send(SubtickPackets(start_ns + 5 * MS, None, packet(0)))
        invalid = replace(packet(0), to=np.array([self.invalid_to]))
        medium.send(SubtickPackets(start_ns + 6 * MS, None, invalid))
        self.received_packets += received_at(medium.advance(start_ns + 50 * MS)[0])
        return Actions.joined([])

    def counts(self) -> dict[str, int]:
        return {}

    def close(self) -> None:
        """Nothing."""


class Tallies(Observer):
    """An observer that collects the tallies."""

    def __init__(self) -> None:
        self.tallies: list[PacketCounts] = []

    def see(self, truth: Truth) -> None:
        assert truth.tally
        assert truth.finished
        self.tallies.append(truth.tally)
        assert truth.tally.fates[:, truth.finished.fate].any() or not len(truth.finished.fate)


@pytest.mark.parametrize("invalid_to", [99, 0, NOWHERE - 1], ids=["no robot", "the sender", "below all sentinels"])
def test_loop_counts_packets_of_subticks_and_invalid_receivers(invalid_to: int):
    scenario = scenario_from(SAMPLE, "sample")
    world, backend, tally = World(scenario, [1], {}), Sender(invalid_to), Tallies()
    loop = Loop(world, new_medium(scenario, world, None), backend, [tally], timed=backend)
    loop.run(5)
    last = loop.end()
    assert last is not None
    total = sum(tally.tallies, last)
    assert int(total.sent.sum()) == 10
    assert total.fates.sum() == total.intended.sum()
    assert loop.counts()["packets_to_nobody"] == 5
    assert [sender for sender, _ in backend.received_packets] == [0] * len(backend.received_packets)


class OverAfter:
    """Stop conditions that end the second arena after so many ticks."""

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks

    def done(self) -> np.ndarray[Any, np.dtype[np.bool_]] | None:
        self.ticks -= 1
        return np.array([False, True]) if self.ticks == 0 else None


class FromBoth(Sender):
    """Robot 0 of each running arena sends in each tick."""

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        start_ns = tick_start_ns(tick, 10)
        for sender in (0, 15) if tick < 3 else (0,):
            medium.send(SubtickPackets(start_ns + 5 * MS, None, packet(sender)))
            medium.send(SubtickPackets(start_ns + 5 * MS, tick, packet(sender + 1)))
        medium.advance(start_ns + 99 * MS)
        return Actions.joined([])


def test_packets_of_an_arena_that_leaves_are_counted_or_in_flight():
    scenario = scenario_from(SAMPLE, "sample")
    world, backend, tally = World(scenario, [1, 2], {}), FromBoth(), Tallies()
    loop = Loop(world, new_medium(scenario, world, None), backend, [tally], stop_conditions=OverAfter(3), timed=backend)
    loop.run(6)
    last = loop.end()
    assert last is not None
    total = sum(tally.tallies, last)
    assert total.sent.tolist() == [12, 6]
    assert total.fates.sum(axis=1).tolist() == total.intended.tolist()
    assert loop.arena_ticks.tolist() == [6, 3]


@dataclass
class Exchange:
    """Agents that send at set wall times and collect what is delivered."""

    clock: FakeClock
    send_times_ns: list[int] = field(default_factory=list[int])
    work_ns: int = 0  # time of a delivery
    handed: list[tuple[int, int, int]] = field(default_factory=list[tuple[int, int, int]])

    def pop_sent(self) -> Sequence[SubtickPackets]:
        due = [at_ns for at_ns in self.send_times_ns if at_ns <= self.clock.time_ns]
        self.send_times_ns = [at_ns for at_ns in self.send_times_ns if at_ns > self.clock.time_ns]
        return [SubtickPackets(at_ns, None, PACKET) for at_ns in due]

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        self.clock.time_ns += self.work_ns
        self.handed.append((tick, at_ns, int(received.received_at_ns[0])))


def subticks_of(clock: FakeClock, factor: float = 1.0, subtick_s: float = 0.010) -> tuple[Pace, Subticks]:
    pace = Pace(clock, 10, factor, lambda _: None)
    return pace, Subticks(clock, pace, 10, subtick_s)


def test_subticks_send_packets_at_their_time_of_arrival() -> None:
    clock, medium = FakeClock(), ScriptedMedium(due_ns=[25 * MS])
    pace, subticks = subticks_of(clock)
    exchange = Exchange(clock, [ORIGIN_NS + 12 * MS, ORIGIN_NS + 19 * MS])
    pace.begin()
    subticks.pass_tick(0, medium, exchange)
    assert medium.times_ns == [*range(0, 100 * MS, 10 * MS), 100 * MS]
    assert [packets.at_ns for packets in medium.sent] == [12 * MS, 19 * MS]
    assert exchange.handed == [(0, 30 * MS, 25 * MS)]
    delays = pace.delivery.summary()
    assert delays is not None
    assert (delays.count, delays.worst_s) == (1, 0.005)
    assert clock.time_ns == ORIGIN_NS + 100 * MS


def test_subticks_follow_the_wall_clock_at_another_pace() -> None:
    clock, medium = FakeClock(), ScriptedMedium(due_ns=[130 * MS])
    pace, subticks = subticks_of(clock, factor=2.0)
    exchange = Exchange(clock)
    for tick in range(2):
        pace.begin()
        subticks.pass_tick(tick, medium, exchange)
    assert medium.times_ns[:3] == [0, 20 * MS, 40 * MS]
    assert exchange.handed == [(1, 140 * MS, 130 * MS)]
    delays = pace.delivery.summary()
    assert delays is not None
    assert delays.worst_s == 0.005


def test_subticks_are_skipped_while_the_loop_lags() -> None:
    clock, medium = FakeClock(), ScriptedMedium(due_ns=[1 * MS])
    pace, subticks = subticks_of(clock)
    exchange = Exchange(clock, [ORIGIN_NS + 250 * MS], work_ns=240 * MS)
    for tick in range(2):
        pace.begin()
        subticks.pass_tick(tick, medium, exchange)
    assert medium.times_ns == [0, 10 * MS, 100 * MS, 200 * MS]
    assert [packets.at_ns for packets in medium.sent] == [100 * MS]  # after the tick of the medium
    assert pace.missed_ticks == 2


def test_packets_that_arrive_during_a_pause_are_sent_in_the_next_tick() -> None:
    clock, medium = FakeClock(), ScriptedMedium()
    pace, subticks = subticks_of(clock)
    exchange = Exchange(clock)
    pace.begin()
    subticks.pass_tick(0, medium, exchange)
    exchange.send_times_ns = [clock.time_ns + 500 * MS]
    clock.time_ns += 3000 * MS
    pace.restart(1, 1.0, 3000 * MS)
    pace.begin()
    subticks.pass_tick(1, medium, exchange)
    assert [packets.at_ns for packets in medium.sent] == [100 * MS]
    assert medium.times_ns[-1] == 200 * MS
    assert pace.missed_ticks == 0


def test_tick_jitter_is_the_delay_after_the_previous_tick() -> None:
    clock = FakeClock()
    pace, _ = subticks_of(clock)
    for work_ms in (0, 3, 7):
        clock.time_ns += work_ms * MS
        pace.begin()
        pace.wait({0: 0, 3: 1, 7: 2}[work_ms])
    clock.time_ns += 500 * MS
    pace.restart(3, 1.0, 500 * MS)
    pace.begin()
    jitter = pace.jitter.summary()
    assert jitter is not None
    assert (jitter.count, jitter.worst_s) == (2, 0.007)
    assert jitter.p50_s == pytest.approx(0.003, rel=0.03)


def test_local_agents_receive_and_send_within_the_tick() -> None:
    clock = FakeClock()
    pace, subticks = subticks_of(clock)
    backend = PacedBackend(LocalBackend(assignment(group(spec("Echo"), [0, 1]))), pace, subticks)
    backend.start()
    medium = ScriptedMedium(due_ns=[25 * MS], payload=Word(number=1.0).encode())
    backend.act_in_time(0, one_group(0, [0, 1]), ReceivedPackets.none(MEASURES), NO_TX_STATUSES, medium)
    of_step, echo = medium.sent
    assert (of_step.at_ns, of_step.tick, of_step.sent.sender.tolist()) == (0, 0, [0, 1])
    assert (echo.at_ns, echo.tick, echo.sent.sender.tolist()) == (30 * MS, None, [1])
    report = backend.report()
    assert report.subtick_s == 0.010
    assert report.delivery is not None
    assert report.delivery.count == 1
    assert backend.act(1, one_group(1, [0, 1]), ReceivedPackets.none(MEASURES)).sent.sender.tolist() == [0, 1]
    backend.close()
