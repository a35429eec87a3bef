"""The date may be set while a run goes on: it is in names and logs, and in nothing else."""

import time
from itertools import count

from swarmwire.comms.clock import NS_PER_S, WallClock


def test_what_is_waited_for_and_measured_does_not_go_by_the_date(monkeypatch):
    hours = count(start=1_800_000_000, step=3600)
    monkeypatch.setattr(time, "time_ns", lambda: next(hours) * NS_PER_S)
    monkeypatch.setattr(time, "time", lambda: float(next(hours)))
    clock = WallClock()
    before_ns = clock.now_ns()
    clock.sleep_until(before_ns + 1_000_000)
    assert 1_000_000 <= clock.now_ns() - before_ns < 60 * NS_PER_S
    assert clock.utc_ns() - clock.utc_ns() == -3600 * NS_PER_S  # the date itself has jumped
