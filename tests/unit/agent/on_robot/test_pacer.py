import pytest

from swarmwire.agent.on_robot.pacer import Pacer
from swarmwire.comms.clock import tick_start_ns
from tests.support.clocks import MS, ORIGIN_NS, FakeClock


class _Oversleeping(FakeClock):
    """A clock on which whoever sleeps wakes so much later, once each."""

    def __init__(self, later_ms: list[int]) -> None:
        super().__init__()
        self._later_ms = later_ms

    def sleep_until(self, at_ns: int) -> None:
        super().sleep_until(at_ns)
        self.time_ns += self._later_ms.pop(0) * MS if self._later_ms else 0


@pytest.mark.parametrize("rate_hz", [1, 3, 7, 10, 30, 1000])
def test_every_tick_is_met_at_its_start_whatever_the_rate(rate_hz):
    clock = FakeClock()
    pacer = Pacer(clock, rate_hz)
    ticks = [(*pacer.wait(), clock.now_ns()) for _ in range(50)]
    assert ticks == [(tick, False, ORIGIN_NS + tick_start_ns(tick, rate_hz)) for tick in range(50)]
    assert (pacer.late, pacer.skipped) == (0, 0)


def test_a_tick_of_which_half_a_period_is_gone_takes_the_next_ones_place():
    clock = _Oversleeping([0, 40, 0, 60, 0])
    pacer = Pacer(clock, 10)
    began = [(pacer.wait()[0], (clock.now_ns() - ORIGIN_NS) // MS) for _ in range(5)]
    assert began == [(0, 0), (1, 140), (2, 200), (3, 360), (5, 500)]
    assert (pacer.late, pacer.skipped) == (0, 1)


def test_a_tick_that_begins_a_period_too_late_is_late_and_the_newest_is_taken():
    clock = _Oversleeping([0, 310])
    pacer = Pacer(clock, 10)
    assert [pacer.wait() for _ in range(3)] == [(0, False), (4, True), (5, False)]
    assert (pacer.late, pacer.skipped) == (1, 3)


def test_ticks_of_a_pause_that_was_meant_are_neither_late_nor_skipped():
    clock = FakeClock()
    pacer = Pacer(clock, 10)
    pacer.wait()
    clock.time_ns += 340 * MS
    assert pacer.resume() == 3
    assert pacer.wait() == (4, False)
    assert (pacer.late, pacer.skipped) == (0, 0)
    assert pacer.resume() == 0
