"""The six distributions, built once for all tests of a run, and clean environments that they are installed into."""

import fcntl
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PARTS = ("comms", "agent", "world", "metrics", "deploy")
UV = str(ROOT / ".ci" / "uv")
# What of this process would show through to programs that are to find nothing but what was installed.
SHOWS_THROUGH = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "UV_PROJECT_ENVIRONMENT", "COVERAGE_PROCESS_START")


def bare() -> dict[str, str]:
    """Variables for programs that know nothing of these sources; kernels are not compiled, which would take longer."""
    environment = {name: value for name, value in os.environ.items() if name not in SHOWS_THROUGH}
    return {**environment, "NUMBA_DISABLE_JIT": "1", "NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "120"}


def done(*command: str | Path, cwd: Path) -> str:
    """What a command printed; it must end well."""
    words = [str(part) for part in command]
    ended = subprocess.run(words, cwd=cwd, env=bare(), capture_output=True, text=True, check=False, timeout=100)
    assert ended.returncode == 0, f"{command}: {ended.returncode}\n{ended.stdout}\n{ended.stderr}"
    return ended.stdout + ended.stderr


def build(folder: Path) -> None:
    """A source distribution of each, and a wheel from each of these, so that nothing is missing in either."""
    done(UV, "build", "--quiet", "--all-packages", "--out-dir", folder, cwd=ROOT)


def made_once(base: Path, name: str, make: Callable[[Path], object]) -> Path:
    """The folder of that name, filled by the first of the processes that share the tests."""
    folder, marker = base / name, base / f"{name}.whole"
    with (base / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not marker.exists():
            make(folder)
            marker.touch()
    return folder


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """That of a whole run of tests: pytest-xdist gives each of its processes a folder in it."""
    base = factory.getbasetemp()
    return base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base


def install(folder: Path, wheels: Iterable[Path]) -> None:
    """Make a virtual environment that holds these wheels, what they need at the locked versions, and nothing else."""
    folder.mkdir()
    locked = folder / "locked.txt"
    export = (UV, "export", "--quiet", "--frozen", "--no-emit-workspace", "--no-hashes", "--all-extras")
    done(*export, "--output-file", locked, cwd=ROOT)
    done(UV, "venv", "--quiet", "--python", sys.executable, folder / "environment", cwd=folder)
    into = ("--python", folder / "environment" / "bin" / "python", "--constraint", locked)
    done(UV, "pip", "install", "--quiet", *into, *wheels, cwd=folder)


@dataclass(frozen=True)
class Installed:
    """Programs of a folder that `install` filled, as they run in a folder that was empty."""

    folder: Path
    cwd: Path

    def program(self, name: str) -> str:
        """Its path."""
        return str(self.folder / "environment" / "bin" / name)

    def run(self, program: str, *arguments: str | Path) -> str:
        """What one of them printed."""
        return done(self.program(program), *arguments, cwd=self.cwd)

    def python(self, code: str) -> str:
        """What a piece of Python printed."""
        return self.run("python", "-c", code).strip()
