"""A driver that is installed for the processes of a test, and writes its calls into a file."""

import os
import subprocess
import sys
from pathlib import Path

from tests.support.agent.on_robot.scripted import PLAYERS

DRIVING = f"{PLAYERS}:Driving"
DRIVER = '''
import os
from dataclasses import dataclass
import numpy as np
from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.config import parameter


@dataclass(frozen=True)
class Options:
    gone: bool = parameter(False, help="whether nobody answers")


class Written(Driver):
    """Writes a line into the file at its address for all that it does."""

    options = Options
    body_name = "epuck2"

    def __init__(self, address, body, options, clock):
        super().__init__(address, body, options, clock)
        if not address.startswith("/"):
            raise BadInput("Written", "address", f"expected the path of a file; got {address!r}")

    measures = frozenset({"proximity", "battery"})

    def _write(self, line):
        with open(self.address, "a") as file:
            file.write(f"{os.getpid()} {line}\\n")

    def open(self):
        if self.options_given.gone:
            raise DriverLost("nobody answers")
        self._reach()
        self._write("open")

    def _reach(self):
        if os.path.exists(f"{self.address}.gone"):
            self._write("lost")
            raise DriverLost("nobody answers any more")

    def sense(self, senses):
        self._reach()
        return {
            "proximity.value": np.zeros((1, 8)),
            "battery.charge": np.array([0.5]),
            "battery.voltage_v": np.array([3.9]),
        }

    def act(self, command):
        self._write(f"act {command.linear_mps:g}")

    def stop(self):
        self._write("stop")

    def counts(self):
        return {}

    def close(self):
        self._write("close")
'''
LACKING = "import a_library_that_nobody_has\n"
POINTS = """[swarmwire.drivers]
written = written_driver:Written
lacking = lacking_driver:Lacking
"""
METADATA = "Metadata-Version: 2.1\nName: written-driver\nVersion: 1.0\nProvides-Extra: lacking\n"


def install(folder: Path) -> dict[str, str]:
    """Put the driver `written`, and one that lacks a library, into a folder; the environment that finds them."""
    metadata = folder / "written_driver-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(METADATA)
    (metadata / "entry_points.txt").write_text(POINTS)
    (folder / "written_driver.py").write_text(DRIVER)
    (folder / "lacking_driver.py").write_text(LACKING)
    path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "PYTHONPATH": path, "XDG_RUNTIME_DIR": str(folder)}


class Command:
    """`swarmwire-agent` as people start it."""

    def __init__(self, environment: dict[str, str], *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "swarmwire.agent.cli", *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def wait(self) -> tuple[int, str, str]:
        """Exit code and what it said."""
        out, err = self.process.communicate(timeout=60.0)
        return self.process.returncode, out, err

    def __enter__(self) -> "Command":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


def deeds(file: Path) -> list[tuple[int, str]]:
    """Process and text of each call of the driver."""
    if not file.exists():
        return []
    pairs = (line.partition(" ") for line in file.read_text().splitlines())
    return [(int(process), deed) for process, _, deed in pairs]


def robot_flags(file: Path, *more: str) -> list[str]:
    """Flags that name this driver and the file that it writes into."""
    return ["--driver", "written", "--address", str(file), *more]
