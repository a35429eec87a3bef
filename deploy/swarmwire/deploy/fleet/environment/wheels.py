"""Wheels for another machine: fetched by pip, which checks them against the index, and unpacked without it."""

import subprocess
import sys
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath

from swarmwire.deploy.fleet.archive import Entry
from swarmwire.deploy.fleet.environment.pins import Pin
from swarmwire.deploy.fleet.environment.target import Target
from swarmwire.deploy.fleet.host_failed import HostFailed

LIBRARIES = ("purelib", "platlib")  # parts of a wheel's .data folder that belong beside its packages
LEFT_OUT = (".pyi", ".a", ".h", ".pxd")  # of no use where nothing is compiled or type-checked
PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input", "download", "--quiet", "--progress-bar", "off")


def download(pins: Sequence[Pin], target: Target, into: Path, index: Sequence[str]) -> list[Path]:
    """The wheels of all pins; HostFailed if there is none of one for the target, or the index is out of reach.

    `index` are pip's options that say where wheels come from.
    """
    command = [sys.executable, *PIP, "--dest", str(into), *target.pip_arguments(), *index, *map(str, pins)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise _failed(done.stderr, target)
    return sorted(into.glob("*.whl"))


def _failed(errors: str, target: Target) -> HostFailed:
    lines = [line.removeprefix("ERROR: ") for line in errors.splitlines() if line.startswith("ERROR: ")]
    missing = next((line for line in lines if line.startswith("No matching distribution")), None)
    if missing is None:
        last = lines[-1] if lines else errors.strip().rpartition("\n")[2]
        return HostFailed(f"pip cannot fetch the robot's packages: {last}", "is the package index within reach?")
    what = missing.rpartition(" for ")[2]
    cure = "install a version here that has one, or a newer Python on the robot"
    return HostFailed(f"there is no wheel of {what} for {target}", cure)


def entries_of(wheels: Iterable[Path]) -> list[Entry]:
    """What wheels come to when they are installed, without scripts, tests and what compilers need."""
    entries: list[Entry] = []
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            for info in archive.infolist():
                name = _place(info.filename)
                if name and not info.is_dir():
                    entries.append(Entry(name, archive.read(info)))
    return entries


def _place(name: str) -> str:
    """Where a file of a wheel is installed; "": nowhere."""
    path = PurePosixPath(name)
    if path.parts[0].endswith(".data"):
        if len(path.parts) < 3 or path.parts[1] not in LIBRARIES:
            return ""
        path = PurePosixPath(*path.parts[2:])
    dropped = path.suffix in LEFT_OUT or (path.parts[0] == "numpy" and "tests" in path.parts)
    return "" if dropped or ".." in path.parts else str(path)
