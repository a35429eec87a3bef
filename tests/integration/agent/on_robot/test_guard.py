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
from swarmwire.comms.wire.sessions import closed_after
from tests.support.agent.on_robot.installed import Command, deeds, install
from tests.support.agent.on_robot.scripted import PLAYERS
from tests.support.clocks import until

FIRST_STEPS = 2
PYTHON = [sys.executable, "-I", "-S", "-c"]
SEND_BEATS = "import os, signal, sys, time\ntell = lambda beat: os.write(int(sys.argv[-1]), beat)\n"
FREEZE = "os.kill(os.getpid(), signal.SIGSTOP)"
LONG_S, SHORT_S = 60.0, 0.2
# The standby stops the motors at a byte.
STOP = "import sys\nif '--standby' not in sys.argv or sys.stdin.read(1): open(sys.argv[1], 'a').write('stopped ')"
BROKEN = "import sys\nif '--standby' in sys.argv: sys.exit(1)\nopen(sys.argv[1], 'a').write('stopped anew ')"
HOPELESS = "import sys\nsys.exit(1)"


class Robot:
    """A robot under a guard after its first steps."""

    def __init__(self, folder: Path, agent: str, *more: str, watchdog_s: float = 5.0) -> None:
        self.file, environment = folder / "deeds", install(folder / "installed")
        settings = ("--driver", "written", "--address", str(self.file), "--log", str(folder))
        watchdog = ("--watchdog-s", str(watchdog_s))
        self.command = Command(environment, "run", f"{PLAYERS}:{agent}", *settings, *watchdog, *more)
        self.guard = self.command.process
        until(lambda: sum(deed.startswith("act") for _, deed in deeds(self.file)) >= FIRST_STEPS)
        self.agent = deeds(self.file)[0][0]

    def last(self) -> list[str]:
        """Deeds of other processes than the agent."""
        return [deed for process, deed in deeds(self.file) if process != self.agent]


@pytest.fixture
def robots() -> Iterator[list[Robot]]:
    started: list[Robot] = []
    yield started
    for robot in started:
        if psutil.pid_exists(robot.agent):  # first, since it holds the pipes of its guard
            os.kill(robot.agent, signal.SIGKILL)
        robot.command.__exit__()


@pytest.mark.parametrize(
    ("agent", "killed", "cause"),
    [("Driving", True, "its process ended (SIGKILL)"), ("Holding", False, "no heartbeat for 0.4 s")],
    ids=["killed", "holds the interpreter"],
)
def test_guard_stops_the_motors_of_an_agent_that_is_gone(tmp_path, robots, agent, killed, cause):
    robots.append(robot := Robot(tmp_path, agent, watchdog_s=0.2))
    if killed:
        os.kill(robot.agent, signal.SIGKILL)
    code, _, errors = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])
    assert errors.splitlines()[-1] == f"guard: the agent is gone: {cause}; the motors were stopped"
    assert not psutil.pid_exists(robot.agent)


def test_guard_ends_processes_that_the_agent_started(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Forking", watchdog_s=0.2))
    started = psutil.Process(robot.agent).children()
    code, _, _ = robot.command.wait()
    assert (code, robot.last()) == (1, ["open", "stop", "close"])
    assert not any(other.is_running() for other in started)


def test_signal_makes_the_agent_stop_its_motors_and_close_its_log(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    robot.guard.send_signal(signal.SIGTERM)
    assert robot.command.wait()[0] == 0
    assert robot.last() == []
    assert [deed for _, deed in deeds(robot.file)][-2:] == ["stop", "close"]
    assert len(list(tmp_path.glob("robot-0-*/summary.json"))) == 1


def test_agent_whose_guard_is_killed_stops_its_motors(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    robot.guard.kill()
    until(lambda: not psutil.pid_exists(robot.agent))
    assert [deed for _, deed in deeds(robot.file)][-2:] == ["stop", "close"]
    assert '"the guard is gone"' in next(tmp_path.glob("robot-0-*/summary.json")).read_text()


def test_guard_is_small_and_leaves_no_process_behind(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    guard = psutil.Process(robot.guard.pid)
    assert psutil.Process(robot.agent).ppid() == guard.pid
    assert guard.memory_info().rss < 16e6
    until(lambda: len(guard.children()) == 2)  # the agent and the standby
    others = guard.children(recursive=True)
    robot.guard.send_signal(signal.SIGTERM)
    assert robot.command.wait()[0] == 0
    assert not any(other.is_running() for other in others)
    assert robot.last() == []


def test_motors_stop_when_all_processes_are_terminated_at_once(tmp_path, robots):
    robots.append(robot := Robot(tmp_path, "Driving"))
    guard = psutil.Process(robot.guard.pid)
    until(lambda: len(guard.children()) == 2)
    for process in (*guard.children(), guard):
        process.terminate()
    robot.command.wait()
    assert [deed for _, deed in deeds(robot.file)][-2:] == ["stop", "close"]


def test_death_after_an_emergency_stop_is_no_failure(tmp_path, robots):
    network = Network(listen=("tcp/127.0.0.1:0",))
    with closed_after(open_swarm(network)) as session:
        endpoint = endpoints_of(session, network)[0]
        robots.append(robot := Robot(tmp_path, "Driving", "--radio", "zenoh", "--connect", endpoint, watchdog_s=0.5))
        assert ask_all(session, SwarmKeys("swarm"), ESTOP, ["robot-0"], 30.0) == {"robot-0": "stopped"}
        stopped = len(deeds(robot.file))
        until(lambda: len(deeds(robot.file)) > stopped + 5)  # until the guard has received it
        os.kill(robot.agent, signal.SIGKILL)
        assert robot.command.wait()[0] == 0
        assert robot.last() == ["open", "stop", "close"]


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    """Restore signal handlers."""
    numbers = (*FORWARDED_SIGNALS, signal.SIGALRM, signal.SIGTSTP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


def guarded(folder: Path, agent: str, stop: str = STOP, silent_s: float = LONG_S) -> tuple[int, str]:
    """Exit code of the guard, and output of the stops."""
    done = folder / "done"
    code = guard([*PYTHON, SEND_BEATS + agent], [*PYTHON, stop, str(done)], silent_s, "--pipe", "--standby")
    return code, done.read_text().strip() if done.is_file() else ""


@pytest.mark.parametrize(("agent", "code"), [("", 0), ("sys.exit(3)", 3), ("os.kill(os.getpid(), 9)", FAILED)])
def test_agent_that_never_started_needs_no_stop(tmp_path, agent, code):
    assert guarded(tmp_path, agent) == (code, "")


@pytest.mark.parametrize("code", [0, 2])
def test_agent_that_closed_needs_no_stop(tmp_path, code):
    assert guarded(tmp_path, f"tell({RUNS!r}); tell({CLOSED!r}); sys.exit({code})") == (code, "")


DEATHS = {
    "exit without a closed message": (
        f"tell({RUNS!r}); sys.exit(0)",
        "its process ended (exit code 0); the motors were",
    ),
    "no heartbeats": (f"tell({RUNS!r}); {FREEZE}", "no heartbeat for 0.2 s; the motors were"),
    # The child holds the pipe, and maybe the only connection of the robot.
    "child of a closed agent": (
        f"tell({RUNS!r})\ntell({CLOSED!r})\nif os.fork() == 0: signal.pause()",
        "it closed 0.2 s ago, and its processes did not end; the motors were",
    ),
    "ignored signals": (
        f"signal.signal(signal.SIGTERM, signal.SIG_IGN)\ntell({RUNS!r})\nos.kill(os.getppid(), signal.SIGTERM)\n"
        "while True: signal.pause()",
        "its process ended (SIGKILL); the motors were",
    ),
}


@pytest.mark.parametrize("death", DEATHS)
def test_agent_that_dies_or_hangs_is_ended_and_its_motors_stopped(tmp_path, monkeypatch, capfd, death):
    for patience in ("CLOSE_TIMEOUT_S", "GRACE_S"):
        monkeypatch.setattr(guard_module, patience, SHORT_S)
    agent, report = DEATHS[death]
    assert guarded(tmp_path, agent, silent_s=SHORT_S if death == "no heartbeats" else LONG_S) == (FAILED, "stopped")
    assert capfd.readouterr().err == f"guard: the agent is gone: {report} stopped\n"


@pytest.mark.parametrize(
    ("stop", "done", "report"), [(BROKEN, "stopped anew", "were stopped"), (HOPELESS, "", "could not be stopped")]
)
def test_standby_that_fails_is_replaced_once_and_the_outcome_reported(tmp_path, capfd, stop, done, report):
    assert guarded(tmp_path, f"tell({RUNS!r})", stop) == (FAILED, done)
    assert f"the motors {report}" in capfd.readouterr().err


def test_exit_after_an_emergency_stop_has_the_code_ended(tmp_path):
    assert guarded(tmp_path, f"tell({RUNS!r}); tell({STOPPED!r}); sys.exit(1)") == (ENDED, "stopped")


@pytest.mark.parametrize("number", FORWARDED_SIGNALS)
def test_signal_to_the_guard_reaches_the_agent(tmp_path, number):
    agent = (
        f"signal.signal({int(number)}, lambda *_: (tell({CLOSED!r}), os._exit(0)))\n"
        f"tell({RUNS!r})\nos.kill(os.getppid(), {int(number)})\n"
        "while True: signal.pause()"
    )
    assert guarded(tmp_path, agent) == (0, "")
