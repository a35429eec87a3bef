"""Packages for robots: the versions of this machine, as wheels for the robot's platform.

`pins` resolves the packages that an agent needs, pip downloads their wheels, and `LockedEnvironments` caches an archive
for each platform and set of versions. swarmwire's own packages are copied as they are installed on this machine.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, distribution, entry_points
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, Protocol

from packaging.requirements import InvalidRequirement, Requirement
from packaging.utils import canonicalize_name

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.deploy.robots.archives import Archive, ArchiveEntry, name_of, write_archive
from swarmwire.deploy.robots.host_side.messages import HostFacts
from swarmwire.deploy.robots.result import HostFailed

MIN_GLIBC_MINOR = 17  # oldest glibc of current wheels: manylinux_2_17
MACHINES = ("aarch64", "x86_64")
AGENT = "swarmwire-agent"
DRIVERS = "swarmwire.drivers"  # group of entry points
SWARMWIRE = ("swarmwire-agent", "swarmwire-comms")  # copied from their installation, editable or not
LIBRARIES = ("purelib", "platlib")  # parts of a wheel's .data folder that are installed next to its packages
EXCLUDED_SUFFIXES = (".pyi", ".a", ".h", ".pxd")  # files for compilers and type checkers
PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input", "download", "--quiet", "--progress-bar", "off")
EXCLUDED_FOLDERS = ("__pycache__",)
COMPILED = (".pyc", ".nbi", ".nbc")  # files that this machine compiled from the sources
METADATA_FILES = ("METADATA", "entry_points.txt")  # the robot finds its drivers in these
FORMAT = 1  # version of the cached archives


@dataclass(frozen=True, order=True)
class RobotPlatform:
    """CPython on Linux with glibc."""

    python: tuple[int, int]
    machine: str
    glibc: tuple[int, int]

    @classmethod
    def from_facts(cls, facts: HostFacts) -> "RobotPlatform":
        """Return the platform of a host; HostFailed if there are no packages for it."""
        libc, version = facts.libc
        if facts.system != "Linux" or facts.implementation != "cpython" or libc != "glibc":
            kind = f"{facts.implementation} on {facts.system} with {libc or 'another C library'}"
            raise HostFailed(f"expected CPython on Linux with glibc, got {kind}", "Raspberry Pi OS has these")
        if facts.machine not in MACHINES or facts.bits != 64:
            machine = f"{facts.machine} with {facts.bits} bits"
            raise HostFailed(f"expected {' or '.join(MACHINES)} with 64 bits, got {machine}", "install a 64-bit system")
        major, minor = (int(part) for part in version.split(".")[:2])
        return cls(facts.python[:2], facts.machine, (major, minor))

    def __str__(self) -> str:
        """Return a text that is also the beginning of a file name."""
        return f"cp{self.python[0]}{self.python[1]}-{self.machine}-glibc{self.glibc[0]}.{self.glibc[1]}"

    @property
    def python_version(self) -> str:
        """Version of Python, such as 3.11."""
        return f"{self.python[0]}.{self.python[1]}"

    def markers(self) -> dict[str, str]:
        """Return the environment for the markers of requirements."""
        return {
            "implementation_name": "cpython",
            "implementation_version": f"{self.python_version}.0",
            "os_name": "posix",
            "platform_machine": self.machine,
            "platform_python_implementation": "CPython",
            "platform_release": "",
            "platform_system": "Linux",
            "platform_version": "",
            "python_full_version": f"{self.python_version}.0",
            "python_version": self.python_version,
            "sys_platform": "linux",
        }

    def pip_arguments(self) -> list[str]:
        """Return pip's options for wheels of this platform."""
        platforms = [f"manylinux_2_{minor}_{self.machine}" for minor in range(self.glibc[1], MIN_GLIBC_MINOR - 1, -1)]
        platforms += [f"manylinux2014_{self.machine}", f"linux_{self.machine}"]
        options = [
            "--only-binary=:all:",
            "--no-deps",
            "--implementation",
            "cp",
            "--python-version",
            self.python_version,
        ]
        return options + [part for platform in platforms for part in ("--platform", platform)]


@dataclass(frozen=True, order=True)
class Pin:
    """A package at one version."""

    name: str
    version: str

    def __str__(self) -> str:
        """Return the requirement for pip."""
        return f"{self.name}=={self.version}"


class Need(NamedTuple):
    """A needed package and its extras."""

    name: str
    extras: frozenset[str] = frozenset()


def pins(drivers: Iterable[str], packages: Iterable[str], platform: RobotPlatform) -> tuple[Pin, ...]:
    """Return the pins of an agent with these drivers and of further packages, with all their requirements.

    Markers of requirements are evaluated for the robot's platform. BadInput for a package that this machine lacks.
    """
    pending = [Need(AGENT), *map(_driver_package, drivers), *map(Need, packages)]
    pin_of: dict[str, Pin] = {}
    seen: set[Need] = set()
    while pending:
        need = pending.pop()
        if need in seen:
            continue
        seen.add(need)
        try:
            installed = distribution(need.name)
        except PackageNotFoundError:
            raise BadInput("packages", need.name, "is not installed here; install it") from None
        name = canonicalize_name(need.name)
        if name not in SWARMWIRE:
            pin_of[name] = Pin(name, installed.version)
        pending += _requirements(need, installed.requires or (), platform)
    return tuple(sorted(pin_of.values()))


def _driver_package(name: str) -> Need:
    """Return the package of a driver, with its extra of the driver's name if it has one."""
    for entry in entry_points(group=DRIVERS, name=name):
        if entry.dist is not None:
            extras = entry.dist.metadata.get_all("Provides-Extra") or []
            return Need(entry.dist.name, frozenset({name} & set(extras)))
    raise BadInput("driver.name", name, "expected a driver that is installed here")


def _requirements(need: Need, texts: Iterable[str], platform: RobotPlatform) -> Iterator[Need]:
    """Yield the requirements of a package that hold for its extras and the platform."""
    environments = [{**platform.markers(), "extra": extra} for extra in need.extras or {""}]
    for text in texts:
        try:
            requirement = Requirement(text)
        except InvalidRequirement:
            raise BadInput("packages", need.name, f"has a requirement that cannot be read: {text}") from None
        if requirement.marker is None or any(map(requirement.marker.evaluate, environments)):
            yield Need(requirement.name, frozenset(requirement.extras))


def download(pins: Sequence[Pin], platform: RobotPlatform, folder: Path, index: Sequence[str]) -> list[Path]:
    """Download the wheels of all pins; HostFailed if one does not exist for the platform, or the index does not answer.

    `index` are pip's options for the source of wheels.
    """
    command = [sys.executable, *PIP, "--dest", str(folder), *platform.pip_arguments(), *index, *map(str, pins)]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode:
        raise _pip_failure(process.stderr, platform)
    return sorted(folder.glob("*.whl"))


def _pip_failure(errors: str, platform: RobotPlatform) -> HostFailed:
    lines = [line.removeprefix("ERROR: ") for line in errors.splitlines() if line.startswith("ERROR: ")]
    missing = next((line for line in lines if line.startswith("No matching distribution")), None)
    if missing is None:
        last = lines[-1] if lines else errors.strip().rpartition("\n")[2]
        return HostFailed(f"pip cannot fetch the robot's packages: {last}", "is the package index within reach?")
    requirement = missing.rpartition(" for ")[2]
    remedy = "install a version here that has one, or a newer Python on the robot"
    return HostFailed(f"there is no wheel of {requirement} for {platform}", remedy)


def entries_of(wheels: Iterable[Path]) -> list[ArchiveEntry]:
    """Return the files that wheels install, without scripts, tests and files for compilers."""
    entries: list[ArchiveEntry] = []
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            for info in archive.infolist():
                name = _installed_path(info.filename)
                if name and not info.is_dir():
                    entries.append(ArchiveEntry(name, archive.read(info)))
    return entries


def _installed_path(name: str) -> str:
    """Return the path at which a file of a wheel is installed; "" for an excluded file."""
    path = PurePosixPath(name)
    if path.parts[0].endswith(".data"):
        if len(path.parts) < 3 or path.parts[1] not in LIBRARIES:
            return ""
        path = PurePosixPath(*path.parts[2:])
    is_excluded = path.suffix in EXCLUDED_SUFFIXES or (path.parts[0] == "numpy" and "tests" in path.parts)
    return "" if is_excluded or ".." in path.parts else str(path)


def swarmwire_entries() -> list[ArchiveEntry]:
    """Return the files of swarmwire's packages for robots, and their metadata."""
    return [entry for name in SWARMWIRE for entry in _installed_entries(name)]


def _installed_entries(name: str) -> Iterator[ArchiveEntry]:
    package = name.replace("-", ".")  # swarmwire-agent is swarmwire.agent
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise SwarmwireError(f"{name} is not installed here as it should be: there is no {package}")
    folder = Path(next(iter(spec.submodule_search_locations)))
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        if path.is_file() and path.suffix not in COMPILED and not set(EXCLUDED_FOLDERS) & set(inner.parts):
            yield ArchiveEntry("/".join((*package.split("."), *inner.parts)), path.read_bytes())
    installed = distribution(name)
    for file in METADATA_FILES:
        text = installed.read_text(file)
        if text is not None:
            yield ArchiveEntry(f"{name.replace('-', '_')}-{installed.version}.dist-info/{file}", text.encode())


class Environments(Protocol):
    """Source of a robot's packages."""

    def archives(self, platform: RobotPlatform, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        """Return the archives that a robot's Python has on its path, in this order; HostFailed without a wheel."""
        ...


class LockedEnvironments:
    """Packages at the versions of this machine, as wheels from an index; swarmwire's own as they are installed."""

    def __init__(self, cache: Path | None = None, index: Sequence[str] = ()) -> None:
        """`index` are pip's options for the source of wheels, such as --find-links FOLDER."""
        self._cache, self._index = cache or default_cache(), tuple(index)

    def archives(self, platform: RobotPlatform, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        """Return an archive of swarmwire's own packages, which change often and are small, and one of all others."""
        return [self._swarmwire(), self._wheels(platform, pins(drivers, packages, platform))]

    def _swarmwire(self) -> Archive:
        entries = swarmwire_entries()
        name = name_of(entries)
        return self._cached(name) or self._store(write_archive(entries, self._path(name), name))

    def _wheels(self, platform: RobotPlatform, pins: tuple[Pin, ...]) -> Archive:
        name_file = self._cache / f"{platform}-{_digest([*map(str, pins), *self._index])}.txt"
        if name_file.is_file():
            cached = self._cached(name_file.read_text(encoding="utf-8").strip())
            if cached is not None:
                return cached
        with tempfile.TemporaryDirectory() as folder:
            wheels = download(pins, platform, Path(folder), self._index)
            sums = {wheel.name: hashlib.sha256(wheel.read_bytes()).hexdigest() for wheel in wheels}
            name = _digest([f"{wheel} {digest}" for wheel, digest in sums.items()])
            archive = self._cached(name) or self._store(write_archive(entries_of(wheels), self._path(name), name))
        write_text(self._cache / f"{name}.wheels.json", json.dumps(sums, indent=2))
        write_text(name_file, name)
        return archive

    def _path(self, name: str) -> Path:
        return self._cache / f"{name}.tar.gz"

    def _cached(self, name: str) -> Archive | None:
        """Return the archive of that name, if the cache has it."""
        try:
            fields: dict[str, Any] = json.loads((self._cache / f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        fields["path"] = self._path(name)
        archive = Archive(**fields)
        return archive if archive.path.is_file() and archive.path.stat().st_size == archive.size else None

    def _store(self, archive: Archive) -> Archive:
        write_text(self._cache / f"{archive.name}.json", json.dumps({**asdict(archive), "path": ""}))
        return archive


def default_cache() -> Path:
    """Return the folder of packages in the user's cache."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "swarmwire" / "robots"


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("\n".join([str(FORMAT), *sorted(lines)]).encode()).hexdigest()[:12]
