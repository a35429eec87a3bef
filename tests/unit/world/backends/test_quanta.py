"""A tick in subticks: packets go on air when they came, and are handed over when they are due.

Delays are counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.interfaces import SubtickPackets
from swarmwire.comms.packets import BROADCAST, NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import PacedBackend
from swarmwire.world.subtick import Subticks
from tests.support.agent.hosts import MEASURES, assignment, group, one_group, spec
from tests.support.agent.players import Word
from tests.support.clocks import MS, ORIGIN_NS, FakeClock

PACKET = SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.of([b"\0\0"]))


def received(at_ns: int, payload: bytes = b"\0\0") -> ReceivedPackets:
    """One packet of robot 0 to robot 1."""
    given = {name: np.zeros(1) for name in MEASURES}
    one = np.zeros(1, np.int64)
    return ReceivedPackets(one + 1, one, one, one + at_ns, given, one, Payloads.of([payload]))


@dataclass
class RadioMedium:
    """a medium that notes what is asked of it, and lets packets be received at set times."""

    due_ns: list[int] = field(default_factory=list[int])
    payload: bytes = b"\0\0"
    puts: list[SubtickPackets] = field(default_factory=list[SubtickPackets])
    times_ns: list[int] = field(default_factory=list[int])

    def send(self, put: SubtickPackets) -> None:
        assert put.at_ns >= (self.times_ns or [0])[-1]
        self.puts.append(put)

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

    def take_in(self) -> Sequence[SubtickPackets]:
        came = [at_ns for at_ns in self.sends_ns if at_ns <= self.clock.time_ns]
        self.sends_ns = [at_ns for at_ns in self.sends_ns if at_ns > self.clock.time_ns]
        return [SubtickPackets(at_ns, None, PACKET) for at_ns in came]

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
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
    delays = pace.delivery.delays()
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
    delays = pace.delivery.delays()
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
    pace.begin_anew(1, 1.0, 3000 * MS)
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
        pace.hold({0: 0, 3: 1, 7: 2}[work_ms])
    clock.time_ns += 500 * MS
    pace.begin_anew(3, 1.0, 500 * MS)
    pace.begin()
    jitter = pace.jitter.delays()
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
