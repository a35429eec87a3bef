"""Packages for robots: the versions of this machine, as wheels for the robot's platform.

`pins` finds the packages that an agent needs, pip downloads their wheels, and `LockedEnvironments` keeps an archive for
each platform and set of versions in the user's cache. swarmwire's own packages go as they are installed here.
"""

import hashlib
import json
import operator
import os
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution, entry_points
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.deploy.robots.release import Archive, ArchiveEntry, name_of, write_archive
from swarmwire.deploy.robots.result import HostFailed

FIRST_GLIBC = 17  # of the oldest wheels for Linux that there still are: manylinux_2_17
MACHINES = ("aarch64", "x86_64")
AGENT = "swarmwire-agent"
DRIVERS = "swarmwire.drivers"  # group of entry points
REQUIREMENT = re.compile(r"(?P<name>[A-Za-z0-9][A-Za-z0-9._-]*)\s*(?:\[(?P<extras>[^\]]*)\])?[^;]*(?:;(?P<marker>.*))?")
EXTRA = re.compile(r"""extra\s*==\s*['"]([^'"]+)['"]""")
PYTHONS = re.compile(r"""python_version\s*(?P<than><|<=|>|>=|==)\s*['"](?P<major>\d+)\.(?P<minor>\d+)['"]""")
COMPARED: dict[str, Callable[[tuple[int, int], tuple[int, int]], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq
}  # fmt: skip
OWN = ("swarmwire-agent", "swarmwire-comms")  # these go from where they are installed, edited or not
LIBRARIES = ("purelib", "platlib")  # parts of a wheel's .data folder that belong beside its packages
LEFT_OUT = (".pyi", ".a", ".h", ".pxd")  # of no use where nothing is compiled or type-checked
PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input", "download", "--quiet", "--progress-bar", "off")
NOT_SENT = ("__pycache__",)
COMPILED = (".pyc", ".nbi", ".nbc")  # what this machine made of the sources
ABOUT = ("METADATA", "entry_points.txt")  # by which drivers are found
FORMAT = 1  # of what is made of wheels


@dataclass(frozen=True, order=True)
class RobotPlatform:
    """CPython on Linux with glibc."""

    python: tuple[int, int]
    machine: str
    glibc: tuple[int, int]

    @classmethod
    def from_facts(cls, facts: dict[str, Any]) -> "RobotPlatform":
        """Return the platform of a host with these facts; HostFailed if there are no packages for it."""
        libc, version = facts["libc"]
        if facts["system"] != "Linux" or facts["implementation"] != "cpython" or libc != "glibc":
            kind = f"{facts['implementation']} on {facts['system']} with {libc or 'another C library'}"
            raise HostFailed(f"expected CPython on Linux with glibc, got {kind}", "Raspberry Pi OS has these")
        if facts["machine"] not in MACHINES or facts["bits"] != 64:
            machine = f"{facts['machine']} with {facts['bits']} bits"
            raise HostFailed(f"expected {' or '.join(MACHINES)} with 64 bits, got {machine}", "install a 64-bit system")
        major, minor = (int(part) for part in version.split(".")[:2])
        return cls((facts["python"][0], facts["python"][1]), facts["machine"], (major, minor))

    def __str__(self) -> str:
        """As a name of a file, and for people."""
        return f"cp{self.python[0]}{self.python[1]}-{self.machine}-glibc{self.glibc[0]}.{self.glibc[1]}"

    def pip_arguments(self) -> list[str]:
        """The options with which pip looks for wheels of this platform."""
        platforms = [f"manylinux_2_{minor}_{self.machine}" for minor in range(self.glibc[1], FIRST_GLIBC - 1, -1)]
        platforms += [f"manylinux2014_{self.machine}", f"linux_{self.machine}"]
        version = f"{self.python[0]}.{self.python[1]}"
        options = ["--only-binary=:all:", "--no-deps", "--implementation", "cp", "--python-version", version]
        return options + [part for platform in platforms for part in ("--platform", platform)]


@dataclass(frozen=True, order=True)
class Pin:
    """A package at the one version that is meant."""

    name: str
    version: str

    def __str__(self) -> str:
        """As pip takes it."""
        return f"{self.name}=={self.version}"


def pins(drivers: Iterable[str], packages: Iterable[str], python: tuple[int, int]) -> tuple[Pin, ...]:
    """The packages of an agent with these drivers, and others that it imports, with all that they need in turn.

    What is needed by some versions of Python is taken if the robot's is one of them, what is needed under any other
    condition if it is installed here. BadInput for what is not installed here.
    """
    wanted = [(AGENT, frozenset[str]()), *map(_of_driver, drivers), *((name, frozenset[str]()) for name in packages)]
    found: dict[str, Pin] = {}
    seen: set[tuple[str, frozenset[str]]] = set()
    while wanted:
        name, extras = wanted.pop()
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        try:
            there = distribution(name)
        except PackageNotFoundError:
            raise BadInput("packages", name, f"is not installed here: pip install {name}") from None
        if _plain(name) not in OWN:
            found[_plain(name)] = Pin(_plain(name), there.version)
        wanted += _needs(there, extras, python)
    return tuple(sorted(found.values()))


def _of_driver(name: str) -> tuple[str, frozenset[str]]:
    """The package that brings a driver, and its extra of the driver's name if it has one."""
    for entry in entry_points(group=DRIVERS, name=name):
        if entry.dist is not None:
            extras = entry.dist.metadata.get_all("Provides-Extra") or []
            return entry.dist.name, frozenset({name} & set(extras))
    raise BadInput("driver.name", name, "expected a driver that is installed here")


def _needs(
    there: Distribution, extras: frozenset[str], python: tuple[int, int]
) -> Iterator[tuple[str, frozenset[str]]]:
    for text in there.requires or []:
        match = REQUIREMENT.match(text)
        if match is None:
            raise BadInput("packages", there.name, f"has a requirement that cannot be read: {text}")
        marker = match["marker"] or ""
        asked = EXTRA.search(marker)
        if asked and asked[1] not in extras:
            continue
        inner = frozenset(part.strip() for part in (match["extras"] or "").split(",") if part.strip())
        if marker and not asked and not _holds(marker, python, match["name"]):
            continue
        yield match["name"], inner


def _holds(marker: str, python: tuple[int, int], name: str) -> bool:
    versions = PYTHONS.fullmatch(marker.strip())
    if versions is None:
        return _is_installed(name)
    return COMPARED[versions["than"]](python, (int(versions["major"]), int(versions["minor"])))


def _is_installed(name: str) -> bool:
    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def download(pins: Sequence[Pin], target: RobotPlatform, into: Path, index: Sequence[str]) -> list[Path]:
    """The wheels of all pins; HostFailed if there is none of one for the target, or the index is out of reach.

    `index` are pip's options that say where wheels come from.
    """
    command = [sys.executable, *PIP, "--dest", str(into), *target.pip_arguments(), *index, *map(str, pins)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise _failed(done.stderr, target)
    return sorted(into.glob("*.whl"))


def _failed(errors: str, target: RobotPlatform) -> HostFailed:
    lines = [line.removeprefix("ERROR: ") for line in errors.splitlines() if line.startswith("ERROR: ")]
    missing = next((line for line in lines if line.startswith("No matching distribution")), None)
    if missing is None:
        last = lines[-1] if lines else errors.strip().rpartition("\n")[2]
        return HostFailed(f"pip cannot fetch the robot's packages: {last}", "is the package index within reach?")
    what = missing.rpartition(" for ")[2]
    cure = "install a version here that has one, or a newer Python on the robot"
    return HostFailed(f"there is no wheel of {what} for {target}", cure)


def entries_of(wheels: Iterable[Path]) -> list[ArchiveEntry]:
    """What wheels come to when they are installed, without scripts, tests and what compilers need."""
    entries: list[ArchiveEntry] = []
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            for info in archive.infolist():
                name = _place(info.filename)
                if name and not info.is_dir():
                    entries.append(ArchiveEntry(name, archive.read(info)))
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


def own_entries() -> list[ArchiveEntry]:
    """The files of both packages, and their metadata."""
    return [entry for name in OWN for entry in _entries_of(name)]


def _entries_of(name: str) -> Iterator[ArchiveEntry]:
    package = name.replace("-", ".")  # swarmwire-agent is swarmwire.agent
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise SwarmwireError(f"{name} is not installed here as it should be: there is no {package}")
    folder = Path(next(iter(spec.submodule_search_locations)))
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        if path.is_file() and path.suffix not in COMPILED and not set(NOT_SENT) & set(inner.parts):
            yield ArchiveEntry("/".join((*package.split("."), *inner.parts)), path.read_bytes())
    there = distribution(name)
    for about in ABOUT:
        text = there.read_text(about)
        if text is not None:
            yield ArchiveEntry(f"{name.replace('-', '_')}-{there.version}.dist-info/{about}", text.encode())


class Environments(Protocol):
    """Where a robot's packages come from."""

    def archives(self, target: RobotPlatform, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        """The archives whose content a robot's Python has on its path, first before last; HostFailed without."""
        ...


class LockedEnvironments:
    """Packages at the versions that are installed here, as wheels from an index; swarmwire's own as they are here."""

    def __init__(self, cache: Path | None = None, index: Sequence[str] = ()) -> None:
        """`index` are options of pip's that say where wheels come from, such as --find-links FOLDER."""
        self._cache, self._index = cache or default_cache(), tuple(index)

    def archives(self, target: RobotPlatform, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        """Swarmwire's own packages, which change often and are small, and all others."""
        return [self._own(), self._of_wheels(target, pins(drivers, packages, target.python))]

    def _own(self) -> Archive:
        entries = own_entries()
        name = name_of(entries)
        return self._kept(name) or self._keep(write_archive(entries, self._path(name), name))

    def _of_wheels(self, target: RobotPlatform, wanted: tuple[Pin, ...]) -> Archive:
        asked = self._cache / f"{target}-{_digest([*map(str, wanted), *self._index])}.txt"
        if asked.is_file():
            kept = self._kept(asked.read_text(encoding="utf-8").strip())
            if kept is not None:
                return kept
        with tempfile.TemporaryDirectory() as folder:
            wheels = download(wanted, target, Path(folder), self._index)
            sums = {wheel.name: hashlib.sha256(wheel.read_bytes()).hexdigest() for wheel in wheels}
            name = _digest([f"{name} {digest}" for name, digest in sums.items()])
            archive = self._kept(name) or self._keep(write_archive(entries_of(wheels), self._path(name), name))
        write_text(self._cache / f"{name}.wheels.json", json.dumps(sums, indent=2))
        write_text(asked, name)
        return archive

    def _path(self, name: str) -> Path:
        return self._cache / f"{name}.tar.gz"

    def _kept(self, name: str) -> Archive | None:
        """The archive of that name, if it has been made."""
        try:
            told: dict[str, Any] = json.loads((self._cache / f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        told["path"] = self._path(name)
        archive = Archive(**told)
        return archive if archive.path.is_file() and archive.path.stat().st_size == archive.size else None

    def _keep(self, archive: Archive) -> Archive:
        write_text(self._cache / f"{archive.name}.json", json.dumps({**asdict(archive), "path": ""}))
        return archive


def default_cache() -> Path:
    """The user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "swarmwire" / "robots"


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("\n".join([str(FORMAT), *sorted(lines)]).encode()).hexdigest()[:12]
