"""`swarmwire robots logs`: what robots' agents have printed, and the logs of their runs."""

import asyncio
import shutil
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

import asyncssh

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.connecting import connected
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot, Host, hosts_of
from swarmwire.deploy.robots.host_side.files import NO_ARCHIVE, Refusal, part_of, unpack
from swarmwire.deploy.robots.host_side.system import unit_of
from swarmwire.deploy.robots.result import HostFailed, RobotResult

BLOCK = 1 << 18
MAX_BYTES = 4 << 30  # of a log, packed as unpacked: a robot that was taken over must not fill this disk
ABOUT = "robot.json"  # in every log
NO_LOG = 3  # exit status of FETCH where there is none
FETCH = """cd ~/swarmwire/{robot}/log 2>/dev/null || exit {no_log}
newest=$(ls -1d {robot}-*/ 2>/dev/null | sort | tail -n 1)
test -n "$newest" || exit {no_log}
exec tar -czf - -C "$newest" ."""
TOO_LARGE = f"its log is larger than {MAX_BYTES / 1e9:.1f} GB"
IN_PARTS = "copy the files that you need with scp, from ~/swarmwire/{robot}/log"
NOTHING_PRINTED = "-- No entries --"  # of journalctl
Say = Callable[[str, str], None]  # a robot's name, and a line of its
Work = Callable[[asyncssh.SSHClientConnection, FleetRobot], Awaitable[RobotResult]]


async def show_logs(
    fleet: Fleet, robots: Sequence[FleetRobot], lines: int, say: Say, *, follow: bool = False
) -> list[RobotResult]:
    """Report the last lines that robots' agents printed, and with `follow` those to come, until it is cancelled."""

    async def one(connection: asyncssh.SSHClientConnection, robot: FleetRobot) -> RobotResult:
        printed = False
        more = " --follow" if follow else ""
        command = f"journalctl --user-unit={unit_of(robot.name)} --lines={lines} --no-pager --output=short-iso{more}"
        async with await connection.create_process(command, stderr=asyncssh.STDOUT, errors="replace") as process:
            while line := await process.stdout.readline():
                if line.rstrip() != NOTHING_PRINTED:
                    say(robot.name, line.rstrip("\n"))
                    printed = True
        if process.exit_status:
            raise HostFailed(
                f"journalctl ended with {process.exit_status}", "is the user in the group systemd-journal?"
            )
        if lines and not printed:
            raise never_ran()
        return RobotResult(robot.name, True, "")

    return await _on_connections(fleet, robots, one)


def never_ran() -> HostFailed:
    """The failure of a robot that has no log yet."""
    return HostFailed("has no log", "it is written from the first start on")


async def fetch_logs(fleet: Fleet, robots: Sequence[FleetRobot], to: Path) -> list[RobotResult]:
    """Bring the log of each robot's last start to `to/<robot>`, where it takes the place of one that was fetched."""
    for robot in robots:
        old = to / robot.name
        if old.exists() and not (old / ABOUT).is_file():
            raise BadInput("--fetch", str(old), "expected a new folder, or the log of a robot")
    try:
        to.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput("--fetch", str(to), f"expected a folder that can be written: {error.strerror}") from None

    async def one(connection: asyncssh.SSHClientConnection, robot: FleetRobot) -> RobotResult:
        command = FETCH.format(robot=robot.name, no_log=NO_LOG)
        said = ""
        with TemporaryFile() as file:
            async with await connection.create_process(command, encoding=None) as process:
                while block := await process.stdout.read(BLOCK):
                    _keep(file, block)
                    if file.tell() > MAX_BYTES:
                        raise HostFailed(TOO_LARGE, IN_PARTS.format(robot=robot.name))
                said = (await process.stderr.read()).decode(errors="replace").strip()
            if process.exit_status == NO_LOG:
                raise never_ran()
            if process.exit_status != 0:
                raise HostFailed(f"its log cannot be packed: {said}")
            size = file.tell()
            await asyncio.to_thread(_put, file, to / robot.name)
        return RobotResult(robot.name, True, f"fetched: {to / robot.name} ({size / 1e6:.1f} MB packed)")

    return await _on_connections(fleet, robots, one)


def _keep(file: BinaryIO, block: bytes) -> None:
    try:
        file.write(block)
    except OSError as error:
        raise HostFailed(f"its log cannot be kept here: {error.strerror}", "make room: df -h") from None


def _put(file: BinaryIO, folder: Path) -> None:
    """Unpack a log, which comes from another machine, and take it to its place when it is whole."""
    part = part_of(folder)
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir()
        file.seek(0)
        unpack(file, part, most_bytes=MAX_BYTES)
        shutil.rmtree(folder, ignore_errors=True)
        part.rename(folder)
    except (Refusal, OSError, *NO_ARCHIVE) as error:
        shutil.rmtree(part, ignore_errors=True)
        raise HostFailed(f"its log cannot be unpacked: {error}") from None


async def _on_connections(fleet: Fleet, robots: Sequence[FleetRobot], work: Work) -> list[RobotResult]:
    """The results of all robots; each host is connected to once."""

    async def one(connection: asyncssh.SSHClientConnection, robot: FleetRobot) -> RobotResult:
        try:
            return await work(connection, robot)
        except HostFailed as error:
            return RobotResult.failed(robot.name, error)

    async def on_host(host: Host, mine: list[FleetRobot]) -> list[RobotResult]:
        try:
            async with connected(host, fleet.known_hosts) as connection:
                return await asyncio.gather(*(one(connection, robot) for robot in mine))
        except HostFailed as error:
            return [RobotResult.failed(robot.name, error) for robot in mine]

    done = await asyncio.gather(*(on_host(host, mine) for host, mine in hosts_of(robots).items()))
    found = {result.robot: result for results in done for result in results}
    return [found[robot.name] for robot in robots]
