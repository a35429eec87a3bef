"""Conformance of the borders of agent processes: hostile agents at each level of isolation.

`OPEN` says what agents can do at each level, as the page on processes does.
"""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import psutil
import pytest

from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import Result, run
from swarmwire.deploy.runs.live_address import Announcement, runs_folder
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from tests.support.agent import hostile
from tests.support.clocks import until
from tests.support.refusals import refused_input

AGENTS = Path(hostile.__file__)
TIMEOUT_S = 60.0  # timeout of runners: the reason of ends that are not noticed at once
LEVELS: dict[str, dict[str, bool]] = {
    "agent network": {"agent_network": True},
    "default": {},
    "isolate": {"isolate": True},
}
NETWORK = {"network", "abstract socket", "unix socket", "datagram", "zenoh's socket", "control"}
FILES = {"control file", "run folder", "written file", "other processes"}
OPEN = {"agent network": NETWORK | FILES, "default": FILES, "isolate": set[str]()}


class HonestObserver(Observer):
    """An observer of honest robots and of all notes.

    Attributes:
        stood: honest robots that did not drive in some tick.
        states: all noted states.
        alive: whether each robot lives in the end.
    """

    def __init__(self) -> None:
        self.stood, self.states, self.alive = set[int](), set[str](), list[bool]()

    def see(self, truth: Truth) -> None:
        """Compare the honest robots' commands."""
        self.stood |= {row for row in range(2) if truth.tick and truth.command[row, 0] != 0.05}
        self.states |= {state for state in truth.states if state}
        self.alive = truth.alive.tolist()


class HostileRun(NamedTuple):
    """A run with hostile agents."""

    result: Result
    observations: HonestObserver
    lost: dict[str, str]  # reasons by robot
    began_s: float  # UTC since 1970


def group(name: str, agent: str, **params: Any) -> str:
    lines = "\n".join(f"params.{key} = {json.dumps(value)}" for key, value in params.items())
    return (
        f'[robots.{name}]\nbody = "epuck"\ncount = {2 if name == "honest" else 1}\nagent = "{AGENTS}:{agent}"\n{lines}'
    )


def hostile_run(
    folder: Path, attacks: list[str], surroundings: dict[str, Any] | None = None, **options: Any
) -> HostileRun:
    """Run honest robots, and a hostile one for each attack."""
    hostile_groups = [
        group(f"h{at}", "Hostile", attack=attack, surroundings=json.dumps(surroundings or {}))
        for at, attack in enumerate(attacks)
    ]
    head = f"""
format = 1
name = "borders"
duration_s = 1.5
arena = {{ size_m = [20.0, 20.0] }}
run = {{ on_runner_loss = "dead", runner_timeout_s = {TIMEOUT_S} }}
radio = {{ preset = "unit-disk" }}
"""
    file = folder / "borders.toml"
    file.write_text("\n".join([head, group("honest", "Honest"), group("prey", "Honest"), *hostile_groups]))
    observations = HonestObserver()
    simulation = Simulation(file, runners="per-robot", out=folder / "run", observers=[observations], **options)
    simulation.watch(Announcement(folder / "run"))
    result = run_to_end(simulation)
    lost = dict(text.partition(", which played ")[2].split(": ", 1) for text in result.lost_runners)
    by_attack = {attack: lost.pop(f"h{at}-0") for at, attack in enumerate(attacks) if f"h{at}-0" in lost}
    assert not lost
    return HostileRun(result, observations, by_attack, file.stat().st_mtime)


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> HostileRun:
    """The run in which each answer to the host is an attack."""
    return hostile_run(tmp_path_factory.mktemp("answers"), [*hostile.ANSWERS, *hostile.ENDS])


@pytest.mark.parametrize("attack", hostile.ANSWERS)
def test_hostile_answer_loses_its_own_process_with_the_cause(attacked: HostileRun, attack: str) -> None:
    assert attack in attacked.lost
    if attack not in ("an empty message", "the failure of another"):
        assert "its answer is refused" in attacked.lost[attack]


def test_hostile_answers_change_no_other_robot(attacked: HostileRun) -> None:
    assert attacked.result.ended == "duration"
    assert attacked.observations.stood == set()
    assert not attacked.observations.states & {"forged"}
    assert attacked.observations.alive[:3] == [True] * 3
    assert "honest-0" not in str(attacked.result.lost_runners)
    radio = attacked.result.radio
    assert radio is not None
    assert radio.intended == 0  # no packet of an honest message


def test_process_whose_child_holds_its_socket_is_noticed_at_once(attacked: HostileRun) -> None:
    assert "ended with exit code 3" in attacked.lost["leaves a child"]
    assert "closed its socket" in attacked.lost["closes its socket"]

    def is_left(process: psutil.Process) -> bool:
        """Whether it is of this run, not of an earlier one."""
        marked = hostile.MARK in (process.info["cmdline"] or ())
        return marked and process.create_time() >= attacked.began_s - 1.0

    until(lambda: not any(map(is_left, psutil.process_iter(["cmdline"]))))


@pytest.fixture(scope="module")
def surroundings() -> Iterator[dict[str, Any]]:
    """Listeners of another program of this user, and paths of the run."""
    folder = tempfile.mkdtemp(prefix="border-")
    name = f"swarmwire-{os.getpid()}"
    with (
        socket.create_server(("127.0.0.1", 0)) as tcp,
        socket.socket(socket.AF_UNIX) as abstract,
        socket.socket(socket.AF_UNIX) as unix,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as datagrams,
    ):
        abstract.bind(f"\0{name}")
        unix.bind(f"{folder}/unix")
        datagrams.bind(f"{folder}/datagrams")
        for listener in (abstract, unix):
            listener.listen(100)
        yield {
            "port": tcp.getsockname()[1],
            "abstract": name,
            "path": f"{folder}/unix",
            "datagrams": f"{folder}/datagrams",
            "tmp": tempfile.gettempdir(),
            "control": str(runs_folder()),
        }
    shutil.rmtree(folder)


def isolation_test(*arguments: str, before: Sequence[str] = ()) -> subprocess.CompletedProcess[str]:
    """Test an isolation on this system: exit code 0 and the missing features; or 1 and the reason."""
    command = [*before, sys.executable, "-m", "swarmwire.agent.fork_server", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60.0)


@pytest.mark.parametrize("level", LEVELS)
def test_isolation_level_stops_the_listed_attacks(tmp_path: Path, surroundings: dict[str, Any], level: str) -> None:
    if level == "isolate" and isolation_test("--isolate").returncode:
        pytest.skip("needs rights to make namespaces")
    done = hostile_run(tmp_path, [*hostile.OUTSIDE], {**surroundings, "run": str(tmp_path / "run")}, **LEVELS[level])
    outcomes = dict(state.split(": ") for state in done.observations.states)
    opened = OPEN[level] | (
        {"signals to others"} if level != "isolate" and "signals" in isolation_test().stdout else set()
    )
    expected = {attack: "done" if attack in opened else "refused" for attack in hostile.OUTSIDE}
    assert outcomes == expected
    assert done.lost == {}
    assert done.observations.alive[2] == (level != "agent network")  # the prey of "control"
    assert done.observations.stood == set()


def test_system_without_namespaces_refuses_isolation_but_has_no_network() -> None:
    no_namespaces = ("setpriv", "--bounding-set", "-sys_admin", "--no-new-privs")
    if os.geteuid() or subprocess.run([*no_namespaces, "true"], capture_output=True, check=False).returncode:
        pytest.skip("needs root, and setpriv of util-linux")
    completed = isolation_test("--isolate", before=no_namespaces)
    assert completed.returncode == 1
    assert completed.stderr.startswith("expected root, or rights to make namespaces")
    assert len(completed.stderr.splitlines()) == 1
    assert "network" not in isolation_test(before=no_namespaces).stdout


def test_isolation_without_processes_is_refused(tmp_path: Path) -> None:
    with refused_input("isolate"):
        run(AGENTS.parents[3] / "scenarios" / "flocking.toml", isolate=True)
