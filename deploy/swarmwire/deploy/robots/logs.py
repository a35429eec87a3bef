"""`swarmwire robots logs`: the output of robots' agents, and the logs of their runs."""

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
from swarmwire.deploy.robots.host_side.files import ARCHIVE_ERRORS, Refusal, part_of, unpack
from swarmwire.deploy.robots.host_side.system import unit_of
from swarmwire.deploy.robots.result import HostFailed, RobotResult

BLOCK_BYTES = 1 << 18
MAX_BYTES = 4 << 30  # size of a log, packed or unpacked: a hijacked robot must not fill this disk
LOG_FILE = "robot.json"  # a file of every log
NO_LOG = 3  # exit status of FETCH without a log
FETCH = """cd ~/swarmwire/{robot}/log 2>/dev/null || exit {no_log}
newest=$(ls -1d {robot}-*/ 2>/dev/null | sort | tail -n 1)
test -n "$newest" || exit {no_log}
exec tar -czf - -C "$newest" ."""
TOO_LARGE = f"its log is larger than {MAX_BYTES / 1e9:.1f} GB"
IN_PARTS = "copy the files that you need with scp, from ~/swarmwire/{robot}/log"
NO_ENTRIES = "-- No entries --"  # output of journalctl without lines
OnLine = Callable[[str, str], None]  # receives a robot's name and a line of its agent
Work = Callable[[asyncssh.SSHClientConnection, FleetRobot], Awaitable[RobotResult]]


async def show_logs(
    fleet: Fleet, robots: Sequence[FleetRobot], lines: int, on_line: OnLine, *, follow: bool
) -> list[RobotResult]:
    """Report the last lines of robots' agents, and with `follow` new ones, until it is cancelled."""

    async def show_log(connection: asyncssh.SSHClientConnection, robot: FleetRobot) -> RobotResult:
        printed = False
        more = " --follow" if follow else ""
        command = f"journalctl --user-unit={unit_of(robot.name)} --lines={lines} --no-pager --output=short-iso{more}"
        async with await connection.create_process(command, stderr=asyncssh.STDOUT, errors="replace") as process:
            while line := await process.stdout.readline():
                if line.rstrip() != NO_ENTRIES:
                    on_line(robot.name, line.rstrip("\n"))
                    printed = True
        if process.exit_status:
            raise HostFailed(
                f"journalctl ended with {process.exit_status}", "is the user in the group systemd-journal?"
            )
        if lines and not printed:
            raise never_ran()
        return RobotResult(robot.name, True, "")

    return await _on_connections(fleet, robots, show_log)


def never_ran() -> HostFailed:
    """Return the failure of a robot without a log."""
    return HostFailed("has no log", "it is written from the first start on")


async def fetch_logs(fleet: Fleet, robots: Sequence[FleetRobot], folder: Path) -> list[RobotResult]:
    """Copy the log of each robot's last start to `folder/<robot>`, where it replaces one that was fetched before."""
    for robot in robots:
        old = folder / robot.name
        if old.exists() and not (old / LOG_FILE).is_file():
            raise BadInput("--fetch", str(old), "expected a new folder, or the log of a robot")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput("--fetch", str(folder), f"expected a folder that can be written: {error.strerror}") from None

    async def fetch_log(connection: asyncssh.SSHClientConnection, robot: FleetRobot) -> RobotResult:
        command = FETCH.format(robot=robot.name, no_log=NO_LOG)
        errors = ""
        with TemporaryFile() as file:
            async with await connection.create_process(command, encoding=None) as process:
                while block := await process.stdout.read(BLOCK_BYTES):
                    _write(file, block)
                    if file.tell() > MAX_BYTES:
                        raise HostFailed(TOO_LARGE, IN_PARTS.format(robot=robot.name))
                errors = (await process.stderr.read()).decode(errors="replace").strip()
            if process.exit_status == NO_LOG:
                raise never_ran()
            if process.exit_status != 0:
                raise HostFailed(f"its log cannot be packed: {errors}")
            size = file.tell()
            await asyncio.to_thread(_unpack_log, file, folder / robot.name)
        return RobotResult(robot.name, True, f"fetched: {folder / robot.name} ({size / 1e6:.1f} MB packed)")

    return await _on_connections(fleet, robots, fetch_log)


def _write(file: BinaryIO, block: bytes) -> None:
    try:
        file.write(block)
    except OSError as error:
        raise HostFailed(f"its log cannot be written to this disk: {error.strerror}", "make room: df -h") from None


def _unpack_log(file: BinaryIO, folder: Path) -> None:
    """Unpack a log from another machine; `folder` changes only when the log is complete."""
    part = part_of(folder)
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir()
        file.seek(0)
        unpack(file, part, max_bytes=MAX_BYTES)
        shutil.rmtree(folder, ignore_errors=True)
        part.rename(folder)
    except (Refusal, OSError, *ARCHIVE_ERRORS) as error:
        shutil.rmtree(part, ignore_errors=True)
        raise HostFailed(f"its log cannot be unpacked: {error}") from None


async def _on_connections(fleet: Fleet, robots: Sequence[FleetRobot], work: Work) -> list[RobotResult]:
    """Return the results of all robots, over one connection per host."""

    async def result_of(connection: asyncssh.SSHClientConnection, robot: FleetRobot) -> RobotResult:
        try:
            return await work(connection, robot)
        except HostFailed as error:
            return RobotResult.failed(robot.name, error)

    async def on_host(host: Host, host_robots: list[FleetRobot]) -> list[RobotResult]:
        try:
            async with connected(host, fleet.known_hosts) as connection:
                return await asyncio.gather(*(result_of(connection, robot) for robot in host_robots))
        except HostFailed as error:
            return [RobotResult.failed(robot.name, error) for robot in host_robots]

    host_results = await asyncio.gather(*(on_host(host, members) for host, members in hosts_of(robots).items()))
    results = {result.robot: result for results in host_results for result in results}
    return [results[robot.name] for robot in robots]
