"""Sessions with hosts that `host_side` serves: requests and answers, one after the other, over one connection.

`on_hosts` does the same work on many hosts at the same time.
"""

import asyncio
import io
import re
import shlex
import zipfile
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import asyncssh
from msgspec import ValidationError, convert

from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.config import from_json
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.robots.archives import Archive
from swarmwire.deploy.robots.connecting import CONNECT_TIMEOUT_S, connected, lost
from swarmwire.deploy.robots.fleet import FleetRobot, Host, hosts_of
from swarmwire.deploy.robots.host_side.messages import HostFacts, HostRequest, ReadClock, Upload
from swarmwire.deploy.robots.host_side.system import NO_SYSTEMD
from swarmwire.deploy.robots.result import HostFailed, RobotResult, Watcher

BLOCK_BYTES = 1 << 18  # size of a write to the connection
CLOCK_READINGS = 5
TIMEOUT_S = 180.0  # limit for an answer: slow cards need time to write
REMEDIES = {
    "full": "make room: df -h; old logs lie in ~/swarmwire/*/log",
    "damaged": "do it again; if it stays so, the card may be worn out",
    "busy": "wait for it, then do it again",
    "systemd": "a robot needs systemd with a manager for its user: systemctl --user status",
    "first": "deploy one",
}
NO_PYTHON = (126, 127)  # exit codes of a shell for a missing program
NO_MODULE = re.compile(r"No module named '(\w+)")
MIN_PYTHON = (3, 11)
# The zipapp runs from memory: a robot whose disk is full can still be stopped.
START = f"""import json, os, runpy, sys
if sys.version_info < {MIN_PYTHON} or sys.platform != "linux":
    version = "%d.%d.%d on %s" % (sys.version_info[:3] + (sys.platform,))
    print(json.dumps({{"refused": "python", "text": version}}))
    sys.exit()
file = os.fdopen(os.memfd_create("swarmwire"), "wb")
file.write(sys.stdin.buffer.read(int(sys.stdin.buffer.readline())))
file.flush()
sys.path[:] = [path for path in sys.path if path]
runpy.run_path("/proc/self/fd/%d" % file.fileno(), run_name="__main__")"""
PACKAGE = "swarmwire.deploy.robots.host_side"
MAIN = f"from {PACKAGE}.serving import main\nmain()\n"
MAX_HOSTS = 64  # connections at the same time

Answer = TypeVar("Answer")
OnSent = Callable[[int], None]  # receives the number of bytes sent so far


class ClockOffset(NamedTuple):
    """Offset of a host's clock against the one of this machine."""

    ahead_ns: int
    within_ns: int  # bound of the error: half of the shortest round trip


class HostSession:
    """Requests to a host that is served by `host_side`; all raise HostFailed with a cause and a remedy."""

    facts: HostFacts

    def __init__(self, host: Host, process: "asyncssh.SSHClientProcess[bytes]") -> None:
        """Take over a process that has just been started."""
        self.host, self._process = host, process

    async def begin(self) -> None:
        """Send the server's program, and read the facts of the host."""
        with suppress(BrokenPipeError, ConnectionError):  # without Python the shell's error follows below
            self._process.stdin.write(server_program())
        self.facts = await self._answer("start", HostFacts)

    def need_manager(self) -> None:
        """Return if systemd can run units of the user; else HostFailed."""
        if self.facts.manager == NO_SYSTEMD:
            cause = "this machine does not run systemd: agents are started as its user's units"
            raise HostFailed(cause, "install it, or run swarmwire-agent by hand")
        if not self.facts.manager:
            raise HostFailed(f"{self.host} has no systemd for its user", "log in over SSH with PAM: UsePAM yes")

    async def clock_offset(self, clock: DatedClock) -> ClockOffset:
        """Measure the offset of the host's clock against `clock`."""
        offsets: list[ClockOffset] = []
        for _ in range(CLOCK_READINGS):
            start_ns = clock.utc_ns()
            host_ns = await self.request(ReadClock())
            end_ns = clock.utc_ns()
            offsets.append(ClockOffset(host_ns - (start_ns + end_ns) // 2, (end_ns - start_ns) // 2))
        return min(offsets, key=lambda offset: offset.within_ns)

    async def request(self, request: HostRequest[Answer]) -> Answer:
        """Send a request and return the answer."""
        self._process.stdin.write(request.line())
        return await self._answer(type(request).__name__, request.RESULT)

    async def upload(self, request: Upload, archive: Archive, on_sent: OnSent) -> None:
        """Send a request and its archive."""
        stdin = self._process.stdin
        stdin.write(request.line())
        sent = 0
        try:
            with archive.path.open("rb") as file:
                while block := file.read(BLOCK_BYTES):
                    stdin.write(block)
                    await stdin.drain()
                    on_sent(sent := sent + len(block))
        except (BrokenPipeError, ConnectionError):
            raise lost() from None
        await self._answer(type(request).__name__, None)

    async def _answer(self, request: str, kind: Any) -> Any:
        try:
            async with asyncio.timeout(TIMEOUT_S):
                line = await self._process.stdout.readline()
        except TimeoutError:
            raise HostFailed(
                f"no answer to {request} within {TIMEOUT_S:g} s", "is the host overloaded, or its card?"
            ) from None
        if not line.endswith(b"\n"):
            raise await self._end_of_process()
        answer = _json_object(line)
        if answer is None:
            text = line.decode(errors="replace").strip()
            raise HostFailed(f"the shell of {self.host} says {text!r}", "let its login files print nothing") from None
        if "refused" in answer:
            raise self._refusal(request, str(answer["refused"]), str(answer.get("text", "")))
        try:
            return convert(answer.get("result"), kind)
        except ValidationError as error:
            raise HostFailed(f"unexpected answer of {self.host} to {request}: {error}") from None

    def _refusal(self, request: str, kind: str, text: str) -> HostFailed:
        if kind == "python":
            minimum = ".".join(map(str, MIN_PYTHON))
            cause = f"{self.host.python} is Python {text}, expected {minimum} or newer, on Linux"
            return HostFailed(cause, 'name a newer one by python = "…"')
        if kind == "full":
            return HostFailed(f"the disk is full ({text})", REMEDIES[kind])
        if kind == "trial":
            return _trial_failure(text.splitlines())
        return HostFailed(text if kind in REMEDIES else f"{request}: {text}", REMEDIES.get(kind, ""))

    async def _end_of_process(self) -> HostFailed:
        """Return the failure of a process that has ended."""
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT_S):
                errors = (await self._process.stderr.read()).decode(errors="replace").strip().splitlines()
                await self._process.wait_closed()
        except (TimeoutError, asyncssh.Error, OSError):
            return lost()
        if self._process.exit_status in NO_PYTHON:
            return HostFailed(
                f"{self.host} has no {self.host.python}", 'install Python, or name its path by python = "…"'
            )
        if self._process.exit_status is None:
            return lost()
        return HostFailed(f"{self.host.python} ended on {self.host}: {errors[-1] if errors else 'no output'}")


def _trial_failure(lines: list[str]) -> HostFailed:
    """Return the failure of a trial run with these last lines."""
    missing = NO_MODULE.search(lines[-1])
    remedies = [f'packages = ["{missing[1]}"] in fleet.toml deploys a missing package'] if missing else lines[:-1]
    return HostFailed(f"the trial run on the robot failed: {lines[-1]}", " | ".join(remedies))


def _json_object(line: bytes) -> dict[str, Any] | None:
    """Parse a line of JSON; None if it is not an object."""
    try:
        value: object = from_json(line)
    except ValueError:
        return None
    return cast("dict[str, Any]", value) if isinstance(value, dict) else None


@asynccontextmanager
async def host_session(host: Host, known_hosts: Path) -> AsyncGenerator[HostSession]:
    """Open a session with a host for the block; HostFailed if that fails, or the connection is lost."""
    async with connected(host, known_hosts) as connection:
        process = await connection.create_process(start_command(host.python), encoding=None)
        async with process:
            session = HostSession(host, process)
            await session.begin()
            yield session
            process.stdin.write_eof()


def start_command(python: str) -> str:
    """Return the command for the host's shell; an unsupported Python prints its version, others run `program`."""
    return f"exec {shlex.quote(python)} -c {shlex.quote(START)}"


@cache
def server_program() -> bytes:
    """Return the server as a zipapp, after a line with its length."""
    folder, parents = Path(__file__).parent / "host_side", PACKAGE.split(".")
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("__main__.py", MAIN)
        for depth in range(1, len(parents)):
            archive.writestr("/".join((*parents[:depth], "__init__.py")), "")
        for path in sorted(folder.glob("*.py")):
            archive.write(path, "/".join((*parents, path.name)))
    return b"%d\n" % data.tell() + data.getvalue()


Work = Callable[[HostSession, FleetRobot], Awaitable[RobotResult]]  # work on one robot; HostFailed fails this robot
HostWork = Callable[[HostSession, list[FleetRobot]], Awaitable[None]]  # work on a host; HostFailed fails its robots


async def no_work(session: HostSession, robots: list[FleetRobot]) -> None:
    """Do nothing."""


async def on_hosts(
    robots: Iterable[FleetRobot],
    known_hosts: Path,
    work: Work,
    before: HostWork = no_work,
    after: HostWork = no_work,
    *,
    watcher: Watcher,
) -> list[RobotResult]:
    """Return the results of all robots in their order; hosts work at the same time, robots of a host in sequence."""
    ordered, gate = list(robots), asyncio.Semaphore(MAX_HOSTS)

    async def on_host(host_robots: list[FleetRobot]) -> list[RobotResult]:
        results: dict[str, RobotResult] = {}
        try:
            async with gate, host_session(host_robots[0].host, known_hosts) as session:
                await before(session, host_robots)
                for robot in host_robots:
                    results[robot.name] = await _result(work, session, robot)
                    watcher.end(results[robot.name])
                await after(session, host_robots)
        except HostFailed as error:
            for robot in host_robots:
                if robot.name not in results:
                    results[robot.name] = RobotResult.failed(robot.name, error)
                    watcher.end(results[robot.name])
        return list(results.values())

    host_results = await asyncio.gather(*map(on_host, hosts_of(ordered).values()))
    result_of = {result.robot: result for results in host_results for result in results}
    return [result_of[robot.name] for robot in ordered]


async def _result(work: Work, session: HostSession, robot: FleetRobot) -> RobotResult:
    try:
        return await work(session, robot)
    except HostFailed as error:
        return RobotResult.failed(robot.name, error)
    except SwarmwireError as error:  # a fault of this robot's files; those of others may be good
        return RobotResult(robot.name, False, str(error))
