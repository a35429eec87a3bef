"""A release: the files of one robot's folder, under a name that only the same content has.

It contains `robot.toml` with the robot's settings and its network, the agent, the body's sheet, the robot's
certificate, and its systemd unit, which runs and watches the current release, and stops the motors after it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from swarmwire.comms.base.atomic import PRIVATE
from swarmwire.comms.base.config import folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import file_of, with_file
from swarmwire.deploy.robots.archives import Archive, ArchiveEntry, name_of, write_archive
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
from swarmwire.deploy.robots.host_side.system import unit_of

LOG = "../../log"  # next to the folder of releases: logs outlive them
CA, SETTINGS_FILE = "ca.pem", "robot.toml"
ROBOT_PROGRAM = ("-P", "-m", "swarmwire.agent.cli")  # arguments of Python: no scripts are installed
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
    """Return the links in a release to its packages, by name."""
    return {f"packages-{i}": f"../../../env/{archive.name}" for i, archive in enumerate(environments)}


def release_entries(fleet: Fleet, robot: FleetRobot, revoked: Sequence[str]) -> list[ArchiveEntry]:
    """Return the entries of a release that all machines share: agent, body, settings, certificates.

    BadInput if a file is missing.
    """
    settings = tomli_w.dumps(robot_settings(fleet, robot, revoked))
    entries = [ArchiveEntry(SETTINGS_FILE, settings.encode())]
    for key, name in (("agent", file_of(robot.settings["agent"])), ("body", robot.settings.get("body", ""))):
        if name.endswith((".py", ".onnx", ".toml")):
            data = _read(folder_of(fleet.file) / name, fleet, robot.key_paths[key])
            entries.append(ArchiveEntry(Path(name).name, data))
    if fleet.certificates is not None:
        if robot.name in revoked:
            raise BadInput(str(fleet.file), f"robots.{robot.name}", "its certificate is revoked")
        remedy = f"swarmwire certs issue {fleet.certificates} --fleet {fleet.file}"
        if not (fleet.certificates / CA).exists():
            remedy = f"swarmwire certs init {fleet.certificates}, then {remedy}"
        for name, mode in ((CA, 0o644), (f"{robot.name}.pem", 0o644), (f"{robot.name}.key", PRIVATE)):
            data = _read(fleet.certificates / name, fleet, "certificates", remedy)
            entries.append(ArchiveEntry(name, data, mode))
    names = [entry.name for entry in entries]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise BadInput(str(fleet.file), f"robots.{robot.name}", f"expected one file of the name {repeated.pop()}")
    return entries


def write_release(
    entries: Sequence[ArchiveEntry], robot: FleetRobot, python: str, environments: Sequence[Archive], folder: Path
) -> Archive:
    """Write the archive of a release for a machine with that Python; it has links to its packages and a unit file."""
    links = package_links(environments)
    name, text = unit_file(robot.name, python, list(links))
    all_entries = [
        *entries,
        ArchiveEntry(name, text.encode()),
        *(ArchiveEntry(link, link=target) for link, target in links.items()),
    ]
    return write_archive(all_entries, folder / f"{robot.name}-{name_of(all_entries)}.tar.gz")


def _read(path: Path, fleet: Fleet, key: str, remedy: str = "") -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        expected = f"expected a readable file: {path}: {error.strerror}" + (f"; {remedy}" if remedy else "")
        raise BadInput(str(fleet.file), key, expected) from None


def robot_settings(fleet: Fleet, robot: FleetRobot, revoked: Sequence[str]) -> dict[str, Any]:
    """Return the content of a robot's `robot.toml`; its files are in the same folder."""
    return {
        "format": 1,
        "name": robot.name,
        "swarm": fleet.swarm,
        "robots": [other.name for other in fleet.robots],
        **robot.settings,
        "agent": _local_name(robot.settings["agent"]),
        **({"body": _local_name(robot.settings["body"])} if "body" in robot.settings else {}),
        "network": _network(fleet, robot, revoked),
        "log": LOG,
    }


def _network(fleet: Fleet, robot: FleetRobot, revoked: Sequence[str]) -> dict[str, Any]:
    protocol, _, address = robot.endpoint.partition("/")
    network: dict[str, Any] = {
        "listen": [f"{protocol}/0.0.0.0:{address.rpartition(':')[2]}"],
        # One robot of each pair connects: with two links, one would be closed again.
        "connect": [other.endpoint for other in fleet.robots[: fleet.robots.index(robot)]],
    }
    if not network["connect"]:
        del network["connect"]
    if fleet.certificates is None:
        return {**network, "insecure": True}
    return {**network, **_credentials(fleet, robot.name, revoked)}


def _credentials(fleet: Fleet, name: str, revoked: Sequence[str]) -> dict[str, Any]:
    credentials: dict[str, Any] = {
        "ca": CA,
        "certificate": f"{name}.pem",
        "key": f"{name}.key",
        "operator": fleet.operator,
    }
    return {**credentials, "revoked": list(revoked)} if revoked else credentials


def _local_name(name: str) -> str:
    """Return a file's name in the folder of the settings, to which it is copied; other names do not change."""
    return Path(name).name if name.endswith(".toml") else with_file(name, Path(file_of(name)).name)


def unit_file(robot: str, python: str, packages: Sequence[str]) -> tuple[str, str]:
    """Return name and content of a unit file; `packages` are the links in a release to the packages of its Python.

    The unit does not start with the machine: no robot moves because it was switched on.
    """
    current = f"%h/swarmwire/{robot}/current"
    # The agent, which sends systemd its heartbeats, is a child of its guard: hence NotifyAccess. KillMode sends the
    # signal to end to the guard alone, which passes it on.
    paths = ":".join(f"{current}/{name}" for name in packages)
    text = UNIT.format(robot=robot, current=current, paths=paths, python=python, program=" ".join(ROBOT_PROGRAM))
    return unit_of(robot), text
