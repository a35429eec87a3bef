"""Checks before a deployment: settings on this machine (`contents_of`), and the robots' hosts (`check`)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from swarmwire.agent.on_robot.plan import robot_config
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.archive import Entry
from swarmwire.deploy.fleet.deploy import SPARE_BYTES
from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.host_session import HostSession, on_hosts
from swarmwire.deploy.fleet.packages import Target
from swarmwire.deploy.fleet.release import SETTINGS_FILE, release_entries
from swarmwire.deploy.fleet.result import SILENT, HostFailed, Result, Watcher

REACH_S = 3.0
MAX_AHEAD_NS = 20_000_000  # of a clock: more would show in latencies between robots
NS_PER_MS = 1_000_000
FIRST_DEPLOYMENT_BYTES = 150_000_000 + SPARE_BYTES  # what packages come to
PORTS = {"epuck2": 1000, "ros2": 7447}  # of drivers' protocols, where the address says none


async def check(
    fleet: Fleet, robots: Sequence[Robot], faults: Mapping[str, BadInput], watcher: Watcher = SILENT
) -> list[Result]:
    """A line per robot: what it is, or the first thing that is wrong; `faults` are those of settings, found here."""

    async def one(session: HostSession, robot: Robot) -> Result:
        if robot.name in faults:
            raise HostFailed(str(faults[robot.name]))
        watcher.step(robot.name, "check")
        said = session.facts
        target = Target.of(said)
        session.need_manager()
        if said["free_bytes"] < FIRST_DEPLOYMENT_BYTES:
            free = f"{said['free_bytes'] / 1e6:.0f} MB are free, {FIRST_DEPLOYMENT_BYTES / 1e6:.0f} MB are needed"
            raise HostFailed(f"the disk is full: {free}", "make room: df -h")
        notes = await _notes(session, robot)
        version = ".".join(map(str, said["python"]))
        machine = f"Python {version}, {target.machine}, glibc {target.glibc[0]}.{target.glibc[1]}"
        return Result(robot.name, True, "; ".join([machine, f"{said['free_bytes'] / 1e9:.1f} GB free", *notes]))

    return await on_hosts(robots, fleet.known_hosts, one, watcher=watcher)


async def _notes(session: HostSession, robot: Robot) -> list[str]:
    """What is as it should be, or can be lived with; HostFailed for a driver's robot that does not answer."""
    notes = [await _clock(session)]
    endpoint = driver_endpoint(robot.settings["driver"])
    if endpoint is not None:
        host, port = endpoint
        fault = await session.ask("reach", host=host, port=port, timeout_s=REACH_S)
        if fault:
            cure = "is it switched on, and driver.address right?"
            raise HostFailed(f"the driver's address {host}:{port} does not answer from there: {fault}", cure)
        notes.append(f"{host}:{port} answers")
    if not await session.ask("lingers"):
        notes.append("linger is off: start switches it on")
    return notes


async def _clock(session: HostSession) -> str:
    ahead_ns, within_ns = await session.clock_ahead_ns(WallClock())
    told = f"clock {ahead_ns / NS_PER_MS:+.0f} ms (within {within_ns / NS_PER_MS:.0f})"
    if abs(ahead_ns) - within_ns > MAX_AHEAD_NS:
        return f"{told}: latencies will be wrong by that, run NTP on it (timedatectl set-ntp true)"
    return told


def driver_endpoint(driver: Mapping[str, Any]) -> tuple[str, int] | None:
    """Host and TCP port of a driver's address; None if it has another kind of address, or none.

    >>> driver_endpoint({"name": "epuck2", "address": "192.168.1.41"})
    ('192.168.1.41', 1000)
    >>> driver_endpoint({"name": "ros2", "address": "tcp/turtle:7448"})
    ('turtle', 7448)
    """
    protocol, slash, rest = str(driver.get("address", "")).rpartition("/")
    if slash and protocol not in ("tcp", "tls"):
        return None
    host, colon, port = rest.rpartition(":")
    if colon and port.isdecimal() and host:
        return host.strip("[]"), int(port)
    known = PORTS.get(str(driver.get("name")))
    return (rest, known) if rest and known else None


def check_robot(fleet: Fleet, robot: Robot, entries: Sequence[Entry]) -> str:
    """What the robot will be, in words; BadInput names the place in `fleet.toml` of what does not fit.

    The files of its release are read as the robot would read them.
    """
    with TemporaryDirectory() as folder:
        for entry in entries:
            path = Path(folder, entry.name)
            path.touch(mode=entry.mode)
            path.write_bytes(entry.data)
        file = Path(folder, SETTINGS_FILE)
        try:
            return str(robot_config(read_settings(file, {}), str(file), WallClock()))
        except BadInput as error:
            raise BadInput(*_place_in(fleet, robot, error, Path(folder))) from None


def _place_in(fleet: Fleet, robot: Robot, error: BadInput, folder: Path) -> tuple[str, str, str]:
    """File, key and what was expected, as people wrote them."""
    first, _, rest = error.key.partition(".")
    key = ".".join(filter(None, (robot.places.get(first, f"robots.{robot.name}.{first}".rstrip(".")), rest)))
    beside = Path(error.where)
    if beside.is_relative_to(folder) and beside.name != SETTINGS_FILE:  # of a body's sheet
        return beside.name, error.key, error.expected
    return str(fleet.file), key, error.expected.replace(f"{folder}/", "")


@dataclass(frozen=True)
class Contents:
    """By robot: the entries of its release, what it will be in words, or what is wrong with its settings."""

    entries: dict[str, list[Entry]] = field(default_factory=dict[str, list[Entry]])
    told: dict[str, str] = field(default_factory=dict[str, str])
    faults: dict[str, BadInput] = field(default_factory=dict[str, BadInput])


def contents_of(fleet: Fleet, robots: Sequence[Robot]) -> Contents:
    """The contents for these robots; nothing is raised for what is wrong with one."""
    revoked = fleet.revoked()
    contents = Contents()
    for robot in robots:
        try:
            entries = release_entries(fleet, robot, revoked)
            contents.told[robot.name] = check_robot(fleet, robot, entries)
            contents.entries[robot.name] = entries
        except BadInput as error:
            contents.faults[robot.name] = error
    return contents
