import threading

from swarmwire.agent.on_robot.watchdog import Watchdog
from swarmwire.comms.clock import WallClock
from tests.support.agent.on_robot.scripted import Rig
from tests.support.clocks import MS, FakeClock


def _watchdog(clock: FakeClock) -> tuple[Watchdog, list[str]]:
    stops: list[str] = []
    return Watchdog(0.5, lambda: stops.append("stop"), clock), stops


def test_it_stops_the_motors_once_when_it_was_not_fed_in_time():
    clock = FakeClock()
    watchdog, stops = _watchdog(clock)
    watchdog.feed()
    clock.time_ns += 499 * MS
    watchdog.look()
    assert stops == []
    clock.time_ns += MS
    watchdog.look()
    clock.time_ns += 5000 * MS
    watchdog.look()
    assert stops == ["stop"]
    assert watchdog.stops == 1


def test_it_tells_once_in_a_lapse_for_how_long_it_was_not_fed():
    clock, told = FakeClock(), list[float]()
    watchdog = Watchdog(0.5, lambda: None, clock, tell=told.append)
    for silent_ms in (600, 750):
        watchdog.feed()
        clock.time_ns += silent_ms * MS
        watchdog.look()
        clock.time_ns += 100 * MS
        watchdog.look()
    assert told == [0.6, 0.75]


def test_an_agent_that_is_back_is_watched_anew():
    clock = FakeClock()
    watchdog, stops = _watchdog(clock)
    for _ in range(3):
        watchdog.feed()
        clock.time_ns += 600 * MS
        watchdog.look()
        watchdog.look()
    assert stops == ["stop"] * 3


def test_it_expects_nothing_before_it_is_fed_and_while_it_rests():
    clock = FakeClock()
    watchdog, stops = _watchdog(clock)
    clock.time_ns += 9000 * MS
    watchdog.look()
    watchdog.feed()
    watchdog.rest()
    clock.time_ns += 9000 * MS
    watchdog.look()
    assert stops == []


def test_the_loop_feeds_it_in_every_step_and_an_agent_that_comes_back_goes_on():
    rig = Rig("Driving")
    rig.driver.faults["sense"] = [None, lambda: (rig.takes(700 * MS)(), rig.watchdog.look())]
    rig.run(3)
    assert rig.driver.deeds[1] == "stop"
    assert len(rig.driver.commands) == 3
    assert rig.loop.status()["watchdog_stops"] == 1


def test_its_thread_looks_by_itself_and_beats():
    stopped, beaten = threading.Event(), threading.Event()
    watchdog = Watchdog(0.05, stopped.set, WallClock(), beat=beaten.set)
    watchdog.start()
    assert beaten.is_set()  # before any motor moves
    beaten.clear()
    watchdog.feed()
    assert stopped.wait(10.0)
    assert beaten.wait(10.0)
    watchdog.end()
