"""The guard of a robot's agent: processes that watch one another."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from swarmwire.agent.on_robot import guard as guard_module
from swarmwire.agent.on_robot.guard import CLOSED, ENDED, FAILED, FORWARDED_SIGNALS, RUNS, STOPPED, guard
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, ask_all, endpoints_of, open_swarm
from tests.support.agent.on_robot.installed import Command, deeds, install
from tests.support.agent.on_robot.scripted import PLAYERS
from tests.support.clocks import until

FIRST_STEPS = 2
PYTHON = [sys.executable, "-I", "-S", "-c"]
TELL = "import os, signal, sys, time\ntell = lambda beat: os.write(int(sys.argv[-1]), beat)\n"
FREEZE = "os.kill(os.getpid(), signal.SIGSTOP)"
LONG_S, SHORT_S = 60.0, 0.2
# Whoever stands by stops at a byte, and does nothing without one.
STOP = "import sys\nif '--standby' not in sys.argv or sys.stdin.read(1): open(sys.argv[1], 'a').write('stopped ')"
BROKEN = "import sys\nif '--standby' in sys.argv: sys.exit(1)\nopen(sys.argv[1], 'a').write('stopped anew ')"
HOPELESS = "import sys\nsys.exit(1)"


class Robot:
    """A robot that runs under a guard, and has taken its first steps."""

    def __init__(self, folder: Path, agent: str, *more: str, watchdog_s: float = 5.0) -> None:
        self.file, environment = folder / "deeds", install(folder / "installed")
        settings = ("--driver", "written", "--address", str(self.file), "--log", str(folder))
        watchdog = ("--watchdog-s", str(watchdog_s))
        self.command = Command(environment, "run", f"{PLAYERS}:{agent}", *settings, *watchdog, *more)
        self.guard = self.command.process
        until(lambda: sum(deed.startswith("act") for _, deed in deeds(self.file)) >= FIRST_STEPS)
        self.agent = deeds(self.file)[0][0]

    def last(self) -> list[str]:
        """What was done by another process than the agent's, at the end."""
        return [deed for process, deed in deeds(self.file) if process != self.agent]


@pytest.fixture
def robots() -> Iterator[list[Robot]]:
    started: list[Robot] = []
    yield started
    for robot in started:
        if psutil.pid_exists(robot.agent):  # first: it has the pipes of its guard, whose end is waited for
            os.kill(robot.agent, signal.SIGKILL)
        robot.command.__exit__()


def test_an_agent_that_is_killed_has_its_motors_stopped_by_the_guard(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    os.kill(robot.agent, signal.SIGKILL)
    code, _, said = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])
    assert said.splitlines() == ["guard: the agent is gone: its process ended (SIGKILL); the motors were stopped"]


def test_an_agent_that_is_frozen_is_ended_and_its_motors_stopped(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving", watchdog_s=0.2))
    os.kill(robot.agent, signal.SIGSTOP)
    code, _, said = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])
    assert said.splitlines() == ["guard: the agent is gone: no heartbeat for 0.4 s; the motors were stopped"]
    assert not psutil.pid_exists(robot.agent)


@pytest.mark.parametrize(("agent", "how"), [("Holding", "no heartbeat for 0.4 s"), ("Vanishing", "(exit code 0)")])
def test_an_agent_that_holds_the_interpreter_or_vanishes_is_found_out(tmp_path, robots, agent, how):
    robots.append(robot := Robot(tmp_path, agent, watchdog_s=0.2))
    code, _, said = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])
    assert how in said


def test_what_an_agent_started_ends_with_it_and_holds_no_connection(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Forking", watchdog_s=0.2))
    started = psutil.Process(robot.agent).children()
    code, _, _ = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])
    assert not any(other.is_running() for other in started)


def test_an_agent_that_failed_and_left_something_behind_ends_all_the_same(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Forking", "--param", "dies=false"))
    code, _, said = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])  # who knows what it told the robot
    assert "the fourth step" in said
    assert said.splitlines()[-1].startswith("guard: the agent is gone: it closed 3 s ago, and its processes did not")


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_signals_reach_the_agent_which_stops_its_motors_and_closes_its_log(tmp_path, robots, sent, code):
    robots.append(robot := Robot(tmp_path, "Driving"))
    robot.guard.send_signal(sent)
    assert robot.command.wait()[0] == code
    assert robot.last() == []
    assert [deed for _, deed in deeds(robot.file)][-2:] == ["stop", "close"]
    assert len(list(tmp_path.glob("robot-0-*/summary.json"))) == 1


def test_an_agent_whose_guard_is_killed_stops_its_motors_and_ends(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    robot.guard.kill()
    until(lambda: not psutil.pid_exists(robot.agent))
    assert [deed for _, deed in deeds(robot.file)][-2:] == ["stop", "close"]
    assert '"the guard is gone"' in next(tmp_path.glob("robot-0-*/summary.json")).read_text()


def test_an_agent_that_raises_has_stopped_its_motors_itself(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Failing", "--rate-hz", "20"))
    code, _, said = robot.command.wait()
    assert code == 1
    assert "the third step" in said
    assert "guard" not in said
    assert robot.last() == []


def test_a_small_guard_is_the_process_that_was_started_and_leaves_nothing_behind(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    guard = psutil.Process(robot.guard.pid)
    assert psutil.Process(robot.agent).ppid() == guard.pid
    assert guard.memory_info().rss < 16e6
    until(lambda: len(guard.children()) == 2)  # the agent, and whoever would stop its motors
    others = guard.children(recursive=True)
    robot.guard.send_signal(signal.SIGTERM)
    assert robot.command.wait()[0] == 0
    assert not any(other.is_running() for other in others)
    assert robot.last() == []


def test_all_may_be_told_to_end_at_once_and_the_motors_are_off(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    guard = psutil.Process(robot.guard.pid)
    until(lambda: len(guard.children()) == 2)
    for process in (*guard.children(), guard):
        process.terminate()
    robot.command.wait()
    assert [deed for _, deed in deeds(robot.file)][-2:] == ["stop", "close"]


def test_a_robot_that_cannot_be_stopped_any_more_is_told_of(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    robot.file.unlink()
    robot.file.mkdir()  # nobody can write there
    os.kill(robot.agent, signal.SIGKILL)
    code, _, said = robot.command.wait()
    assert code == 1
    assert said.splitlines()[-1].endswith("the motors could not be stopped")


def test_a_robot_that_was_stopped_for_good_has_not_failed_when_its_process_dies(tmp_path, robots):
    network = Network(listen=("tcp/127.0.0.1:0",))
    session = open_swarm(network)
    try:
        endpoint = endpoints_of(session, network)[0]
        robots.append(robot := Robot(tmp_path, "Driving", "--radio", "zenoh", "--connect", endpoint, watchdog_s=0.5))
        assert ask_all(session, SwarmKeys("swarm"), ESTOP, ["robot-0"], 30.0) == {"robot-0": "stopped"}
        stopped = len(deeds(robot.file))
        until(lambda: len(deeds(robot.file)) > stopped + 5)  # so that the guard has received of it
        os.kill(robot.agent, signal.SIGKILL)
        assert robot.command.wait()[0] == 0
        assert robot.last() == ["open", "stop", "close"]
    finally:
        session.close()


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    """Handlers are what they were, afterwards."""
    numbers = (*FORWARDED_SIGNALS, signal.SIGALRM, signal.SIGTSTP)
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
    assert "no heartbeat for 0.2 s; the motors were stopped" in capfd.readouterr().err


def test_what_an_agent_leaves_behind_ends_with_it(tmp_path, monkeypatch, capfd):
    """A child of it that holds the pipe, and maybe the robot's only connection."""
    monkeypatch.setattr(guard_module, "CLOSE_TIMEOUT_S", SHORT_S)
    agent = f"tell({RUNS!r})\ntell({CLOSED!r})\nif os.fork() == 0:\n    signal.pause()\n"
    assert guarded(tmp_path, agent) == (FAILED, "stopped")
    assert "it closed 0.2 s ago, and its processes did not end" in capfd.readouterr().err


def test_where_whoever_stands_by_fails_another_stops(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r})", BROKEN) == (FAILED, "stopped anew")
    assert "the motors were stopped" in capfd.readouterr().err


def test_motors_that_cannot_be_stopped_are_told_of(tmp_path, capfd):
    assert guarded(tmp_path, f"tell({RUNS!r})", HOPELESS) == (FAILED, "")
    assert "the motors could not be stopped" in capfd.readouterr().err


def test_nobody_starts_an_agent_anew_that_ended_after_an_emergency_stop(tmp_path):
    assert guarded(tmp_path, f"tell({RUNS!r}); tell({STOPPED!r}); sys.exit(1)") == (ENDED, "stopped")


@pytest.mark.parametrize("number", FORWARDED_SIGNALS)
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
