"""What stops the motors: the watchdog, an emergency stop, signals, and heartbeats for the guard."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.agent.on_robot.guard import RUNS, STOPPED
from swarmwire.agent.on_robot.safety import SIGNALS, Heartbeats, Motors, StopFlag, Watchdog, by_signals
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


class Robot:
    """Keeps what it is told; may be out of reach, or be told to stop while a command is on its way."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.reachable, self.on_act = True, lambda: None

    def act(self, command: Command) -> None:
        self.told.append("act")
        self.on_act()

    def stop(self) -> None:
        if not self.reachable:
            raise DriverLost("nobody answers")
        self.told.append("stop")


def test_nothing_moves_after_an_emergency_stop() -> None:
    robot = Robot()
    motors = Motors(robot)
    motors.act(None)
    motors.control.estop()
    motors.act(None)
    assert robot.told == ["act", "stop"]


def test_a_command_that_an_emergency_stop_overtook_is_followed_by_a_stop() -> None:
    robot = Robot()
    motors = Motors(robot)
    robot.on_act = motors.control.estop
    motors.act(None)
    assert robot.told == ["act", "stop", "stop"]


def test_a_robot_out_of_reach_is_no_reason_to_fail_but_is_not_believed_to_stand() -> None:
    robot = Robot()
    motors = Motors(robot)
    robot.reachable = False
    motors.stop()
    with pytest.raises(DriverLost):
        motors.control.estop()
    assert motors.control.stopped


def test_a_stop_that_was_taken_by_a_robot_that_was_given_up_is_not_believed_either() -> None:
    motors = Motors(Robot())
    motors.reachable = False
    with pytest.raises(DriverLost):
        motors.control.estop()


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_asks_for_the_end_and_the_first_reason_stays(number):
    end = StopFlag()
    with by_signals(end, patient=True):
        assert not end
        signal.raise_signal(number)
        signal.raise_signal(signal.SIGTERM)
    assert end.reason == number.name


def test_a_second_interrupt_interrupts_an_agent_without_a_guard():
    end = StopFlag()
    with by_signals(end, patient=False):
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_signals_do_what_they_did_before_once_it_is_over():
    before = [signal.getsignal(number) for number in SIGNALS]
    with by_signals(StopFlag(), patient=False):
        pass
    assert [signal.getsignal(number) for number in SIGNALS] == before


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    beats, pipe = os.pipe()
    os.set_blocking(pipe, False)
    yield beats, pipe
    for end in (beats, pipe):
        with suppress(OSError):  # the test did
            os.close(end)


def _alone() -> None:
    raise AssertionError("the guard is there")


def test_each_tells_whether_the_robot_was_stopped_for_good(ends):
    beats, pipe = ends
    stopped = [False, True]
    beat = Heartbeats(pipe, lambda: stopped.pop(0), _alone)
    beat()
    beat()
    assert os.read(beats, 9) == RUNS + STOPPED


def test_a_guard_that_is_frozen_holds_up_nobody(ends):
    _, pipe = ends
    with suppress(BlockingIOError):
        while os.write(pipe, b"." * 4096):
            continue
    Heartbeats(pipe, lambda: False, _alone)()


def test_a_guard_that_is_gone_is_noticed(ends):
    beats, pipe = ends
    os.close(beats)
    alone: list[bool] = []
    Heartbeats(pipe, lambda: False, lambda: alone.append(True))()
    assert alone == [True]


def test_without_a_guard_nothing_happens():
    Heartbeats(None, lambda: False, _alone)()
