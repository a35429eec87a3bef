"""The radio between ticks: no packet is lost there, and nothing depends on when one looks."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.interfaces import Observer, SubtickMedium, SubtickPackets
from swarmwire.comms.packets import BROADCAST, NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.results import Results
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.deploy.new_medium import new_medium
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.subtick import SubtickRadio
from swarmwire.world.world import World
from tests.support.comms.radio.runs import RATE_HZ, TICK_NS, make_medium, scattered
from tests.support.comms.radio.traffic import RADIOS
from tests.support.world.samples import SAMPLE

MS = 1_000_000
AIRTIME_NS = 96_000  # of a packet's three bytes


def packet(sender: int, byte: int = 0) -> SentPackets:
    return SentPackets(np.array([sender]), np.array([BROADCAST]), Payloads.of([bytes([0, 0, byte])]))


def static(robots: int, arenas: int = 1) -> Static:
    names = tuple(f"r{i}" for i in range(robots))
    return Static("", tuple(range(arenas)), RATE_HZ, (6.0, 5.0), "walls", ((),) * arenas, (), names)


def in_time(radio: Radio, robots: int = 4, arenas: int = 1) -> SubtickRadio:
    return SubtickRadio(make_medium(radio, robots, range(arenas)), static(robots, arenas), lambda sent: sent)


def begun(medium: SubtickRadio, start_ns: int, robots: int = 4) -> tuple[Results, Results]:
    """A tick with robots at rest, and nothing disrupted."""
    return medium.step(start_ns, scattered(robots), None, None)


def received_at(received: ReceivedPackets, receiver: int = 1) -> list[tuple[int, int]]:
    """Sender and time, but for the airtime, of what one robot received."""
    mine = received.receiver == receiver
    return list(zip(received.sender[mine].tolist(), (received.received_at_ns[mine] - AIRTIME_NS).tolist(), strict=True))


def test_a_packet_put_on_the_air_within_a_tick_is_received_within_it_once():
    medium = in_time(Radio(99.0, latency_s=0.002))
    begun(medium, 0)
    medium.send(SubtickPackets(10 * MS, None, packet(0)))
    assert received_at(medium.advance(12 * MS)[0]) == []
    assert received_at(medium.advance(12 * MS + AIRTIME_NS)[0]) == [(0, 12 * MS)]
    assert received_at(medium.advance(13 * MS)[0]) == []
    told, rest = begun(medium, TICK_NS)
    assert (received_at(told.received), received_at(rest.received)) == (
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
        columns = told.receiver, told.sender, told.sequence, told.received_at_ns
        received.extend(zip(*(column.tolist() for column in columns), strict=True))

    for tick in range(5):
        start_ns = tick_start_ns(tick, RATE_HZ)
        news, rest = begun(medium, start_ns, 2 * robots)
        tallies.append(news.tally)
        keep(rest.received)
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
        wrong = packet(0)
        medium.send(SubtickPackets(start_ns + 6 * MS, None, SentPackets(wrong.sender, np.array([99]), wrong.payloads)))
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


def test_the_loop_shows_observers_what_was_received_within_a_tick_and_counts_what_was_sent_to_nobody():
    scenario = scenario_from(SAMPLE, "sample")
    world, backend, seen = World(scenario, [1], {}), Sender(), Tallies()
    loop = Loop(world, new_medium(scenario, world, None), backend, [seen], timed=backend)
    loop.run(5)
    last = loop.end()
    assert last is not None
    total = sum(seen.tallies, last)
    assert int(total.sent.sum()) == 5
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
