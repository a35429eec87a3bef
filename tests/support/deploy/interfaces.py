"""Runs whose robots have network interfaces, in processes of their own; and commands on the robots."""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.interfaces.entering import INTERFACES, RobotNamespace, command_line
from swarmwire.world.interfaces.namespaces import check_rights

TIMEOUT_S, POLL_S = 60.0, 0.02


def _missing_rights() -> str:
    try:
        check_rights()
    except BadInput as error:
        return str(error)
    return ""


MISSING_RIGHTS = _missing_rights()
needs_interfaces = pytest.mark.skipif(bool(MISSING_RIGHTS), reason=MISSING_RIGHTS)


def needs_program(*names: str) -> pytest.MarkDecorator:
    """Skips a test where a program is not installed."""
    missing = [name for name in names if shutil.which(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")


def line(robots: int, spacing_m: float = 1.5) -> str:
    """Robots that stand in a line, each in range of its neighbours in a radio of 2 m; without the radio's table."""
    poses = ", ".join(f"[{i * spacing_m:g}, 0.0, 0.0]" for i in range(robots))
    return f"""
format = 1
name = "line"
duration_s = 3600
arena = {{ size_m = [100.0, 10.0], boundary = "open" }}
standard_metrics = false
[robots.line]
body = "epuck2"
count = {robots}
agent = "still.py:Still"
place = {{ how = "poses", poses = [{poses}] }}
"""


def with_program(scenario: str, *command: str) -> str:
    """The scenario, with robots that run this program."""
    return scenario.replace("[robots.line]\n", f"[robots.line]\nprogram = {json.dumps(command)}\n")


STILL = """
from swarmwire.agent import Agent, Robot

class Still(Agent):
    def step(self, robot: Robot) -> None: ...
"""
DISK = """
[radio]
range_m = 2.0
bit_rate_bps = 6_000_000
max_payload_bytes = 1514
queue_limit = 200
"""


class InterfacesRun:
    """A run in a process of its own, whose interfaces are up.

    Attributes:
        folder: of the run.
        process: of the world.
        robots: by name, what the run's folder says of them: addresses and so on.
    """

    def __init__(self, folder: Path, process: subprocess.Popen[str]) -> None:
        self.folder, self.process = folder, process
        self.robots: dict[str, dict[str, Any]] = json.loads((folder / INTERFACES).read_text())

    def command(self, robot: str, *command: str) -> list[str]:
        """The command that runs a command on a robot."""
        return command_line(RobotNamespace(**self.robots[robot]["place"]), [*command])

    def on(self, robot: str, *command: str, timeout_s: float = TIMEOUT_S) -> subprocess.CompletedProcess[str]:
        """A command that has ended on a robot."""
        words = self.command(robot, *command)
        return subprocess.run(words, capture_output=True, text=True, timeout=timeout_s, check=False)

    def address(self, robot: str) -> str:
        """Its IPv4 address."""
        return self.robots[robot]["ipv4"].partition("/")[0]

    def output(self, robot: str) -> str:
        """The output of a robot's program so far."""
        path = self.folder / "programs" / f"{robot}.log"
        return path.read_text() if path.exists() else ""

    def end(self) -> dict[str, Any]:
        """End the run as Ctrl-C does; its summary."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(TIMEOUT_S)
        return json.loads((self.folder / "summary.json").read_text())


@contextmanager
def running(
    folder: Path, scenario: str, *options: str, files: Mapping[str, str] | None = None
) -> Generator[InterfacesRun]:
    """A run of this scenario, once its interfaces are up; killed at the end of the context if it still runs."""
    (folder / "scenario.toml").write_text(scenario)
    for name, text in {"still.py": STILL, **(files or {})}.items():
        (folder / name).write_text(text)
    out = folder / "out"
    command = _command(folder, out, options)
    process = subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        # A machine that compiles kernels first takes a minute or more; pytest's timeout is the limit.
        pause = Event()
        while not (out / INTERFACES).exists() and process.poll() is None:
            pause.wait(POLL_S)
        if process.poll() is not None:
            raise AssertionError(process.communicate()[0])
        yield InterfacesRun(out, process)
    finally:
        process.kill()
        process.wait()
        if process.stdout:
            process.stdout.close()


def _command(folder: Path, out: Path, options: Sequence[str]) -> list[str]:
    run = [sys.executable, "-m", "swarmwire.deploy", "run", str(folder / "scenario.toml")]
    has_interface = "[radio.interface]" in (folder / "scenario.toml").read_text()
    interface = () if has_interface else ("--set", "radio.interface={}")
    return [*run, *interface, "--realtime", "1", "--out", str(out), "--no-rrd", "--quiet", *options]
