"""What a guard does, in this process, with agents and stops of a line each; `test_guard` has it with a whole robot."""

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from swarmwire.agent.on_robot import guard as guard_module
from swarmwire.agent.on_robot.guard import CLOSED, ENDED, FAILED, PASSED_ON, RUNS, STOPPED, guard

PYTHON = [sys.executable, "-I", "-S", "-c"]
TELL = "import os, signal, sys, time\ntell = lambda beat: os.write(int(sys.argv[-1]), beat)\n"
FREEZE = "os.kill(os.getpid(), signal.SIGSTOP)"
LONG_S, SHORT_S = 60.0, 0.2
# Whoever stands by stops at a byte, and does nothing without one.
STOP = "import sys\nif '--standby' not in sys.argv or sys.stdin.read(1): open(sys.argv[1], 'a').write('stopped ')"
BROKEN = "import sys\nif '--standby' in sys.argv: sys.exit(1)\nopen(sys.argv[1], 'a').write('stopped anew ')"
HOPELESS = "import sys\nsys.exit(1)"


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    """Handlers are what they were, afterwards."""
    numbers = (*PASSED_ON, signal.SIGALRM, signal.SIGTSTP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


def guarded(folder: Path, agent: str, stop: str = STOP, silent_s: float = LONG_S) -> tuple[int, str]:
    """The guard's exit code, and what the stops wrote."""
    done = folder / "done"
    code = guard([*PYTHON, TELL + agent], [*PYTHON, stop, str(done)], silent_s, "--pipe", "--standby")
    return code, done.read_text().strip() if done.is_file() else ""


@pytest.mark.parametrize(("agent", "code"), [("", 0), ("sys.exit(3)", 3), ("os.kill(os.getpid(), 9)", FAILED)])
def test_an_agent_that_never_began_needs_no_stop_and_its_exit_code_is_the_guards(tmp_path, agent, code):
    assert guarded(tmp_path, agent) == (code, "")


@pytest.mark.parametrize("code", [0, 2])
def test_whoever_has_closed_all_needs_no_stop(tmp_path, code):
    assert guarded(tmp_path, f"tell({RUNS!r}); tell({CLOSED!r}); sys.exit({code})") == (code, "")


def test_the_motors_of_an_agent_that_dies_are_stopped_once_by_whoever_stands_by(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r}); os.kill(os.getpid(), signal.SIGKILL)") == (FAILED, "stopped")
    assert capfd.readouterr().err == (
        "guard: the agent is gone: its process ended (SIGKILL); the motors were stopped\n"
    )


def test_an_exit_without_a_word_is_a_death(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r}); sys.exit(0)") == (FAILED, "stopped")
    assert "its process ended (exit code 0)" in capfd.readouterr().err


def test_an_agent_that_freezes_is_ended(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r}); {FREEZE}", silent_s=SHORT_S) == (FAILED, "stopped")
    assert "it has been frozen for 0.2 s; the motors were stopped" in capfd.readouterr().err


def test_what_an_agent_leaves_behind_ends_with_it(tmp_path, monkeypatch, capfd):
    """A child of it that holds the pipe, and maybe the robot's only connection."""
    monkeypatch.setattr(guard_module, "GRACE_S", SHORT_S)
    agent = f"tell({RUNS!r})\ntell({CLOSED!r})\nif os.fork() == 0:\n    signal.pause()\n"
    assert guarded(tmp_path, agent) == (FAILED, "stopped")
    assert "it was done 0.2 s ago, and something of it still ran" in capfd.readouterr().err


def test_where_whoever_stands_by_fails_another_stops(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r})", BROKEN) == (FAILED, "stopped anew")
    assert "the motors were stopped" in capfd.readouterr().err


def test_motors_that_cannot_be_stopped_are_told_of(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r})", HOPELESS) == (FAILED, "")
    assert "the motors could not be stopped" in capfd.readouterr().err


def test_nobody_starts_an_agent_anew_that_ended_after_an_emergency_stop(tmp_path):
    assert guarded(tmp_path, f"tell({RUNS!r}); tell({STOPPED!r}); sys.exit(1)") == (ENDED, "stopped")


@pytest.mark.parametrize("number", PASSED_ON)
def test_a_signal_to_the_guard_reaches_the_agent(tmp_path, number):
    agent = (
        f"signal.signal({int(number)}, lambda *_: (tell({CLOSED!r}), os._exit(0)))\n"
        f"tell({RUNS!r})\nos.kill(os.getppid(), {int(number)})\n"
        "while True: signal.pause()"
    )
    assert guarded(tmp_path, agent) == (0, "")


def test_an_agent_that_heeds_no_signal_is_ended(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(guard_module, "GRACE_S", SHORT_S)
    agent = (
        f"signal.signal(signal.SIGTERM, signal.SIG_IGN)\ntell({RUNS!r})\nos.kill(os.getppid(), signal.SIGTERM)\n"
        "while True: signal.pause()"
    )
    assert guarded(tmp_path, agent) == (FAILED, "stopped")
    assert "its process ended (SIGKILL)" in capfd.readouterr().err
