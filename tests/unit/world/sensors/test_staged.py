"""A sense reads at its rate and tells after its delay, however often its group looks; one that failed reads blank."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.sensors.sensor import Field, Noise, SensorSpec
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.pipeline import Staged

KEYS = np.array([7, 8], np.uint64)
GROUP = Group("a", load_body("epuck"), 2, 5)


class Counter:
    """Tells the tick, and how many ticks it was called in."""

    fields = (Field("tick", noise=Noise("normal", 0.01)), Field("seen", 2, blank=-1.0))

    def __init__(self) -> None:
        self.seen = 0

    def follow(self, tick: int) -> None:
        """One more tick."""
        self.seen += 1

    def truth(self, tick: int) -> Any:
        """The tick, and the ticks so far."""
        self.follow(tick)
        return np.full((2, 3), float(tick)), np.full((2, 3, 2), float(self.seen))


def sense(**keys: float) -> Staged:
    return Staged("counter", Counter(), SensorSpec(**keys), KEYS, GROUP, 0.1)


def told(of: Staged, ticks: int, every: int = 1) -> dict[int, dict[str, Any]]:
    """What it reads in each tick in which its group acts."""
    read: dict[int, dict[str, Any]] = {}
    for tick in range(ticks):
        if tick % every:
            of.follow(tick)
        else:
            read[tick] = of.read(tick)
    return read


@pytest.mark.parametrize(
    ("keys", "shown"),
    [
        ({}, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ({"rate_hz": 10.0}, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ({"rate_hz": 400.0}, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ({"rate_hz": 5.0}, [0, 0, 2, 2, 4, 4, 6, 6, 8, 8]),
        ({"rate_hz": 4.0}, [0, 0, 0, 3, 3, 5, 5, 5, 8, 8]),
        ({"delay_s": 0.2}, [None, None, 0, 1, 2, 3, 4, 5, 6, 7]),
        ({"delay_s": 0.11}, [None, None, 0, 1, 2, 3, 4, 5, 6, 7]),
        ({"rate_hz": 2.5, "delay_s": 0.1}, [None, 0, 0, 0, 0, 4, 4, 4, 4, 8]),
    ],
)
def test_readings_are_taken_at_the_rate_and_shown_after_the_delay(keys: Any, shown: list[int | None]) -> None:
    read = told(sense(**keys), 10)
    fresh = told(sense(), 10)
    for tick, taken in enumerate(shown):
        assert read[tick]["counter.tick"].shape == (6,)
        assert read[tick]["counter.seen"].shape == (6, 2)
        if taken is None:
            assert np.isnan(read[tick]["counter.tick"]).all()
            assert (read[tick]["counter.seen"] == -1.0).all()
        else:
            for name in ("counter.tick", "counter.seen"):
                assert np.array_equal(read[tick][name], fresh[taken][name])


@pytest.mark.parametrize("keys", [{}, {"rate_hz": 4.0}, {"delay_s": 0.2}, {"rate_hz": 3.0, "delay_s": 0.3}])
def test_it_does_not_matter_how_often_a_group_looks(keys: dict[str, float]) -> None:
    always, seldom = told(sense(**keys), 24), told(sense(**keys), 24, every=5)
    assert seldom.keys() == {0, 5, 10, 15, 20}
    for tick, fields in seldom.items():
        for name, values in fields.items():
            assert np.array_equal(values, always[tick][name], equal_nan=True)


@pytest.mark.parametrize("keys", [{}, {"rate_hz": 1.0}])
def test_a_failed_sensor_reads_blank_at_once_and_until_it_is_mended(keys: dict[str, float]) -> None:
    of = sense(**keys)
    whole = of.read(0)
    of.failed = np.array([[True, False, False], [False, False, True]])
    lost = of.failed.ravel()
    broken = of.read(1)
    assert np.array_equal(np.isnan(broken["counter.tick"]), lost)
    assert np.array_equal((broken["counter.seen"] == -1.0).all(axis=1), lost)
    assert (broken["counter.seen"][~lost] > 0.0).all()
    of.failed = None
    mended = of.read(2)
    assert np.isfinite(mended["counter.tick"]).all()
    assert np.array_equal(mended["counter.tick"], whole["counter.tick"]) is bool(keys)


@pytest.mark.parametrize("keys", [{}, {"rate_hz": 1.0}])
def test_what_an_agent_does_to_a_reading_stays_with_it(keys: dict[str, float]) -> None:
    of, untouched = sense(**keys), sense(**keys)
    of.read(0)["counter.tick"][:] = 99.0
    untouched.read(0)
    assert np.array_equal(of.read(1)["counter.tick"], untouched.read(1)["counter.tick"])
