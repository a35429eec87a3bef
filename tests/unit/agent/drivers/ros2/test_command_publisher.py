"""Commands are sent again and again, but nothing that a stop has overtaken."""

import threading

from swarmwire.agent.drivers.driver import STOP, Command
from swarmwire.agent.drivers.ros2.driver import STOP_REPEATS, CommandPublisher

DRIVE = Command(0.1, 0.5)


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


def test_it_begins_with_a_stop_which_goes_out_some_times_and_no_more():
    sent = SentPackets()
    assert sent.commands == [STOP]
    assert sent.steps(10) == [STOP] * STOP_REPEATS
    sent.end()


def test_a_command_goes_out_at_once_and_then_at_10_hz_or_more():
    sent = SentPackets()
    sent.commander.tell(DRIVE)
    assert sent.commands[-1] == DRIVE
    before_ns = sent.clock.time_ns
    assert sent.steps(20) == [DRIVE] * 20
    assert sent.clock.time_ns - before_ns <= 2_000_000_000
    sent.end()


def test_after_a_stop_from_any_thread_no_command_goes_out_again():
    sent = SentPackets()
    sent.commander.tell(DRIVE)
    sent.steps(3)
    thread = threading.Thread(target=sent.commander.tell, args=(STOP,))
    thread.start()
    thread.join()
    assert sent.commands[-1] == STOP
    assert sent.steps(10) == [STOP] * STOP_REPEATS
    sent.commander.tell(DRIVE)  # until the agent commands anew
    assert sent.steps(2) == [DRIVE] * 2
    sent.end()


def test_the_end_is_a_stop_and_after_it_nothing_goes_out():
    sent = SentPackets()
    sent.commander.tell(DRIVE)
    sent.end()
    assert sent.commands[-1] == STOP
    told = len(sent.commands)
    sent.commander.tell(DRIVE)
    sent.commander.end()
    assert len(sent.commands) == told
