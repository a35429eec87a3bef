"""Requests to a host, and its answers: one line of JSON each.

A request travels as {"request": class name, field: value, …}. The bytes of an archive follow an `Upload`. An answer is
{"result": value} or {"refused": kind, "text": text}; the type of the result is the request's `RESULT`.
"""

import json
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Generic, TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class HostFacts:
    """Python, machine, disk and system manager of a host: its first answer."""

    python: tuple[int, int, int]
    implementation: str
    executable: str
    system: str
    machine: str
    bits: int
    libc: tuple[str, str]  # name and version
    free_bytes: int
    manager: str  # state of the user's system manager: "running", "degraded", …; "": none; NO_SYSTEMD


@dataclass(frozen=True)
class RobotReleases:
    """Releases of a robot on a host."""

    current: str | None
    names: list[str]
    unit_installed: bool  # the unit file is that of the current release


@dataclass(frozen=True)
class Inventory:
    """Environments of a host, and the releases of robots by name."""

    environments: list[str]
    robots: dict[str, RobotReleases]


@dataclass(frozen=True)
class UnitState:
    """State of a robot's unit as systemd reports it, and the releases and status of the robot."""

    load: str
    active: str
    sub: str
    result: str
    restarts: int
    active_since: str
    running: str  # release in whose folder the unit's process runs; "": none
    current: str | None  # release that starts next
    status: dict[str, Any] | None  # content of the agent's status file


@dataclass(frozen=True)
class HostRequest(Generic[Result]):
    """A request; `Result` is the type of its answer."""

    RESULT: ClassVar[Any] = None

    def line(self) -> bytes:
        """Return the request as a line of JSON."""
        return json.dumps({"request": type(self).__name__, **asdict(self)}).encode() + b"\n"


@dataclass(frozen=True)
class Upload(HostRequest[None]):
    """A request that an archive of `size` bytes follows."""

    size: int
    sha256: str


@dataclass(frozen=True)
class Lock(HostRequest[None]):
    """Lock the host for this connection."""


@dataclass(frozen=True)
class ClearParts(HostRequest[None]):
    """Remove the remains of interrupted deployments."""

    robots: list[str]


@dataclass(frozen=True)
class ReadInventory(HostRequest[Inventory]):
    """List environments and releases."""

    RESULT: ClassVar[Any] = Inventory
    robots: list[str]


@dataclass(frozen=True)
class PutEnvironment(Upload):
    """Unpack an environment."""

    name: str


@dataclass(frozen=True)
class PutRelease(Upload):
    """Unpack a release for its trial."""

    robot: str
    name: str


@dataclass(frozen=True)
class TryRelease(HostRequest[None]):
    """Run a command with the Python of the host in an unpacked release; a failure removes the release."""

    robot: str
    release: str
    packages: list[str]  # links to environments
    command: list[str]
    timeout_s: float


@dataclass(frozen=True)
class SwitchRelease(HostRequest[None]):
    """Make a release the current one."""

    robot: str
    release: str


@dataclass(frozen=True)
class RollBack(HostRequest[str]):
    """Make the release before the current one current, and return its name."""

    RESULT: ClassVar[Any] = str
    robot: str


@dataclass(frozen=True)
class RemoveOld(HostRequest[None]):
    """Remove old releases, and environments that no release needs."""

    robots: list[str]


@dataclass(frozen=True)
class ReadClock(HostRequest[int]):
    """Read the clock, in ns since 1970."""

    RESULT: ClassVar[Any] = int


@dataclass(frozen=True)
class ReadLinger(HostRequest[bool]):
    """Return True if the user's units keep running without a login session."""

    RESULT: ClassVar[Any] = bool


@dataclass(frozen=True)
class EnableLinger(HostRequest[str]):
    """Let the user's units keep running without a login session; return the fault, or ""."""

    RESULT: ClassVar[Any] = str


@dataclass(frozen=True)
class ControlUnits(HostRequest[dict[str, str]]):
    """Start, stop or restart units; return the fault of each robot, or ""."""

    RESULT: ClassVar[Any] = dict[str, str]
    verb: str  # "start", "stop" or "restart"
    robots: list[str]


@dataclass(frozen=True)
class ReadUnits(HostRequest[dict[str, UnitState]]):
    """Return the state of each robot's unit."""

    RESULT: ClassVar[Any] = dict[str, UnitState]
    robots: list[str]


@dataclass(frozen=True)
class TryConnection(HostRequest[str]):
    """Connect from the host to a TCP address; return the fault, or ""."""

    RESULT: ClassVar[Any] = str
    address: str
    port: int
    timeout_s: float
