"""`swarmwire robots check` and `deploy`: check hosts and settings; send packages and a release to each robot."""

import asyncio
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.on_robot.plan import RobotConfig, robot_config
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.archives import Archive, ArchiveEntry
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
from swarmwire.deploy.robots.host_session import HostSession, on_hosts
from swarmwire.deploy.robots.host_side.messages import (
    ClearParts,
    Lock,
    PutEnvironment,
    PutRelease,
    ReadInventory,
    ReadLinger,
    RemoveOld,
    SwitchRelease,
    TryConnection,
    TryRelease,
    Upload,
)
from swarmwire.deploy.robots.packages import Environments, RobotPlatform
from swarmwire.deploy.robots.release import (
    ROBOT_PROGRAM,
    SETTINGS_FILE,
    package_links,
    release_entries,
    write_release,
)
from swarmwire.deploy.robots.result import HostFailed, RobotResult, Watcher
from swarmwire.deploy.robots.units import RUNNING, control_unit, unit_state

LOCAL_TARGET = re.compile(r"(^|/)(127\.|localhost|\[::1\]|usb:)")  # names another target on each machine
TRIAL_TIMEOUT_S = 60.0  # an old Pi needs seconds to import its packages for the first time
FREE_SPACE_FACTOR = 1.5  # required free bytes per byte to unpack
SPARE_BYTES = 20_000_000  # free space that is left for logs


async def deploy(
    fleet: Fleet,
    robots: Sequence[FleetRobot],
    contents: dict[str, list[ArchiveEntry]],
    environments: Environments,
    watcher: Watcher,
    *,
    restart: bool = False,
) -> list[RobotResult]:
    """Deploy releases, whose entries `contents` has by robot; return the result of each robot."""
    with TemporaryDirectory() as folder:
        deployment = _Deployment(contents, environments, Path(folder), watcher, restart)
        return await on_hosts(
            robots, fleet.known_hosts, deployment.deploy_robot, deployment.prepare, deployment.clean, watcher=watcher
        )


@dataclass
class _Deployment:
    """One deployment to several hosts."""

    contents: dict[str, list[ArchiveEntry]]
    environments: Environments
    folder: Path
    watcher: Watcher
    restart: bool
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)  # the archives of a platform are written once

    async def prepare(self, session: HostSession, robots: list[FleetRobot]) -> None:
        """Lock the host, and remove the remains of interrupted deployments."""
        session.need_manager()
        await session.request(Lock())
        await session.request(ClearParts([robot.name for robot in robots]))

    async def deploy_robot(self, session: HostSession, robot: FleetRobot) -> RobotResult:
        """Deploy one robot's release."""
        archives = await self._packages(session, robot)
        python = session.facts.executable
        release = await asyncio.to_thread(
            write_release, self.contents[robot.name], robot, python, archives, self.folder
        )
        inventory = await session.request(ReadInventory([robot.name]))
        deployed = inventory.robots[robot.name]
        missing = [archive for archive in archives if archive.name not in inventory.environments]
        if deployed.current == release.name and deployed.unit_installed and not missing:
            restarted = await self._restart(session, robot, release)
            return RobotResult(robot.name, True, f"up to date: {release.name}{restarted}")
        _check_free_space(session, [*missing, release])
        for archive in missing:
            request = PutEnvironment(archive.size, archive.sha256, archive.name)
            await self._upload(session, robot, archive, request, "packages")
        if release.name not in deployed.names:
            request = PutRelease(release.size, release.sha256, robot.name, release.name)
            await self._upload(session, robot, release, request, "release")
            self.watcher.step(robot.name, "trial run")
            command, links = [*ROBOT_PROGRAM, "check", "--config", "robot.toml"], list(package_links(archives))
            await session.request(TryRelease(robot.name, release.name, links, command, TRIAL_TIMEOUT_S))
        self.watcher.step(robot.name, "switch")
        await session.request(SwitchRelease(robot.name, release.name))
        packages = f" and {sum(archive.size for archive in missing) / 1e6:.1f} MB of packages" if missing else ""
        restarted = await self._restart(session, robot, release)
        return RobotResult(robot.name, True, f"deployed {release.name}{packages}{restarted}")

    async def clean(self, session: HostSession, robots: list[FleetRobot]) -> None:
        """Remove old releases and packages."""
        await session.request(RemoveOld([robot.name for robot in robots]))

    async def _packages(self, session: HostSession, robot: FleetRobot) -> list[Archive]:
        platform = RobotPlatform.from_facts(session.facts)
        self.watcher.step(robot.name, "packages")
        async with self.lock:
            return await asyncio.to_thread(
                self.environments.archives, platform, [robot.settings["driver"]["name"]], robot.packages
            )

    async def _upload(
        self, session: HostSession, robot: FleetRobot, archive: Archive, request: Upload, activity: str
    ) -> None:
        def show(sent: int) -> None:
            self.watcher.step(robot.name, activity, sent, archive.size)

        show(0)
        await session.upload(request, archive, show)

    async def _restart(self, session: HostSession, robot: FleetRobot, release: Archive) -> str:
        """Restart a robot that runs another release, if `restart` is set; return the addition to its result."""
        state = await unit_state(session, robot.name)
        if state.active not in RUNNING or state.running == release.name:
            return ""
        if not self.restart:
            return f"; still runs {state.running or 'another'}, until it is restarted"
        self.watcher.step(robot.name, "restart")
        fault = await control_unit(session, "restart", robot.name)
        if fault:
            raise HostFailed(
                f"deployed {release.name}, which does not start: {fault}", "swarmwire robots logs, rollback"
            )
        return ", restarted"


def _check_free_space(session: HostSession, archives: Sequence[Archive]) -> None:
    """Raise HostFailed if the host lacks the space to unpack these archives."""
    free = session.facts.free_bytes
    needed = round(FREE_SPACE_FACTOR * sum(archive.unpacked for archive in archives)) + SPARE_BYTES
    if free < needed:
        raise HostFailed(
            f"the disk is full: {free / 1e6:.0f} MB are free, {needed / 1e6:.0f} MB are needed",
            "make room: df -h; old logs lie in ~/swarmwire/*/log",
        )


CONNECTION_TIMEOUT_S = 3.0
MAX_CLOCK_OFFSET_NS = 20_000_000  # a larger one shows in latencies between robots
NS_PER_MS = 1_000_000
FIRST_DEPLOYMENT_BYTES = 150_000_000 + SPARE_BYTES  # size of the packages
PORTS = {"epuck2": 1000, "ros2": 7447}  # ports of drivers' protocols, for addresses without a port


async def check(
    fleet: Fleet, robots: Sequence[FleetRobot], faults: Mapping[str, BadInput], watcher: Watcher
) -> list[RobotResult]:
    """Check each robot's host; return its properties or first fault. `faults` are those of the settings, by robot."""

    async def check_host(session: HostSession, robot: FleetRobot) -> RobotResult:
        if robot.name in faults:
            raise HostFailed(str(faults[robot.name]))
        watcher.step(robot.name, "check")
        facts = session.facts
        platform = RobotPlatform.from_facts(facts)
        session.need_manager()
        if facts.free_bytes < FIRST_DEPLOYMENT_BYTES:
            free = f"{facts.free_bytes / 1e6:.0f} MB are free, {FIRST_DEPLOYMENT_BYTES / 1e6:.0f} MB are needed"
            raise HostFailed(f"the disk is full: {free}", "make room: df -h")
        notes = await _notes(session, robot)
        version = ".".join(map(str, facts.python))
        machine = f"Python {version}, {platform.machine}, glibc {platform.glibc[0]}.{platform.glibc[1]}"
        return RobotResult(robot.name, True, "; ".join([machine, f"{facts.free_bytes / 1e9:.1f} GB free", *notes]))

    return await on_hosts(robots, fleet.known_hosts, check_host, watcher=watcher)


async def _notes(session: HostSession, robot: FleetRobot) -> list[str]:
    """Return notes on a host that can be used; HostFailed for a driver's robot that does not answer."""
    notes = [await _clock_note(session)]
    target = driver_endpoint(robot.settings["driver"])
    if target is not None:
        address, port = target
        fault = await session.request(TryConnection(address, port, CONNECTION_TIMEOUT_S))
        if fault:
            remedy = "is it switched on, and driver.address right?"
            raise HostFailed(f"the driver's address {address}:{port} does not answer the host: {fault}", remedy)
        notes.append(f"{address}:{port} answers")
    if not await session.request(ReadLinger()):
        notes.append("linger is off: start switches it on")
    return notes


async def _clock_note(session: HostSession) -> str:
    offset = await session.clock_offset(WallClock())
    note = f"clock {offset.ahead_ns / NS_PER_MS:+.0f} ms (within {offset.within_ns / NS_PER_MS:.0f})"
    if abs(offset.ahead_ns) - offset.within_ns > MAX_CLOCK_OFFSET_NS:
        return f"{note}: latencies will be wrong by that, run NTP on it (timedatectl set-ntp true)"
    return note


def driver_endpoint(driver: Mapping[str, Any]) -> tuple[str, int] | None:
    """Return host and TCP port of a driver's address; None for any other address.

    >>> driver_endpoint({"name": "epuck2", "address": "192.168.1.41"})
    ('192.168.1.41', 1000)
    >>> driver_endpoint({"name": "ros2", "address": "tcp/turtle:7448"})
    ('turtle', 7448)
    """
    protocol, slash, address = str(driver.get("address", "")).rpartition("/")
    if slash and protocol not in ("tcp", "tls"):
        return None
    host, colon, port = address.rpartition(":")
    if colon and port.isdecimal() and host:
        return host.strip("[]"), int(port)
    default_port = PORTS.get(str(driver.get("name")))
    return (address, default_port) if address and default_port else None


def check_robot(fleet: Fleet, robot: FleetRobot, entries: Sequence[ArchiveEntry]) -> RobotConfig:
    """Read a release's files as the robot would read them; BadInput names the key in `fleet.toml` that does not fit."""
    with TemporaryDirectory() as folder:
        for entry in entries:
            path = Path(folder, entry.name)
            path.touch(mode=entry.mode)
            path.write_bytes(entry.data)
        file = Path(folder, SETTINGS_FILE)
        try:
            return robot_config(read_settings(file, {}), str(file), WallClock())
        except BadInput as error:
            raise _fleet_fault(fleet, robot, error, Path(folder)) from None


def _fleet_fault(fleet: Fleet, robot: FleetRobot, error: BadInput, folder: Path) -> BadInput:
    """Attribute a fault in a release's files, in `folder`, to the file and key that its user wrote."""
    first, _, inner = error.key.partition(".")
    key_path = robot.key_paths.get(first, f"robots.{robot.name}.{first}".rstrip("."))
    file = Path(error.where)
    if file.is_relative_to(folder) and file.name != SETTINGS_FILE:  # a body's sheet
        return BadInput(file.name, error.key, error.expected)
    key = ".".join(filter(None, (key_path, inner)))
    return BadInput(str(fleet.file), key, error.expected.replace(f"{folder}/", ""))


@dataclass(frozen=True)
class ReleaseContents:
    """The entries of each robot's release and a summary of its settings, or the fault of its settings."""

    entries: dict[str, list[ArchiveEntry]] = field(default_factory=dict[str, list[ArchiveEntry]])
    summaries: dict[str, str] = field(default_factory=dict[str, str])
    faults: dict[str, BadInput] = field(default_factory=dict[str, BadInput])


def release_contents(fleet: Fleet, robots: Sequence[FleetRobot]) -> ReleaseContents:
    """Return the contents of these robots' releases; a fault of one robot does not concern the others.

    A driver that clashes with the driver of any other robot of the fleet is a fault.
    """
    revoked, names = fleet.revoked(), {robot.name for robot in robots}
    contents, drivers = ReleaseContents(), dict[str, Driver]()
    for robot in fleet.robots:
        try:
            entries = release_entries(fleet, robot, revoked)
            config = check_robot(fleet, robot, entries)
        except BadInput as error:
            if robot.name in names:
                contents.faults[robot.name] = error
            continue
        drivers[robot.name] = config.driver
        if robot.name in names:
            contents.summaries[robot.name], contents.entries[robot.name] = str(config), entries
    key_paths = {robot.name: robot.key_paths["driver"] for robot in fleet.robots}
    for clash in _clashes(fleet.robots, drivers):
        name, other = (clash.robot, clash.owner) if clash.robot in names else (clash.owner, clash.robot)
        if name in names:
            expected = f"expected {clash.expected}: {other} has it; got {drivers[name].address!r}"
            contents.faults[name] = BadInput(str(fleet.file), f"{key_paths[name]}.address", expected)
    return contents


class Clash(NamedTuple):
    """Two robots whose drivers have the same target or device."""

    robot: str
    owner: str
    expected: str  # expectation that `robot` does not meet


def _clashes(robots: Sequence[FleetRobot], drivers: Mapping[str, Driver]) -> list[Clash]:
    """Return the first clash of each robot with an earlier one; robots without a driver, by name, are skipped."""
    owners: dict[tuple[str, ...], str] = {}
    clashes: list[Clash] = []
    for robot in robots:
        driver = drivers.get(robot.name)
        if driver is None:
            continue
        machine = robot.host.address, str(robot.host.port)
        target = robot.settings["driver"]["name"], driver.target
        keys = {("target", *target, *(machine if LOCAL_TARGET.search(driver.target) else ())): "another robot"}
        if driver.device:
            keys["device", driver.device, *machine] = f"another device than {driver.device} at {robot.host}"
        for key, expected in keys.items():
            owner = owners.setdefault(key, robot.name)
            if owner != robot.name:
                clashes.append(Clash(robot.name, owner, expected))
                break
    return clashes
