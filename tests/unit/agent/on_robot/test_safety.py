"""Safety of a robot: limits, watchdog, the lock, and commands that are repeated."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from swarmwire.agent.drivers.driver import STOP, Command, DriverLost
from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver, Epuck2Options
from swarmwire.agent.drivers.ros2.driver import STOP_REPEATS, CommandPublisher
from swarmwire.agent.on_robot.guard import RUNS, STOPPED
from swarmwire.agent.on_robot.robot_lock import OUT_OF_REACH, STOP_SIGNAL, NotStopped, RobotLock
from swarmwire.agent.on_robot.robot_lock import STOPPED as STOPPED_MESSAGE
from swarmwire.agent.on_robot.safety import SIGNALS, Heartbeats, Motors, StopFlag, Watchdog, by_signals
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import load_body
from tests.support.agent.on_robot.scripted import DatedFakeClock, Rig, ScriptedDriver, lost
from tests.support.clocks import MS, FakeClock
from tests.support.refusals import refused_input

DRIVE = Command(0.1, 0.5)


def _watchdog(clock: FakeClock) -> tuple[Watchdog, list[str]]:
    stops: list[str] = []
    return Watchdog(0.5, lambda: stops.append("stop"), clock), stops


def test_watchdog_stops_the_motors_once_at_its_timeout():
    clock = FakeClock()
    watchdog, stops = _watchdog(clock)
    watchdog.feed()
    for later_ms, expected in ((499, []), (1, ["stop"]), (5000, ["stop"])):
        clock.time_ns += later_ms * MS
        watchdog.check()
        assert stops == expected
    assert watchdog.stops == 1


def test_watchdog_stops_and_reports_each_lapse_once_with_its_duration():
    clock, stops, reported = FakeClock(), list[str](), list[float]()
    watchdog = Watchdog(0.5, lambda: stops.append("stop"), clock, report=reported.append)
    for silent_ms in (600, 750):
        watchdog.feed()
        clock.time_ns += silent_ms * MS
        watchdog.check()
        clock.time_ns += 100 * MS
        watchdog.check()
    assert stops == ["stop"] * 2
    assert reported == [0.6, 0.75]


def test_watchdog_is_idle_before_the_first_feed_and_while_suspended():
    clock = FakeClock()
    watchdog, stops = _watchdog(clock)
    clock.time_ns += 9000 * MS
    watchdog.check()
    watchdog.feed()
    watchdog.suspend()
    clock.time_ns += 9000 * MS
    watchdog.check()
    assert stops == []


def test_watchdog_is_fed_by_every_step_and_a_late_agent_continues():
    rig = Rig("Driving")
    rig.driver.faults["sense"] = [None, lambda: (rig.takes(700 * MS)(), rig.watchdog.check())]
    rig.run(3)
    assert rig.driver.deeds[1] == "stop"
    assert len(rig.driver.commands) == 3
    assert rig.loop.status()["watchdog_stops"] == 1


def test_watchdog_thread_checks_and_sends_heartbeats():
    stopped, beaten = threading.Event(), threading.Event()
    watchdog = Watchdog(0.05, stopped.set, WallClock(), beat=beaten.set)
    watchdog.start()
    assert beaten.is_set()  # before any motor moves
    beaten.clear()
    watchdog.feed()
    assert stopped.wait(10.0)
    assert beaten.wait(10.0)
    watchdog.end()


def test_emergency_stop_out_of_reach_raises_but_latches() -> None:
    driver = ScriptedDriver(DatedFakeClock())
    driver.faults = {"stop": [lost, lost]}
    motors = Motors(driver)
    motors.stop()
    with pytest.raises(DriverLost):
        motors.control.estop()
    assert motors.control.stopped
    motors.act(DRIVE)
    assert driver.commands == []


@pytest.mark.parametrize("number", SIGNALS)
def test_signal_requests_the_end_and_the_first_reason_stays(number):
    end = StopFlag()
    with by_signals(end, patient=True):
        assert not end
        signal.raise_signal(number)
        signal.raise_signal(signal.SIGTERM)
    assert end.reason == number.name


def test_second_interrupt_raises_without_a_guard():
    end = StopFlag()
    with by_signals(end, patient=False):
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_signal_handlers_are_restored():
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


def test_heartbeats_carry_the_latched_stop(ends):
    beats, pipe = ends
    stopped = [False, True]
    beat = Heartbeats(pipe, lambda: stopped.pop(0), _alone)
    beat()
    beat()
    assert os.read(beats, 9) == RUNS + STOPPED


def test_heartbeats_do_not_block_with_a_frozen_guard_or_none(ends):
    _, pipe = ends
    with suppress(BlockingIOError):
        while os.write(pipe, b"." * 4096):
            continue
    for end in (pipe, None):
        Heartbeats(end, lambda: False, _alone)()


def test_heartbeats_notice_a_dead_guard(ends):
    beats, pipe = ends
    os.close(beats)
    alone: list[bool] = []
    Heartbeats(pipe, lambda: False, lambda: alone.append(True))()
    assert alone == [True]


def test_target_is_the_same_with_and_without_the_default_port():
    short, full, other = (
        Epuck2Driver(f"10.0.0.1{port}", load_body("epuck2"), Epuck2Options(), DatedFakeClock()).target
        for port in ("", ":1000", ":1001")
    )
    assert short == full != other


def robot_lock() -> RobotLock:
    clock = DatedFakeClock()
    return RobotLock("scripted", ScriptedDriver(clock), clock)


@pytest.fixture
def locks(tmp_path, monkeypatch) -> tuple[RobotLock, RobotLock]:
    """Two locks of one robot, whose files are in the test's folder."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return robot_lock(), robot_lock()


def test_lock_is_exclusive_and_released(locks):
    first, second = locks
    assert second.request_stop() is None
    with first.acquire("robot.toml"):
        first.write_result(STOPPED_MESSAGE)
        with pytest.raises(BadInput, match="the robot at nowhere is driven by process"), second.acquire("robot.toml"):
            pass
    with second.acquire("robot.toml"):
        pass


@pytest.mark.parametrize(
    ("result", "expected"),
    [
        (OUT_OF_REACH, "cannot reach the robot at nowhere, and stops it as soon as it can"),
        ("", "drives the robot at nowhere, and did not confirm the stop within 2 s"),
    ],
)
def test_lock_holder_without_confirmation_is_reported(locks, result, expected):
    signals, (first, second) = [], locks
    before = signal.signal(STOP_SIGNAL, lambda *_: signals.append(True))
    try:
        with first.acquire("robot.toml"):
            first.write_result(result)
            with pytest.raises(NotStopped, match=expected):
                second.request_stop()
    finally:
        signal.signal(STOP_SIGNAL, before)
    assert signals == [True]  # once, not in every round


@pytest.mark.parametrize("words", ["", "somebody\n", "\xff\xfe", "99999999\n"])  # no process has this number
def test_lock_without_a_living_process_does_not_block_a_stop(tmp_path, locks, words):
    first, second = locks
    with first.acquire("robot.toml"):
        next((tmp_path / "swarmwire").iterdir()).write_bytes(words.encode("latin-1"))
        assert second.request_stop() is None


def lock_folders(tmp_path, monkeypatch) -> tuple[Path, Path]:
    """A user's runtime folder, and the folder for temporary files."""
    runtime, temporary = tmp_path / "runtime", tmp_path / "temporary"
    runtime.mkdir()
    temporary.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    return runtime / "swarmwire", temporary / f"swarmwire-{os.getuid()}"


def link(folder: Path) -> None:
    folder.symlink_to(folder.parent)


@pytest.mark.parametrize("spoil", [link, Path.touch])
def test_lock_folder_of_another_user_is_skipped(tmp_path, monkeypatch, spoil):
    runtime, temporary = lock_folders(tmp_path, monkeypatch)
    spoil(runtime)
    first, second = robot_lock(), robot_lock()
    with first.acquire("robot.toml"):
        assert list(temporary.iterdir())
        with pytest.raises(BadInput, match="is driven by process"), second.acquire("robot.toml"):
            pass
    monkeypatch.setattr("tempfile.tempdir", "/dev/null")
    for use in (second.request_stop, second.acquire("robot.toml").__enter__):
        with refused_input("locks of robots"):
            use()


def test_lock_folder_is_never_created_in_another_users_runtime_folder(tmp_path, monkeypatch):
    runtime, _ = lock_folders(tmp_path, monkeypatch)
    monkeypatch.setattr("os.getuid", lambda: tmp_path.stat().st_uid + 1)  # root with a user's variables
    with pytest.raises(BadInput):  # files of this test are another user's, too
        robot_lock().request_stop()
    assert not runtime.exists()


def test_lock_is_searched_in_all_folders_of_the_user(tmp_path, monkeypatch):
    lock_folders(tmp_path, monkeypatch)
    first, second = robot_lock(), robot_lock()
    monkeypatch.setenv("XDG_RUNTIME_DIR", "")  # as in a service or over SSH, where it may be missing
    before = signal.signal(STOP_SIGNAL, lambda *_: first.write_result(STOPPED_MESSAGE))
    try:
        with first.acquire("robot.toml"):
            monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "runtime"))
            assert second.request_stop() == os.getpid()
    finally:
        signal.signal(STOP_SIGNAL, before)


def test_lock_file_that_cannot_be_opened_is_named(tmp_path, monkeypatch):
    runtime, _ = lock_folders(tmp_path, monkeypatch)
    lock = robot_lock()
    with lock.acquire("robot.toml"):
        (file,) = runtime.iterdir()
    file.unlink()
    file.symlink_to(tmp_path / "runtime")
    for use in (lock.request_stop, lock.acquire("robot.toml").__enter__):
        with refused_input(file):
            use()


class StepClock:
    """A clock whose sleepers the test wakes, one period at a time."""

    def __init__(self) -> None:
        self.time_ns = 0
        self._sleeps, self._wakes = threading.Semaphore(0), threading.Semaphore(0)

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_until(self, at_ns: int) -> None:
        self._sleeps.release()
        assert self._wakes.acquire(timeout=20.0)
        self.time_ns = at_ns

    def step(self) -> None:
        """Wake the sleeper, and wait until it sleeps again."""
        self._wakes.release()
        assert self._sleeps.acquire(timeout=20.0)

    def settle(self) -> None:
        assert self._sleeps.acquire(timeout=20.0)

    def wake(self) -> None:
        self._wakes.release()


class SentPackets:
    def __init__(self) -> None:
        self.clock, self.commands = StepClock(), []
        self.commander = CommandPublisher(self.commands.append, self.clock)
        self.clock.settle()

    def steps(self, count: int) -> list[Command]:
        """What is sent in so many periods."""
        before = len(self.commands)
        for _ in range(count):
            self.clock.step()
        return self.commands[before:]

    def end(self) -> None:
        self.clock.wake()
        self.commander.end()


def test_ros2_commands_begin_with_a_repeated_stop():
    sent = SentPackets()
    assert sent.commands == [STOP]
    assert sent.steps(10) == [STOP] * STOP_REPEATS
    sent.end()


def test_ros2_command_is_sent_at_once_and_repeated_at_10_hz_or_more():
    sent = SentPackets()
    sent.commander.publish(DRIVE)
    assert sent.commands[-1] == DRIVE
    before_ns = sent.clock.time_ns
    assert sent.steps(20) == [DRIVE] * 20
    assert sent.clock.time_ns - before_ns <= 2_000_000_000
    sent.end()


def test_ros2_stop_from_any_thread_ends_the_repetition():
    sent = SentPackets()
    sent.commander.publish(DRIVE)
    sent.steps(3)
    thread = threading.Thread(target=sent.commander.publish, args=(STOP,))
    thread.start()
    thread.join()
    assert sent.commands[-1] == STOP
    assert sent.steps(10) == [STOP] * STOP_REPEATS
    sent.commander.publish(DRIVE)  # until the agent commands anew
    assert sent.steps(2) == [DRIVE] * 2
    sent.end()


def test_ros2_end_sends_a_stop_and_nothing_afterwards():
    sent = SentPackets()
    sent.commander.publish(DRIVE)
    sent.end()
    assert sent.commands[-1] == STOP
    count = len(sent.commands)
    sent.commander.publish(DRIVE)
    sent.commander.end()
    assert len(sent.commands) == count
