"""A release: all that one robot's folder holds, under a name that only the same content has."""

from collections.abc import Sequence
from pathlib import Path

import tomli_w

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.archive import Archive, Entry, name_of, write_archive
from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.robot_settings import CA, SETTINGS_FILE, robot_settings
from swarmwire.deploy.fleet.unit_file import unit_file

PRIVATE = 0o600


def package_links(environments: Sequence[Archive]) -> dict[str, str]:
    """The links within a release to the packages that it runs with, by their names."""
    return {f"packages-{place}": f"../../../env/{archive.name}" for place, archive in enumerate(environments)}


def release_entries(fleet: Fleet, robot: Robot, revoked: Sequence[str]) -> list[Entry]:
    """What a release holds whatever machine it goes to: agent, body, settings, certificates; BadInput without one."""
    settings = tomli_w.dumps(robot_settings(fleet, robot, revoked))
    entries = [Entry(SETTINGS_FILE, settings.encode())]
    for key, name in (("agent", _file_of(robot.settings["agent"])), ("body", robot.settings.get("body", ""))):
        if name.endswith((".py", ".toml")):
            where = robot.places[key]
            entries.append(Entry(Path(name).name, _read(fleet.file.parent / name, fleet, where)))
    if fleet.certificates is not None:
        if robot.name in revoked:
            raise BadInput(str(fleet.file), f"robots.{robot.name}", "its certificate is revoked")
        cure = f"swarmwire certs issue {fleet.certificates} --fleet {fleet.file}"
        if not (fleet.certificates / CA).exists():
            cure = f"swarmwire certs init {fleet.certificates}, then {cure}"
        for name, mode in ((CA, 0o644), (f"{robot.name}.pem", 0o644), (f"{robot.name}.key", PRIVATE)):
            data = _read(fleet.certificates / name, fleet, "certificates", cure)
            entries.append(Entry(name, data, mode))
    twice = {entry.name for entry in entries if sum(other.name == entry.name for other in entries) > 1}
    if twice:
        raise BadInput(str(fleet.file), f"robots.{robot.name}", f"expected one file of the name {twice.pop()}")
    return entries


def write_release(
    entries: Sequence[Entry], robot: Robot, python: str, environments: Sequence[Archive], folder: Path
) -> Archive:
    """The archive of a release for a machine with that Python, with links to its packages and its unit file."""
    links = package_links(environments)
    name, text = unit_file(robot.name, python, list(links))
    whole = [*entries, Entry(name, text.encode()), *(Entry(link, link=leads) for link, leads in links.items())]
    return write_archive(whole, folder / f"{robot.name}-{name_of(whole)}.tar.gz")


def _file_of(agent: str) -> str:
    place = agent.rpartition(":")[0]
    return place if place.endswith(".py") else ""


def _read(path: Path, fleet: Fleet, key: str, cure: str = "") -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        told = f"expected a readable file: {path}: {error.strerror}" + (f"; {cure}" if cure else "")
        raise BadInput(str(fleet.file), key, told) from None
