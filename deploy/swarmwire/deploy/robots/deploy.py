"""`swarmwire robots check` and `deploy`: what a deployment needs, and packages and a release to each robot."""

import asyncio
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.on_robot.plan import RobotConfig, robot_config
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
from swarmwire.deploy.robots.host_session import HostSession, on_hosts
from swarmwire.deploy.robots.packages import Environments, RobotPlatform
from swarmwire.deploy.robots.release import (
    ROBOT_PROGRAM,
    SETTINGS_FILE,
    Archive,
    ArchiveEntry,
    package_links,
    release_entries,
    write_release,
)
from swarmwire.deploy.robots.result import SILENT, HostFailed, RobotResult, Watcher

OF_MACHINE = re.compile(r"(^|/)(127\.|localhost|\[::1\]|usb:)")  # a target that is another one on each machine
TRIAL_S = 60.0  # an old Pi takes seconds to import its packages for the first time
ROOM = 1.5  # free bytes that are asked for, over those that are to come
SPARE_BYTES = 20_000_000  # that stay free for logs


async def deploy(
    fleet: Fleet,
    robots: Sequence[FleetRobot],
    contents: dict[str, list[ArchiveEntry]],
    environments: Environments,
    watcher: Watcher = SILENT,
    *,
    restart: bool = False,
) -> list[RobotResult]:
    """The result of each robot; `contents` are the releases' entries by robot."""
    with TemporaryDirectory() as folder:
        deployment = _Deployment(contents, environments, Path(folder), watcher, restart)
        return await on_hosts(robots, fleet.known_hosts, deployment.one, deployment.before, deployment.after, watcher)


@dataclass
class _Deployment:
    """One deployment: what goes where."""

    contents: dict[str, list[ArchiveEntry]]
    environments: Environments
    folder: Path
    watcher: Watcher
    restart: bool
    making: asyncio.Lock = field(default_factory=asyncio.Lock)  # packages of a platform are made once

    async def before(self, session: HostSession, robots: list[FleetRobot]) -> None:
        """Lock the host, and clear away what interrupted deployments left there."""
        session.need_manager()
        await session.ask("lock")
        await session.ask("clear_parts", robots=[robot.name for robot in robots])

    async def one(self, session: HostSession, robot: FleetRobot) -> RobotResult:
        """Bring one robot to its release."""
        archives = await self._packages(session, robot)
        python = session.facts["executable"]
        release = await asyncio.to_thread(
            write_release, self.contents[robot.name], robot, python, archives, self.folder
        )
        there = await session.ask("present", robots=[robot.name])
        mine = there["robots"][robot.name]
        whole = {archive.name for archive in archives} <= set(there["environments"])
        if mine["current"] == release.name and mine["unit"] and whole:
            return RobotResult(
                robot.name, True, f"up to date: {release.name}" + await self._started(session, robot, release)
            )
        missing = [archive for archive in archives if archive.name not in there["environments"]]
        _check_room(session, [*missing, release])
        for archive in missing:
            await self._send(session, robot, archive, "put_environment", "packages", name=archive.name)
        if release.name not in mine["releases"]:
            await self._send(session, robot, release, "put_release", "release", robot=robot.name, name=release.name)
            self.watcher.step(robot.name, "trial run")
            command = [*ROBOT_PROGRAM, "check", "--config", "robot.toml"]
            links = list(package_links(archives))
            await session.ask(
                "try_out", robot=robot.name, release=release.name, packages=links, command=command, timeout_s=TRIAL_S
            )
        self.watcher.step(robot.name, "switch")
        await session.ask("switch", robot=robot.name, release=release.name)
        packages = f" and {sum(archive.size for archive in missing) / 1e6:.1f} MB of packages" if missing else ""
        return RobotResult(
            robot.name, True, f"deployed {release.name}{packages}" + await self._started(session, robot, release)
        )

    async def after(self, session: HostSession, robots: list[FleetRobot]) -> None:
        """Remove what is old."""
        await session.ask("tidy", robots=[robot.name for robot in robots])

    async def _packages(self, session: HostSession, robot: FleetRobot) -> list[Archive]:
        target = RobotPlatform.from_facts(session.facts)
        self.watcher.step(robot.name, "packages")
        async with self.making:
            return await asyncio.to_thread(
                self.environments.archives, target, [robot.settings["driver"]["name"]], robot.packages
            )

    async def _send(
        self, session: HostSession, of: FleetRobot, archive: Archive, do: str, what: str, **request: str
    ) -> None:
        def told(sent: int) -> None:
            self.watcher.step(of.name, what, sent, archive.size)

        told(0)
        await session.send(do, archive, told, **request)

    async def _started(self, session: HostSession, robot: FleetRobot, release: Archive) -> str:
        """Restart a robot that runs another release, if that was asked for; what there is to say of it."""
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        running = state.get("running", "")
        if state.get("ActiveState") not in ("active", "activating") or running == release.name:
            return ""
        if not self.restart:
            return f"; still runs {running or 'another'}, until it is restarted"
        self.watcher.step(robot.name, "restart")
        said = (await session.ask("run_units", verb="restart", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(
                f"deployed {release.name}, which does not start: {said}", "swarmwire robots logs, rollback"
            )
        return ", restarted"


def _check_room(session: HostSession, coming: Sequence[Archive]) -> None:
    free = session.facts["free_bytes"]
    needed = round(ROOM * sum(archive.unpacked for archive in coming)) + SPARE_BYTES
    if free < needed:
        raise HostFailed(
            f"the disk is full: {free / 1e6:.0f} MB are free, {needed / 1e6:.0f} MB are needed",
            "make room: df -h; old logs lie in ~/swarmwire/*/log",
        )


REACH_S = 3.0
MAX_AHEAD_NS = 20_000_000  # of a clock: more would show in latencies between robots
NS_PER_MS = 1_000_000
FIRST_DEPLOYMENT_BYTES = 150_000_000 + SPARE_BYTES  # what packages come to
PORTS = {"epuck2": 1000, "ros2": 7447}  # of drivers' protocols, where the address says none


async def check(
    fleet: Fleet, robots: Sequence[FleetRobot], faults: Mapping[str, BadInput], watcher: Watcher = SILENT
) -> list[RobotResult]:
    """A line per robot: what it is, or the first thing that is wrong; `faults` are those of settings, found here."""

    async def one(session: HostSession, robot: FleetRobot) -> RobotResult:
        if robot.name in faults:
            raise HostFailed(str(faults[robot.name]))
        watcher.step(robot.name, "check")
        said = session.facts
        target = RobotPlatform.from_facts(said)
        session.need_manager()
        if said["free_bytes"] < FIRST_DEPLOYMENT_BYTES:
            free = f"{said['free_bytes'] / 1e6:.0f} MB are free, {FIRST_DEPLOYMENT_BYTES / 1e6:.0f} MB are needed"
            raise HostFailed(f"the disk is full: {free}", "make room: df -h")
        notes = await _notes(session, robot)
        version = ".".join(map(str, said["python"]))
        machine = f"Python {version}, {target.machine}, glibc {target.glibc[0]}.{target.glibc[1]}"
        return RobotResult(robot.name, True, "; ".join([machine, f"{said['free_bytes'] / 1e9:.1f} GB free", *notes]))

    return await on_hosts(robots, fleet.known_hosts, one, watcher=watcher)


async def _notes(session: HostSession, robot: FleetRobot) -> list[str]:
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


def check_robot(fleet: Fleet, robot: FleetRobot, entries: Sequence[ArchiveEntry]) -> RobotConfig:
    """What the robot will be; BadInput names the place in `fleet.toml` of what does not fit.

    The files of its release are read as the robot would read them.
    """
    with TemporaryDirectory() as folder:
        for entry in entries:
            path = Path(folder, entry.name)
            path.touch(mode=entry.mode)
            path.write_bytes(entry.data)
        file = Path(folder, SETTINGS_FILE)
        try:
            return robot_config(read_settings(file, {}), str(file), WallClock())
        except BadInput as error:
            raise BadInput(*_place_in(fleet, robot, error, Path(folder))) from None


def _place_in(fleet: Fleet, robot: FleetRobot, error: BadInput, folder: Path) -> tuple[str, str, str]:
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

    entries: dict[str, list[ArchiveEntry]] = field(default_factory=dict[str, list[ArchiveEntry]])
    told: dict[str, str] = field(default_factory=dict[str, str])
    faults: dict[str, BadInput] = field(default_factory=dict[str, BadInput])


def contents_of(fleet: Fleet, robots: Sequence[FleetRobot]) -> Contents:
    """The contents for these robots; nothing is raised for what is wrong with one.

    A robot whose driver clashes with that of any other of the fleet is wrong.
    """
    revoked, mine = fleet.revoked(), {robot.name for robot in robots}
    contents, drivers = Contents(), dict[str, Driver]()
    for robot in fleet.robots:
        try:
            entries = release_entries(fleet, robot, revoked)
            plan = check_robot(fleet, robot, entries)
        except BadInput as error:
            if robot.name in mine:
                contents.faults[robot.name] = error
            continue
        drivers[robot.name] = plan.driver
        if robot.name in mine:
            contents.told[robot.name], contents.entries[robot.name] = str(plan), entries
    places = {robot.name: robot.places["driver"] for robot in fleet.robots}
    for later, owner, what in _clashes(fleet.robots, drivers):
        name, other = (later, owner) if later in mine else (owner, later)
        if name in mine:
            expected = f"expected {what}: {other} has it; got {drivers[name].address!r}"
            contents.faults[name] = BadInput(str(fleet.file), f"{places[name]}.address", expected)
    return contents


def _clashes(robots: Sequence[FleetRobot], drivers: Mapping[str, Driver]) -> list[tuple[str, str, str]]:
    """Of each robot with the target or the device of another: its name, the other's, and what it should have.

    Robots without a driver, by name, are passed over.
    """
    owners: dict[tuple[str, ...], str] = {}
    found: list[tuple[str, str, str]] = []
    for robot in robots:
        driver = drivers.get(robot.name)
        if driver is None:
            continue
        machine = robot.host.address, str(robot.host.port)
        target = robot.settings["driver"]["name"], driver.target
        needed = {("target", *target, *(machine if OF_MACHINE.search(driver.target) else ())): "another robot"}
        if driver.device:
            needed["device", driver.device, *machine] = f"another device than {driver.device} at {robot.host}"
        for key, what in needed.items():
            owner = owners.setdefault(key, robot.name)
            if owner != robot.name:
                found.append((robot.name, owner, what))
                break
    return found
