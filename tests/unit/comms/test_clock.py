"""Time: integer nanoseconds that never drift, and clocks that no date moves."""

import time
from itertools import count

from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.clock import NS_PER_S, PreciseClock, ScaledClock, WallClock, tick_start_ns, to_ns, to_s
from tests.support.clocks import FakeClock

TICKS = st.integers(0, 10**9)
RATES = st.integers(1, 10_000)


@given(TICKS, RATES)
def test_a_tick_starts_at_its_exact_time_rounded_down(tick: int, rate_hz: int) -> None:
    start_ns = tick_start_ns(tick, rate_hz)
    assert start_ns * rate_hz <= tick * NS_PER_S < (start_ns + 1) * rate_hz


@given(TICKS, RATES)
def test_whole_seconds_are_exact_at_every_rate(second: int, rate_hz: int) -> None:
    assert tick_start_ns(second * rate_hz, rate_hz) == second * NS_PER_S


@given(TICKS, RATES)
def test_periods_differ_by_a_nanosecond_at_most(tick: int, rate_hz: int) -> None:
    period_ns = tick_start_ns(tick + 1, rate_hz) - tick_start_ns(tick, rate_hz)
    assert period_ns in {NS_PER_S // rate_hz, NS_PER_S // rate_hz + 1}


@given(st.integers(0, 10**15))
def test_nanoseconds_survive_as_seconds(ns: int) -> None:
    """Up to eleven days, beyond which a float of seconds no longer tells single nanoseconds apart safely."""
    assert to_ns(to_s(ns)) == ns


def test_durations_round_to_the_nearest_nanosecond() -> None:
    assert [to_ns(0.1), to_ns(0.3), to_ns(1e-9), to_ns(0.4e-9)] == [100_000_000, 300_000_000, 1, 0]


def test_the_wall_clock_returns_once_the_time_has_come_and_at_once_when_it_is_past() -> None:
    clock = WallClock()
    before_ns = clock.now_ns()
    clock.sleep_until(before_ns - NS_PER_S)
    clock.sleep_until(before_ns + 1_000_000)
    assert clock.now_ns() >= before_ns + 1_000_000


class LateClock(FakeClock):
    """A clock whose sleeps end late, and on which looking takes time."""

    def __init__(self, late_ns: int) -> None:
        super().__init__()
        self.late_ns = late_ns

    def now_ns(self) -> int:
        self.time_ns += 100
        return self.time_ns

    def sleep_until(self, at_ns: int) -> None:
        super().sleep_until(at_ns)
        self.time_ns += self.late_ns


def test_a_precise_clock_learns_how_late_its_sleeps_end_and_ends_them_on_time() -> None:
    inner = LateClock(250_000)
    clock, late_ns = PreciseClock(inner), list[int]()
    for _ in range(4):
        at_ns = inner.time_ns + 10_000_000
        clock.sleep_until(at_ns)
        late_ns.append(inner.time_ns - at_ns)
    assert late_ns[0] > 100_000  # not known yet
    assert all(0 <= late < 1_000 for late in late_ns[1:])
    inner.late_ns = 0
    for _ in range(100):
        clock.sleep_until(inner.time_ns + 10_000_000)
    assert clock._wake_latency_ns < 10_000  # it does not wait awake for long where sleeps end on time


def test_a_precise_clock_does_not_sleep_for_what_is_near_or_past_nor_wait_awake_for_a_machine_that_is_busy() -> None:
    inner = LateClock(50_000_000)
    clock = PreciseClock(inner)
    clock.sleep_until(inner.time_ns - 5)
    clock.sleep_until(inner.time_ns + 20_000)
    assert not inner.slept_until
    clock.sleep_until(inner.time_ns + 10_000_000)
    assert clock._wake_latency_ns <= 500_000


class DatedClock(FakeClock):
    """A clock that shows a date besides."""

    date_ns = 1_800_000_000 * NS_PER_S

    def utc_ns(self) -> int:
        return self.date_ns + self.time_ns


def test_a_scaled_clock_runs_as_many_times_as_fast_and_sleeps_as_much_shorter() -> None:
    wall = DatedClock()
    clock = ScaledClock(wall, 4.0)
    began_ns, date_ns = wall.time_ns, clock.utc_ns()
    clock.sleep_until(2 * NS_PER_S)
    assert wall.time_ns - began_ns == NS_PER_S // 2
    assert clock.now_ns() == 2 * NS_PER_S
    assert abs(clock.utc_ns() - date_ns - 2 * NS_PER_S) < 1000  # what a float of a date rounds off


@given(st.floats(0.01, 1000.0), st.integers(0, 50 * 365 * 86_400))
def test_dates_of_scaled_clocks_are_such_as_messages_have_room_for(factor: float, since_2026_s: int) -> None:
    wall = DatedClock()
    wall.date_ns = (1_767_225_600 + since_2026_s) * NS_PER_S
    one, other = ScaledClock(wall, factor), ScaledClock(wall, factor)
    wall.time_ns += NS_PER_S
    assert one.utc_ns() == other.utc_ns()
    assert 0 <= one.utc_ns() // NS_PER_S < 2**31


def test_what_is_waited_for_and_measured_does_not_go_by_the_date(monkeypatch):
    hours = count(start=1_800_000_000, step=3600)
    monkeypatch.setattr(time, "time_ns", lambda: next(hours) * NS_PER_S)
    monkeypatch.setattr(time, "time", lambda: float(next(hours)))
    clock = WallClock()
    before_ns = clock.now_ns()
    clock.sleep_until(before_ns + 1_000_000)
    assert 1_000_000 <= clock.now_ns() - before_ns < 60 * NS_PER_S
    assert clock.utc_ns() - clock.utc_ns() == -3600 * NS_PER_S  # the date itself has jumped
