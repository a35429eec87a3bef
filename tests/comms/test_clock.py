"""Time: integer nanoseconds that never drift."""

from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.clock import NS_PER_S, WallClock, tick_start_ns, to_ns, to_s

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
