"""The pace of real time: the clock is asked to wait until each tick is over, and every lag is counted and told."""

from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.packets import ReceivedPackets
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import PacedBackend
from tests.support.agent.hosts import MEASURES, assignment, group, one_group, spec
from tests.support.clocks import MS, ORIGIN_NS, FakeClock


def paced(factor: float = 1.0, rate_hz: int = 10) -> tuple[FakeClock, Pace, list[str]]:
    clock, said = FakeClock(), []
    return clock, Pace(clock, rate_hz, factor, said.append), said


def test_the_clock_is_asked_to_wait_until_each_next_tick_starts() -> None:
    clock, pace, said = paced(factor=4.0, rate_hz=3)
    for tick in range(3):
        pace.begin()
        clock.time_ns += 5 * MS
        pace.hold(tick)
    starts = [round(tick * NS_PER_S // 3 / 4.0) for tick in (1, 2, 3)]
    assert clock.slept_until == [ORIGIN_NS + start for start in starts]
    assert (pace.missed_ticks, pace.worst_lag_ns, said) == (0, 0, [])


def test_a_loop_that_lags_runs_on_without_waiting_until_it_is_level() -> None:
    clock, pace, said = paced()
    lags_ms = []
    for tick, work_ms in enumerate([250, 10, 10, 10]):
        pace.begin()
        clock.time_ns += work_ms * MS
        waits = len(clock.slept_until)
        pace.hold(tick)
        lags_ms.append(len(clock.slept_until) == waits)
    assert lags_ms == [True, True, False, False]
    assert clock.slept_until == [ORIGIN_NS + 300 * MS, ORIGIN_NS + 400 * MS]
    assert (pace.missed_ticks, pace.worst_lag_ns) == (2, 150 * MS)
    assert len(said) == 1
    assert "does not keep up with 1 x real time: at tick 0 the loop is 150.0 ms behind" in said[0]


def test_a_lag_is_told_at_once_but_not_every_tick() -> None:
    clock, pace, said = paced()
    for tick in range(60):  # 12 s of wall time
        pace.begin()
        clock.time_ns += 200 * MS
        pace.hold(tick)
    assert pace.missed_ticks == 60
    assert [text.split("at tick ")[1].split()[0] for text in said] == ["0", "25", "50"]


def test_a_local_crew_is_paced_and_does_what_it_does_otherwise() -> None:
    clock, pace, _ = paced()
    free, backend = (LocalBackend(assignment(group(spec("Counter"), [0, 1]))) for _ in range(2))
    held = PacedBackend(backend, pace)
    free.start()
    held.start()
    for tick in range(2):
        expected = free.act(tick, one_group(tick, [0, 1]), ReceivedPackets.none(MEASURES))
        got = held.act(tick, one_group(tick, [0, 1]), ReceivedPackets.none(MEASURES))
        assert got.linear_mps.tolist() == expected.linear_mps.tolist()
    assert clock.slept_until == [ORIGIN_NS + 100 * MS, ORIGIN_NS + 200 * MS]
    assert (held.report().factor, held.report().missed_ticks, held.report().late_answers) == (1.0, 0, {})


def test_a_schedule_that_begins_anew_forgets_lag_and_pause() -> None:
    clock, pace, said = paced()
    pace.begin()
    pace.hold(0)
    clock.time_ns += 3600 * NS_PER_S
    pace.begin_anew(1, 2.0, 3600 * NS_PER_S)
    assert pace.begin() == ORIGIN_NS + 100 * MS  # when it would be without the pause
    pace.hold(1)
    pace.hold(2)
    assert [at_ns - ORIGIN_NS - 3600 * NS_PER_S for at_ns in clock.slept_until[1:]] == [150 * MS, 200 * MS]
    assert (pace.missed_ticks, said) == (0, [])


def test_a_loop_that_was_frozen_goes_on_from_there_instead_of_catching_up() -> None:
    clock, pace, said = paced()
    pace.begin()
    pace.hold(0)
    clock.time_ns += 3600 * NS_PER_S  # Ctrl-Z within tick 1
    pace.hold(1)
    assert pace.begin() == ORIGIN_NS + 200 * MS  # what is measured by it, such as watchdogs, has not seen the pause
    pace.hold(2)
    assert [at_ns - ORIGIN_NS - 3600 * NS_PER_S for at_ns in clock.slept_until[1:]] == [200 * MS]
    assert (pace.missed_ticks, pace.lag_ns, pace.worst_lag_ns) == (1, 0, 3600 * NS_PER_S - 100 * MS)
    assert said == ["real time: the loop stood still for 3599.9 s in tick 1, and goes on from there"]


def test_nor_does_one_that_was_frozen_in_its_sleep() -> None:
    clock, pace, said = paced()
    pace.begin()
    clock.sleep_until = lambda at_ns: setattr(clock, "time_ns", at_ns + 60 * NS_PER_S)
    pace.hold(0)
    assert pace.over_ns(1) == clock.time_ns + 100 * MS
    assert said == ["real time: the loop stood still for 60.0 s in tick 0, and goes on from there"]
