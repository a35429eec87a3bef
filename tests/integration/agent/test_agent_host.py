import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import psutil
import pytest

from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.sessions import PRIVATE
from swarmwire.deploy import run
from tests.support.agent.hosts import spec
from tests.support.agent.made_up_world import REFUSAL, MadeUpWorld, made_up_world
from tests.support.clocks import until

END = frames.encode("end", -1, {})
TIMEOUT_S = 60.0

FORKS = """
{before}
from contextlib import closing

from swarmwire.agent.agent_process import assign
from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.process_frames import READY, frame_kind, receive, send
from tests.support.agent.hosts import assignment, group, spec

with closing(ForkServer()) as server:
    for row, sock in enumerate(server.fork(40)):
        send(sock, [assign(assignment(group(spec("Counter"), [row])), None)])
        assert frame_kind(receive(sock)) == READY
"""
ENDS = """
import os, select, signal
from contextlib import closing

import psutil

from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.host_processes import AgentProcesses
from tests.support.agent.hosts import assignment, group, spec

with closing(ForkServer()) as server:
    processes = AgentProcesses(server, assignment(group(spec("Counter"), [*range(20)])), 20, None, {}, 0)
    while not processes.are_ready:
        select.select([processes], [], [])
        processes.events(0)
    for process in psutil.Process(server.pid).children():
        process.kill()
    lost = []
    while len(processes):
        select.select([processes], [], [], 1.0)
        lost += processes.events(0)
    assert {loss.reason for loss in lost} == {"its process was ended by SIGKILL"}, lost
    print(len(lost))
"""
CONTAINER = ("unshare", "--user", "--map-root-user", "--pid", "--fork")  # its only program is the host, process 1
FEW_FILES = "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (30, 30))"


class AgentHost:
    """An agent host of two processes, with a pipe to its life line."""

    def __init__(self, endpoint: str) -> None:
        command = [sys.executable, "-m", "swarmwire.agent.agent_host", endpoint, "run1", spec("Counter"), "host", "2"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def family(self) -> list[psutil.Process]:
        """The fork server and the agent processes."""
        return psutil.Process(self.process.pid).children(recursive=True)

    def ended(self) -> tuple[int, str]:
        """Exit code and stderr."""
        assert self.process.stderr
        code = self.process.wait(TIMEOUT_S)
        return code, self.process.stderr.read()


@pytest.fixture
def started() -> Iterator[list[AgentHost]]:
    agent_hosts: list[AgentHost] = []
    yield agent_hosts
    for agent_host in agent_hosts:
        with agent_host.process as process:  # its pipes are closed with it
            process.kill()


def ready(world: MadeUpWorld) -> None:
    until(lambda: [frame for frame in world.answers if frame.kind == "ready"])


def close_life_line(agent_host: AgentHost) -> None:
    assert agent_host.process.stdin
    agent_host.process.stdin.close()


def test_host_requests_all_robots_at_once_and_ends_with_the_run(started: list[AgentHost]) -> None:
    with made_up_world() as world:
        world.to_send = [END]
        started.append(agent_host := AgentHost(world.endpoint))
        assert agent_host.ended() == (0, "")
    assert len(world.join_requests) == 1
    assert [(frame.kind, frame.values["processes"]) for frame in world.answers] == [("ready", 2)]


def test_host_without_robots_ends_with_the_reason(started: list[AgentHost]) -> None:
    with made_up_world(join=None) as world:
        started.append(agent_host := AgentHost(world.endpoint))
        code, errors = agent_host.ended()
    assert code == 1
    assert REFUSAL in errors


@pytest.mark.parametrize("end", [close_life_line, lambda agent_host: agent_host.process.kill()], ids=["world", "host"])
def test_agent_processes_end_with_their_world_or_host(
    started: list[AgentHost], end: Callable[[AgentHost], object]
) -> None:
    with made_up_world() as world:
        started.append(agent_host := AgentHost(world.endpoint))
        ready(world)
        family = agent_host.family()
        assert len(family) == 3  # the fork server, and two that it forked
        end(agent_host)
        agent_host.process.wait(TIMEOUT_S)
        _, alive = psutil.wait_procs(family, timeout=TIMEOUT_S)
        assert not alive


def test_host_removes_the_socket_of_a_dead_world(started: list[AgentHost], tmp_path: Path) -> None:
    folder = tmp_path / f"{PRIVATE}x"
    folder.mkdir()
    started.append(agent_host := AgentHost(f"unixsock-stream/{folder}/socket"))
    close_life_line(agent_host)
    assert agent_host.ended()[0] == 0
    assert not folder.exists()


def forked(before: str = "", container: Sequence[str] = ()) -> subprocess.CompletedProcess[str]:
    """Run a program that forks a process for each of 40 robots, after these lines of Python."""
    return subprocess.run(
        [*container, sys.executable, "-c", FORKS.format(before=before)],
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT_S,
    )


def test_host_may_be_process_1() -> None:
    if subprocess.run([*CONTAINER, "true"], capture_output=True, check=False).returncode:
        pytest.skip("needs rights to make namespaces")
    done = forked(container=CONTAINER)
    assert done.returncode == 0, done.stderr


def test_ends_of_many_processes_at_once_are_all_reported() -> None:
    """Their sockets close, and the fork server reports them, in any order."""
    done = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    assert done.stdout == "20\n", done.stderr


def test_processes_beyond_the_limit_of_open_files_are_refused() -> None:
    done = forked(FEW_FILES)
    assert "--processes: expected fewer than 40 processes, or a limit above 30 open files" in done.stderr


class Commands(Observer):
    """An observer of the last commands."""

    def see(self, truth):
        self.last = truth.command.copy()


FAULTY = """
import os, signal
from swarmwire.agent import Agent, Robot

def flood():
    for line in range(20_000):
        print(line, "flood" * 20, end="\\r")

def loop():
    while True:
        pass

FAULTS = {
    "killed": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "frozen": lambda: os.kill(os.getpid(), signal.SIGSTOP),
    "exception": lambda: 1 / 0,
    "exit": lambda: os._exit(7),
    "endless loop": loop,
    "memory": lambda: bytes(1 << 60),
    "output": flood,
    "none": lambda: None,
}

class Faulty(Agent):
    fault: str

    def step(self, robot: Robot) -> None:
        if 0.25 < robot.time_s < 0.35 or (robot.time_s > 0.35 and self.fault in ("killed", "exit")):
            FAULTS[self.fault]()
        robot.drive(0.1, 0.0)
"""


KILLED_ONCE = """
import os, signal
from pathlib import Path
from swarmwire.agent import FloatColumn, Robots, Memory, VectorAgent, column

class Turns(Memory):
    turned_rad: FloatColumn = column(0.0)

class KilledOnce(VectorAgent[Turns]):
    needs = ("compass",)
    folder: str = "."

    def step(self, robots: Robots, memory: Turns) -> None:
        memory.turned_rad += robots.compass.heading_rad + 0.1
        robots.drive(0.05, memory.turned_rad)
        if robots.time_s > 0.65:
            try:
                (Path(self.folder) / "killed").touch(exist_ok=False)
            except FileExistsError:
                return
            os.kill(os.getpid(), signal.SIGKILL)
"""


def test_killed_process_is_restarted_in_a_run_equal_to_the_undisturbed(tmp_path: Path) -> None:
    (tmp_path / "killed_once.py").write_text(KILLED_ONCE)
    file = tmp_path / "killed-once.toml"
    file.write_text(f"""
format = 1
name = "killed-once"
duration_s = 2.0
arena = {{ size_m = [4.0, 4.0] }}
run = {{ on_runner_loss = "wait" }}

[robots.flock]
body = "epuck"
count = 3
agent = "killed_once.py:KilledOnce"
params = {{ folder = "{tmp_path}" }}
""")
    result = run(file, runners="per-robot")
    assert (tmp_path / "killed").exists()
    (event,) = result.runner_events
    assert (event.what, len(event.robots), event.reason) == ("restarted", 1, "its process was ended by SIGKILL")
    assert (result.counts["processes_restarted"], result.lost_runners) == (1, ())
    assert result.trajectory_sha256 == run(file).trajectory_sha256  # no second kill


@pytest.mark.parametrize("pace", [None, 1.0], ids=["lockstep", "real time"])
def test_faulty_process_loses_only_its_robot(tmp_path: Path, pace: float | None) -> None:
    faults = {
        "killed": "was ended by SIGKILL",
        "frozen": "no answer",
        "exception": "its agent failed: ZeroDivisionError",
        "exit": "ended with exit code 7",
        "endless loop": "no answer",
        "memory": "its agent failed: MemoryError",
        "output": "",
        "none": "",
    }
    (tmp_path / "faulty.py").write_text(FAULTY)
    file = tmp_path / "faults.toml"
    groups = [
        f'[robots.robot{at}]\nbody = "epuck"\ncount = 1\nagent = "faulty.py:Faulty"\nparams = {{ fault = "{fault}" }}'
        for at, fault in enumerate(faults)
    ]
    head = f"""
format = 1
name = "faults"
duration_s = {2.0 if pace is None else 8.0}
arena = {{ size_m = [4.0, 4.0] }}
run = {{ on_runner_loss = "stand", runner_timeout_s = 4.0 }}
"""
    file.write_text("\n".join([head, *groups]))
    commands = Commands()
    result = run(file, runners="per-robot", realtime=pace, observers=[commands])
    lost = {loss.partition(", which played ")[2].partition(":")[0]: loss for loss in result.lost_runners}
    expected = {f"robot{at}-0": reason for at, reason in enumerate(faults.values()) if reason}
    assert set(lost) == set(expected)
    for robot, reason in expected.items():
        assert reason in lost[robot]
    assert commands.last[:, 0].tolist() == [0.0 if reason else 0.1 for reason in faults.values()]
