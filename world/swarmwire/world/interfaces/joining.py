"""Existing network namespaces that robots join: named ones, and those of processes and of containers."""

import errno
import os
import shutil
import socket
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.config.radio import Interface
from swarmwire.world.interfaces.addresses import check_unused
from swarmwire.world.interfaces.namespaces import NAME, ExistingNamespace, call_inside

KEY = "radio.interface.join"
FORMS = "netns:NAME, pid:NUMBER or container:NAME"
NAMED = Path("/run/netns")  # namespaces that `ip netns add` made
ENGINES = "docker", "podman"
ENGINE_TIMEOUT_S = 20.0
GONE = {
    "netns": "a network namespace in /run/netns, as ip netns add makes it",
    "pid": "a running process of this machine",
    "container": f"a running container that {' or '.join(ENGINES)} of this machine knows",
}  # by kind, what a join expects


@dataclass(frozen=True, slots=True)
class Join:
    """The namespace that a robot joins, as the scenario names it."""

    robot: str
    kind: str  # key of GONE
    name: str
    where: str  # the scenario
    key: str  # of its entry

    @property
    def text(self) -> str:
        """Text of the entry, for this robot."""
        return f"{self.kind}:{self.name}"

    def refused(self, expected: str) -> BadInput:
        """Return the error about this entry."""
        return BadInput(self.where, self.key, f"expected {expected}; got {self.text}")

    def failed(self, error: OSError) -> BadInput:
        """Return the error about this entry for the system's error."""
        if error.errno == errno.EBUSY:
            return self.refused(f"a network namespace without a device {NAME}: it has one")
        if error.errno in (errno.EPERM, errno.EACCES):
            return self.refused("rights to enter the network namespace: run as root")
        return self.refused(GONE[self.kind])  # also EINVAL: what is left of a namespace is an empty file


def joins_of(interface: Interface, static: Static, where: str) -> dict[int, Join]:
    """Return the joins by robot index; BadInput for entries of no robot, of no known form, or with one namespace."""
    robots = {name: range(index, index + 1) for index, name in enumerate(static.robot_names)}
    groups = {group.name: range(group.start, group.stop) for group in static.groups}
    entries = interface.join or {}
    joins: dict[int, Join] = {}
    for name in sorted(entries, key=robots.__contains__):  # a robot's entry replaces that of its group
        key = f"{KEY}.{name}"
        rows = robots.get(name) or groups.get(name)
        if rows is None:
            raise BadInput(where, key, f"expected {did_you_mean([*groups, *robots], name)}")
        joins |= {row: _join(entries[name], row, static, where, key) for row in rows}
    _refuse_shared({row: join.text for row, join in joins.items()}, joins)
    return joins


def find_namespaces(joins: Mapping[int, Join], interface: Interface) -> dict[int, ExistingNamespace]:
    """Return the namespaces by robot index; BadInput for one that does not exist, or cannot have the device."""
    existing = {row: ExistingNamespace(*_path_and_pid(join)) for row, join in joins.items()}
    identities: dict[int, object] = {}
    for row, join in joins.items():
        try:
            identities[row] = _checked(join, existing[row].path, interface)
        except OSError as error:
            raise join.failed(error) from error
    _refuse_shared(identities, joins)
    return existing


def _join(entry: str, row: int, static: Static, where: str, key: str) -> Join:
    robot = static.robot_names[row]
    index = next(row - group.start for group in static.groups if group.start <= row < group.stop)
    kind, _, name = entry.replace("{index}", str(index)).replace("{name}", robot).partition(":")
    is_valid = kind in GONE and name and not set(name) & set("{}")
    if kind == "pid":
        is_valid = name.isdecimal() and int(name) > 0
    elif kind == "netns":
        is_valid = is_valid and "/" not in name and name not in (".", "..")
    if not is_valid:
        raise BadInput(where, key, f"expected {FORMS}, where {{index}} or {{name}} of a robot may be; got {entry!r}")
    return Join(robot, kind, name, where, key)


def _refuse_shared(identities: Mapping[int, object], joins: Mapping[int, Join]) -> None:
    first: dict[object, Join] = {}
    for row, identity in identities.items():
        if (other := first.setdefault(identity, joins[row])) is not joins[row]:
            robot = joins[row].robot
            raise joins[row].refused(f"a network namespace for each robot: {other.robot} and {robot} share one")


def _checked(join: Join, path: Path, interface: Interface) -> object:
    """Return what identifies a namespace; BadInput or OSError if a robot cannot join it."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)

    def look() -> tuple[bool, str]:
        taken = False
        with suppress(OSError):
            taken = bool(socket.if_nametoindex(NAME))
        return taken, Path("/proc/thread-self/net/route").read_text()

    try:
        taken, routes = call_inside(descriptor, look)
        status = os.fstat(descriptor)
    finally:
        os.close(descriptor)
    if taken:
        raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
    check_unused(interface, join.where, routes, join.text)
    return status.st_dev, status.st_ino


def _path_and_pid(join: Join) -> tuple[Path, int | None]:
    """Return the file of the namespace, and the process whose end ends the join."""
    if join.kind == "netns":
        return NAMED / join.name, None
    pid = int(join.name) if join.kind == "pid" else _container_pid(join)
    return Path(f"/proc/{pid}/ns/net"), pid


def _container_pid(join: Join) -> int:
    """Return the number of a container's first process, by the engine's own command."""
    engines = [path for engine in ENGINES if (path := shutil.which(engine))]
    if not engines:
        raise join.refused(f"{' or '.join(ENGINES)} on PATH")
    reasons: list[str] = []
    for engine in engines:
        command = [engine, "inspect", "--type", "container", "--format", "{{.State.Pid}}", "--", join.name]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=ENGINE_TIMEOUT_S, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            reasons.append(str(error))
            continue
        pid = done.stdout.strip()
        if pid.isdecimal() and int(pid):
            return int(pid)
        reasons.append(done.stderr.strip() or "it does not run")  # then its number is 0
    raise join.refused(f"{GONE['container']} ({'; '.join(reasons)})")
