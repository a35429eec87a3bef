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
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
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
from tests.support.comms.radio import RADIOS, RATE_HZ, TICK_NS, make_medium, scattered
from tests.support.world.scenes import SAMPLE

AIRTIME_NS = 96_000  # of a packet's three bytes
PACKET = SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.from_rows([b"\0\0"]))


def packet(sender: int, byte: int = 0) -> SentPackets:
    return SentPackets(np.array([sender]), np.array([BROADCAST]), Payloads.from_rows([bytes([0, 0, byte])]))


def static(robots: int, arenas: int = 1) -> Static:
    names = tuple(f"r{i}" for i in range(robots))
    return Static("", tuple(range(arenas)), RATE_HZ, (6.0, 5.0), "walls", ((),) * arenas, (), names)


def in_time(radio: Radio, robots: int = 4, arenas: int = 1) -> SubtickRadio:
    return SubtickRadio(make_medium(radio, robots, range(arenas)), static(robots, arenas), lambda sent: sent)


def begun(medium: SubtickRadio, start_ns: int, robots: int = 4) -> tuple[Results, ReceivedPackets, TxStatuses]:
    """A tick with robots at rest, and nothing disrupted."""
    return medium.step(start_ns, scattered(robots), None, None)


def received_at(received: ReceivedPackets, receiver: int = 1) -> list[tuple[int, int]]:
    """Sender and time, but for the airtime, of what one robot received."""
    mine = received.receiver == receiver
    return list(
        zip(received.sender_index[mine].tolist(), (received.received_at_ns[mine] - AIRTIME_NS).tolist(), strict=True)
    )


def test_a_packet_put_on_the_air_within_a_tick_is_received_within_it_once():
    medium = in_time(Radio(99.0, latency_s=0.002))
    begun(medium, 0)
    medium.send(SubtickPackets(10 * MS, None, packet(0)))
    assert received_at(medium.advance(12 * MS)[0]) == []
    assert received_at(medium.advance(12 * MS + AIRTIME_NS)[0]) == [(0, 12 * MS)]
    assert received_at(medium.advance(13 * MS)[0]) == []
    told, rest, _ = begun(medium, TICK_NS)
    assert (received_at(told.received), received_at(rest)) == (
        [(0, 12 * MS)],
        [],
    )  # observers learn of it, agents have it


def test_what_a_step_sent_waits_for_its_robots_turn_and_holds_up_nothing_that_is_sent_at_once():
    medium = in_time(Radio(99.0, send_offset=0.05))
    begun(medium, 0)
    medium.send(SubtickPackets(1 * MS, 0, packet(0)))
    medium.send(SubtickPackets(2 * MS, None, packet(0)))
    medium.send(SubtickPackets(60 * MS, 0, packet(2)))  # too late for its turn: at once
    assert received_at(medium.advance(100 * MS)[0]) == [(0, 2 * MS), (0, 50 * MS), (2, 60 * MS)]


def test_a_turn_may_come_ticks_later_and_what_still_waits_at_the_end_is_in_flight():
    medium = in_time(Radio(99.0, send_offset=0.25))
    begun(medium, 0)
    medium.send(SubtickPackets(1 * MS, 0, packet(0)))
    medium.send(SubtickPackets(2 * MS, 0, packet(1)))
    for tick in (1, 2):
        assert not len(begun(medium, tick * TICK_NS)[0].received)
    assert received_at(begun(medium, 3 * TICK_NS)[0].received) == [(0, 250 * MS)]
    medium.send(SubtickPackets(301 * MS, 3, packet(3)))
    medium.end()
    assert medium._medium.end().intended.sum() == 3


@settings(max_examples=60, deadline=None)
@given(RADIOS, st.integers(0, 1000), st.lists(st.integers(0, 99), max_size=30), st.booleans())
def test_fates_add_up_and_subticks_change_nothing(radio: Radio, seed: int, subticks_ms: list[int], one_leaves: bool):
    """Packets of steps and at once, in two arenas, one of which may leave; looked at now and then, or only at ticks."""
    looked, not_looked = (_played(radio, seed, looks, one_leaves) for looks in (sorted(subticks_ms), []))
    assert looked == not_looked
    assert looked[1] == looked[2]


def _played(radio: Radio, seed: int, looks_ms: list[int], one_leaves: bool) -> tuple[Any, int, int]:
    rng = np.random.default_rng(seed)
    medium, robots = in_time(radio, 5, 2), 5
    received, tallies = list[Any](), list[PacketCounts]()

    def keep(told: ReceivedPackets) -> None:
        columns = told.receiver, told.sender_index, told.sequence, told.received_at_ns
        received.extend(zip(*(column.tolist() for column in columns), strict=True))

    for tick in range(5):
        start_ns = tick_start_ns(tick, RATE_HZ)
        news, rest, _ = begun(medium, start_ns, 2 * robots)
        tallies.append(news.tally)
        keep(rest)
        arenas = 1 if one_leaves and tick > 2 else 2
        puts = [
            (start_ns + int(at), int(rng.integers(0, arenas * robots)), bool(rng.integers(2)))
            for at in sorted(rng.integers(0, TICK_NS, 4))
        ]
        for at_ns, sender, at_once in sorted([*puts, *((start_ns + look * MS, -1, True) for look in looks_ms)]):
            if sender < 0:
                keep(medium.advance(at_ns)[0])
            else:
                medium.send(SubtickPackets(at_ns, None if at_once else tick, packet(sender)))
        keep(medium.advance(tick_start_ns(tick + 1, RATE_HZ))[0])  # as at the end of each tick
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
    """A backend whose robot 0 sends in the middle of each tick, and which notes what it is handed."""

    invalid_to: int = 99
    told: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    def start(self) -> None:
        """Ready."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        raise AssertionError("a backend that takes its time is asked in time")

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        start_ns = tick_start_ns(tick, 10)
        self.told += received_at(received)
        medium.send(SubtickPackets(start_ns + 5 * MS, None, packet(0)))
        invalid = replace(packet(0), to=np.array([self.invalid_to]))
        medium.send(SubtickPackets(start_ns + 6 * MS, None, invalid))
        self.told += received_at(medium.advance(start_ns + 50 * MS)[0])
        return Actions.joined([])

    def counts(self) -> dict[str, int]:
        return {}

    def close(self) -> None:
        """Nothing."""


class Tallies(Observer):
    """An observer that adds up what it is told."""

    def __init__(self) -> None:
        self.tallies: list[PacketCounts] = []

    def see(self, truth: Truth) -> None:
        assert truth.tally
        assert truth.finished
        self.tallies.append(truth.tally)
        assert truth.tally.fates[:, truth.finished.fate].any() or not len(truth.finished.fate)


@pytest.mark.parametrize("invalid_to", [99, 0, NOWHERE - 1], ids=["no robot", "the sender", "below all sentinels"])
def test_the_loop_shows_observers_what_was_received_within_a_tick_and_counts_what_was_sent_to_nobody(invalid_to: int):
    scenario = scenario_from(SAMPLE, "sample")
    world, backend, seen = World(scenario, [1], {}), Sender(invalid_to), Tallies()
    loop = Loop(world, new_medium(scenario, world, None), backend, [seen], timed=backend)
    loop.run(5)
    last = loop.end()
    assert last is not None
    total = sum(seen.tallies, last)
    assert int(total.sent.sum()) == 10
    assert total.fates.sum() == total.intended.sum()
    assert loop.counts()["packets_to_nobody"] == 5
    assert [sender for sender, _ in backend.told] == [0] * len(backend.told)


class OverAfter:
    """A judge that finds the second arena over after so many ticks."""

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks

    def done(self) -> np.ndarray[Any, np.dtype[np.bool_]] | None:
        self.ticks -= 1
        return np.array([False, True]) if self.ticks == 0 else None


class FromBoth(Sender):
    """Robot 0 of each arena sends late in each tick, also where the arena is over."""

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        start_ns = tick_start_ns(tick, 10)
        for sender in (0, 15) if tick < 3 else (0,):
            medium.send(SubtickPackets(start_ns + 5 * MS, None, packet(sender)))
            medium.send(SubtickPackets(start_ns + 5 * MS, tick, packet(sender + 1)))
        medium.advance(start_ns + 99 * MS)
        return Actions.joined([])


def test_of_an_arena_that_leaves_what_was_received_within_its_last_tick_counts_and_the_rest_is_in_flight():
    scenario = scenario_from(SAMPLE, "sample")
    world, backend, seen = World(scenario, [1, 2], {}), FromBoth(), Tallies()
    loop = Loop(world, new_medium(scenario, world, None), backend, [seen], stop_conditions=OverAfter(3), timed=backend)
    loop.run(6)
    last = loop.end()
    assert last is not None
    total = sum(seen.tallies, last)
    assert total.sent.tolist() == [12, 6]
    assert total.fates.sum(axis=1).tolist() == total.intended.tolist()
    assert loop.arena_ticks.tolist() == [6, 3]


def received(at_ns: int, payload: bytes = b"\0\0") -> ReceivedPackets:
    """One packet of robot 0 to robot 1."""
    given = {name: np.zeros(1) for name in MEASURES}
    one = np.zeros(1, np.int64)
    return ReceivedPackets(one + 1, one, one, one + at_ns, given, one, Payloads.from_rows([payload]))


@dataclass
class RadioMedium:
    """a medium that notes what is asked of it, and lets packets be received at set times."""

    due_ns: list[int] = field(default_factory=list[int])
    payload: bytes = b"\0\0"
    puts: list[SubtickPackets] = field(default_factory=list[SubtickPackets])
    times_ns: list[int] = field(default_factory=list[int])

    def send(self, packets: SubtickPackets) -> None:
        assert packets.at_ns >= (self.times_ns or [0])[-1]
        self.puts.append(packets)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        self.times_ns.append(until_ns)
        if self.due_ns and self.due_ns[0] <= until_ns:
            return received(self.due_ns.pop(0), self.payload), NO_TX_STATUSES
        return ReceivedPackets.none(MEASURES), NO_TX_STATUSES


@dataclass
class Exchange:
    """Agents that send at set wall times, and note what they are handed."""

    clock: FakeClock
    sends_ns: list[int] = field(default_factory=list[int])
    work_ns: int = 0  # that handing over takes
    handed: list[tuple[int, int, int]] = field(default_factory=list[tuple[int, int, int]])

    def pop_sent(self) -> Sequence[SubtickPackets]:
        came = [at_ns for at_ns in self.sends_ns if at_ns <= self.clock.time_ns]
        self.sends_ns = [at_ns for at_ns in self.sends_ns if at_ns > self.clock.time_ns]
        return [SubtickPackets(at_ns, None, PACKET) for at_ns in came]

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        self.clock.time_ns += self.work_ns
        self.handed.append((tick, at_ns, int(received.received_at_ns[0])))


def subticks_of(clock: FakeClock, factor: float = 1.0, subtick_s: float = 0.010) -> tuple[Pace, Subticks]:
    pace = Pace(clock, 10, factor, lambda _: None)
    return pace, Subticks(clock, pace, 10, subtick_s)


def test_the_loop_wakes_every_subtick_and_packets_go_on_the_air_when_they_came() -> None:
    clock, medium = FakeClock(), RadioMedium(due_ns=[25 * MS])
    pace, subticks = subticks_of(clock)
    exchange = Exchange(clock, [ORIGIN_NS + 12 * MS, ORIGIN_NS + 19 * MS])
    pace.begin()
    subticks.pass_tick(0, medium, exchange)
    assert medium.times_ns == [*range(0, 100 * MS, 10 * MS), 100 * MS]
    assert [put.at_ns for put in medium.puts] == [12 * MS, 19 * MS]
    assert exchange.handed == [(0, 30 * MS, 25 * MS)]
    delays = pace.delivery.summary()
    assert delays is not None
    assert (delays.count, delays.worst_s) == (1, 0.005)
    assert clock.time_ns == ORIGIN_NS + 100 * MS


def test_at_another_pace_subticks_are_of_the_wall_clock_and_times_of_the_simulation() -> None:
    clock, medium = FakeClock(), RadioMedium(due_ns=[130 * MS])
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


def test_a_loop_that_lags_makes_up_for_no_subtick_and_its_air_never_leaves_the_tick() -> None:
    clock, medium = FakeClock(), RadioMedium(due_ns=[1 * MS])
    pace, subticks = subticks_of(clock)
    exchange = Exchange(clock, [ORIGIN_NS + 250 * MS], work_ns=240 * MS)
    for tick in range(2):
        pace.begin()
        subticks.pass_tick(tick, medium, exchange)
    assert medium.times_ns == [0, 10 * MS, 100 * MS, 200 * MS]
    assert [put.at_ns for put in medium.puts] == [100 * MS]  # it came after the tick that is under way for the medium
    assert pace.missed_ticks == 2


def test_what_came_while_the_run_was_paused_is_of_the_tick_that_follows() -> None:
    clock, medium = FakeClock(), RadioMedium()
    pace, subticks = subticks_of(clock)
    exchange = Exchange(clock)
    pace.begin()
    subticks.pass_tick(0, medium, exchange)
    exchange.sends_ns = [clock.time_ns + 500 * MS]
    clock.time_ns += 3000 * MS
    pace.restart(1, 1.0, 3000 * MS)
    pace.begin()
    subticks.pass_tick(1, medium, exchange)
    assert [put.at_ns for put in medium.puts] == [100 * MS]
    assert medium.times_ns[-1] == 200 * MS
    assert pace.missed_ticks == 0


def test_tick_jitter_is_what_a_tick_began_after_the_end_of_the_one_before() -> None:
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


def test_agents_in_this_process_hear_within_the_tick_and_what_they_send_goes_out_at_once() -> None:
    clock = FakeClock()
    pace, subticks = subticks_of(clock)
    backend = PacedBackend(LocalBackend(assignment(group(spec("Echo"), [0, 1]))), pace, subticks)
    backend.start()
    medium = RadioMedium(due_ns=[25 * MS], payload=Word(number=1.0).encode())
    backend.act_in_time(0, one_group(0, [0, 1]), ReceivedPackets.none(MEASURES), NO_TX_STATUSES, medium)
    of_step, echo = medium.puts
    assert (of_step.at_ns, of_step.tick, of_step.sent.sender.tolist()) == (0, 0, [0, 1])
    assert (echo.at_ns, echo.tick, echo.sent.sender.tolist()) == (30 * MS, None, [1])
    told = backend.report()
    assert told.subtick_s == 0.010
    assert told.delivery is not None
    assert told.delivery.count == 1
    assert backend.act(1, one_group(1, [0, 1]), ReceivedPackets.none(MEASURES)).sent.sender.tolist() == [0, 1]
    backend.close()
