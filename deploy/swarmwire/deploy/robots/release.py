"""A release: the files of one robot's folder, under a name that only the same content has.

It holds `robot.toml` with the robot's settings and its place in the swarm's network, the agent, the body's sheet, the
robot's certificate, and its systemd unit, which runs the current release, watches it, and stops the motors after it.
"""

import gzip
import hashlib
import io
import tarfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from swarmwire.comms.base.atomic import PRIVATE, write_bytes
from swarmwire.comms.base.config import folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import file_of, with_file
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
from swarmwire.deploy.robots.host_side.system import unit_of

LEVEL = 6  # of compression: the next ones cost twice the time for a hundredth of the size


@dataclass(frozen=True)
class ArchiveEntry:
    """A file, or a link, of an archive."""

    name: str  # with "/"
    data: bytes = b""
    mode: int = 0o644
    link: str = ""  # where it leads; "": it is a file


@dataclass(frozen=True)
class Archive:
    """An archive on this machine's disk, under a name that only the same content has."""

    name: str
    path: Path
    sha256: str
    size: int
    unpacked: int  # bytes


def name_of(entries: Iterable[ArchiveEntry]) -> str:
    """The name of a content: the same entries in any order give the same."""
    digest = hashlib.sha256()
    for entry in sorted(entries, key=lambda entry: entry.name):
        data = hashlib.sha256(entry.data).hexdigest()
        digest.update(f"{entry.name}\0{entry.mode:o}\0{entry.link}\0{data}\n".encode())
    return digest.hexdigest()[:12]


def write_archive(entries: Iterable[ArchiveEntry], path: Path, name: str | None = None) -> Archive:
    """The archive of these entries at a path, which is there whole or not at all; named after them if not given."""
    ordered = sorted(entries, key=lambda entry: entry.name)
    made = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=made, mode="wb", compresslevel=LEVEL, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        for entry in ordered:
            member = tarfile.TarInfo(entry.name)
            member.mode, member.size = entry.mode, len(entry.data)
            if entry.link:
                member.type, member.linkname = tarfile.SYMTYPE, entry.link
            tar.addfile(member, io.BytesIO(entry.data))
    data = made.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, data, mode=PRIVATE)  # it may hold keys
    unpacked = sum(len(entry.data) for entry in ordered)
    return Archive(name or name_of(ordered), path, hashlib.sha256(data).hexdigest(), len(data), unpacked)


LOG = "../../log"  # beside the folder of releases: logs outlive them
CA, SETTINGS_FILE = "ca.pem", "robot.toml"
ROBOT_PROGRAM = ("-P", "-m", "swarmwire.agent.cli")  # of Python: it needs no scripts to be installed
UNIT = """\
[Unit]
Description=swarmwire robot {robot}
StartLimitIntervalSec=60
StartLimitBurst=5

[Service]
Type=notify
NotifyAccess=all
WorkingDirectory={current}
Environment="PYTHONPATH={paths}" PYTHONUNBUFFERED=1
ExecStart="{python}" {program} run --config {current}/robot.toml
ExecStopPost="{python}" {program} stop-motors --config {current}/robot.toml
WatchdogSec=10
TimeoutStartSec=30
TimeoutStopSec=10
KillMode=mixed
Restart=on-failure
RestartSec=2
NoNewPrivileges=yes
"""


def package_links(environments: Sequence[Archive]) -> dict[str, str]:
    """The links within a release to the packages that it runs with, by their names."""
    return {f"packages-{place}": f"../../../env/{archive.name}" for place, archive in enumerate(environments)}


def release_entries(fleet: Fleet, robot: FleetRobot, revoked: Sequence[str]) -> list[ArchiveEntry]:
    """The parts of a release common to all machines: agent, body, settings, certificates; BadInput without one."""
    settings = tomli_w.dumps(robot_settings(fleet, robot, revoked))
    entries = [ArchiveEntry(SETTINGS_FILE, settings.encode())]
    for key, name in (("agent", file_of(robot.settings["agent"])), ("body", robot.settings.get("body", ""))):
        if name.endswith((".py", ".onnx", ".toml")):
            where = robot.places[key]
            entries.append(ArchiveEntry(Path(name).name, _read(folder_of(fleet.file) / name, fleet, where)))
    if fleet.certificates is not None:
        if robot.name in revoked:
            raise BadInput(str(fleet.file), f"robots.{robot.name}", "its certificate is revoked")
        cure = f"swarmwire certs issue {fleet.certificates} --fleet {fleet.file}"
        if not (fleet.certificates / CA).exists():
            cure = f"swarmwire certs init {fleet.certificates}, then {cure}"
        for name, mode in ((CA, 0o644), (f"{robot.name}.pem", 0o644), (f"{robot.name}.key", PRIVATE)):
            data = _read(fleet.certificates / name, fleet, "certificates", cure)
            entries.append(ArchiveEntry(name, data, mode))
    twice = {entry.name for entry in entries if sum(other.name == entry.name for other in entries) > 1}
    if twice:
        raise BadInput(str(fleet.file), f"robots.{robot.name}", f"expected one file of the name {twice.pop()}")
    return entries


def write_release(
    entries: Sequence[ArchiveEntry], robot: FleetRobot, python: str, environments: Sequence[Archive], folder: Path
) -> Archive:
    """The archive of a release for a machine with that Python, with links to its packages and its unit file."""
    links = package_links(environments)
    name, text = unit_file(robot.name, python, list(links))
    whole = [
        *entries,
        ArchiveEntry(name, text.encode()),
        *(ArchiveEntry(link, link=leads) for link, leads in links.items()),
    ]
    return write_archive(whole, folder / f"{robot.name}-{name_of(whole)}.tar.gz")


def _read(path: Path, fleet: Fleet, key: str, cure: str = "") -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        told = f"expected a readable file: {path}: {error.strerror}" + (f"; {cure}" if cure else "")
        raise BadInput(str(fleet.file), key, told) from None


def robot_settings(fleet: Fleet, robot: FleetRobot, revoked: Sequence[str]) -> dict[str, Any]:
    """The content of a robot's `robot.toml`; files are beside it."""
    return {
        "format": 1,
        "name": robot.name,
        "swarm": fleet.swarm,
        "robots": [other.name for other in fleet.robots],
        **robot.settings,
        "agent": _beside(robot.settings["agent"]),
        **({"body": _beside(robot.settings["body"])} if "body" in robot.settings else {}),
        "network": _network(fleet, robot, revoked),
        "log": LOG,
    }


def _network(fleet: Fleet, robot: FleetRobot, revoked: Sequence[str]) -> dict[str, Any]:
    protocol, _, address = robot.endpoint.partition("/")
    network: dict[str, Any] = {
        "listen": [f"{protocol}/0.0.0.0:{address.rpartition(':')[2]}"],
        # One of each two calls: both would have them meet twice, and one link be closed again.
        "connect": [other.endpoint for other in fleet.robots[: fleet.robots.index(robot)]],
    }
    if not network["connect"]:
        del network["connect"]
    if fleet.certificates is None:
        return {**network, "insecure": True}
    return {**network, **_proof(fleet, robot.name, revoked)}


def _proof(fleet: Fleet, name: str, revoked: Sequence[str]) -> dict[str, Any]:
    proof: dict[str, Any] = {"ca": CA, "certificate": f"{name}.pem", "key": f"{name}.key", "operator": fleet.operator}
    return {**proof, "revoked": list(revoked)} if revoked else proof


def _beside(name: str) -> str:
    """A file's name in the folder of the settings, to which it is copied; what is no file stays as it is."""
    return Path(name).name if name.endswith(".toml") else with_file(name, Path(file_of(name)).name)


def unit_file(robot: str, python: str, packages: Sequence[str]) -> tuple[str, str]:
    """Name and content; `packages` are the links within a release to what its Python has on its path.

    It is not started with the machine: no robot moves because it was switched on.
    """
    current = f"%h/swarmwire/{robot}/current"
    # The agent, which tells systemd that it lives, is a child of its guard: hence NotifyAccess, and KillMode, with
    # which the guard alone is told to end: it passes that on.
    paths = ":".join(f"{current}/{name}" for name in packages)
    text = UNIT.format(robot=robot, current=current, paths=paths, python=python, program=" ".join(ROBOT_PROGRAM))
    return unit_of(robot), text
