"""Sessions with hosts that `host_side` serves: requests and answers, one after the other, over one connection.

`on_hosts` does the same work on many hosts at the same time.
"""

import asyncio
import json
import re
import shlex
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, cast

import asyncssh

from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.config import from_json
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.robots.connecting import CONNECT_S, connected, lost
from swarmwire.deploy.robots.fleet import FleetRobot, Host, hosts_of
from swarmwire.deploy.robots.host_side.system import NO_SYSTEMD
from swarmwire.deploy.robots.release import Archive
from swarmwire.deploy.robots.result import SILENT, HostFailed, RobotResult, Watcher

BLOCK = 1 << 18  # bytes handed to the connection at a time
CLOCK_QUESTIONS = 5
TIMEOUT_S = 180.0  # for an answer: slow cards take their time to write
CURES = {
    "full": "make room: df -h; old logs lie in ~/swarmwire/*/log",
    "damaged": "do it again; if it stays so, the card may be worn out",
    "busy": "wait for it, then do it again",
    "systemd": "a robot needs systemd with a manager for its user: systemctl --user status",
    "first": "deploy one",
}
NO_PYTHON = (126, 127)  # what shells say of a program that is not there, or none
NO_MODULE = re.compile(r"No module named '(\w+)")
Told = Callable[[int], None]  # bytes that were sent so far
PACKAGE = "swarmwire.deploy.robots.host_side"
MODULES = ("files", "system", "serving")  # each after those it imports
OLDEST = (3, 11)
START = f"""import sys, json
if sys.version_info < {OLDEST}:
    print(json.dumps({{"refused": "python", "text": "%d.%d.%d" % sys.version_info[:3]}}))
    sys.exit()
sys.path[:] = [path for path in sys.path if path]
exec(sys.stdin.buffer.read(int(sys.stdin.buffer.readline())))"""
LOADER = """import sys, types
package = sys.modules[{package!r}] = types.ModuleType({package!r})
package.__path__ = []
for name, text in {sources}:
    whole = {package!r} + "." + name
    module = sys.modules[whole] = types.ModuleType(whole)
    exec(compile(text, whole, "exec"), module.__dict__)
    setattr(package, name, module)
package.serving.main()"""
MOST = 64  # hosts at the same time


class HostSession:
    """Requests to a host that is served by `host_side`; all raise HostFailed with the cause and the cure."""

    def __init__(self, host: Host, process: "asyncssh.SSHClientProcess[bytes]") -> None:
        """Over a process that has just been started."""
        self.host, self._process = host, process
        self.facts: dict[str, Any] = {}  # what `host_side.system.facts` returns

    async def begin(self) -> None:
        """Send the program along, and read what the host says of itself."""
        with suppress(BrokenPipeError, ConnectionError):  # of a Python that is not there: its shell says so below
            self._process.stdin.write(program())
        self.facts = await self._answer("start")

    def need_manager(self) -> None:
        """Return if systemd can run units of the user's there; else HostFailed."""
        if self.facts["manager"] == NO_SYSTEMD:
            cause = "this machine does not run systemd: agents are started as its user's units"
            raise HostFailed(cause, "install it, or run swarmwire-agent by hand")
        if not self.facts["manager"]:
            raise HostFailed(f"{self.host} has no systemd for its user", "log in over SSH with PAM: UsePAM yes")

    async def clock_ahead_ns(self, clock: DatedClock) -> tuple[int, int]:
        """How far the host's clock is ahead of ours, and how far from that it may be: half of the quickest answer."""
        asked: list[tuple[int, int]] = []
        for _ in range(CLOCK_QUESTIONS):
            before_ns = clock.utc_ns()
            there_ns = await self.ask("utc_ns")
            after_ns = clock.utc_ns()
            asked.append(((after_ns - before_ns) // 2, there_ns - (before_ns + after_ns) // 2))
        within_ns, ahead_ns = min(asked)
        return ahead_ns, within_ns

    async def ask(self, do: str, **request: Any) -> Any:
        """What the host answers."""
        self._process.stdin.write(json.dumps({"do": do, **request}).encode() + b"\n")
        return await self._answer(do)

    async def send(self, do: str, archive: Archive, told: Told, **request: Any) -> None:
        """A request with an archive behind it."""
        stdin = self._process.stdin
        asked = {"do": do, "size": archive.size, "sha256": archive.sha256, **request}
        stdin.write(json.dumps(asked).encode() + b"\n")
        sent = 0
        try:
            with archive.path.open("rb") as file:
                while block := file.read(BLOCK):
                    stdin.write(block)
                    await stdin.drain()
                    told(sent := sent + len(block))
        except (BrokenPipeError, ConnectionError):
            raise lost() from None
        await self._answer(do)

    async def _answer(self, do: str) -> Any:
        try:
            async with asyncio.timeout(TIMEOUT_S):
                line = await self._process.stdout.readline()
        except TimeoutError:
            raise HostFailed(
                f"no answer to {do} within {TIMEOUT_S:g} s", "is the host overloaded, or its card?"
            ) from None
        if not line.endswith(b"\n"):
            raise await self._ended()
        answer = _object(line)
        if answer is None:
            said = line.decode(errors="replace").strip()
            raise HostFailed(f"the shell of {self.host} says {said!r}", "let its login files print nothing") from None
        if "refused" not in answer:
            return answer["said"]
        raise self._refused(do, answer["refused"], answer["text"])

    def _refused(self, do: str, kind: str, text: str) -> HostFailed:
        if kind == "python":
            oldest = ".".join(map(str, OLDEST))
            return HostFailed(
                f"{self.host.python} is Python {text}, expected {oldest} or newer", 'say a newer one by python = "…"'
            )
        if kind == "full":
            return HostFailed(f"the disk is full ({text})", CURES[kind])
        if kind == "trial":
            return _trial_failed(text.splitlines())
        return HostFailed(text if kind in CURES else f"{do}: {text}", CURES.get(kind, ""))

    async def _ended(self) -> HostFailed:
        """Why the process at the other end is gone."""
        try:
            async with asyncio.timeout(CONNECT_S):
                said = (await self._process.stderr.read()).decode(errors="replace").strip().splitlines()
                await self._process.wait_closed()
        except (TimeoutError, asyncssh.Error, OSError):
            return lost()
        if self._process.exit_status in NO_PYTHON:
            return HostFailed(
                f"{self.host} has no {self.host.python}", 'install Python, or say where it is by python = "…"'
            )
        if self._process.exit_status is None:
            return lost()
        return HostFailed(f"{self.host.python} ended on {self.host}: {said[-1] if said else 'without a word'}")


def _trial_failed(lines: list[str]) -> HostFailed:
    """The failure of a trial run, of which these are the last lines."""
    missing = NO_MODULE.search(lines[-1])
    cures = [f'packages = ["{missing[1]}"] in fleet.toml deploys a missing package'] if missing else lines[:-1]
    return HostFailed(f"the trial run on the robot failed: {lines[-1]}", " | ".join(cures))


def _object(line: bytes) -> dict[str, Any] | None:
    """The object that a line of JSON is; None if it is anything else."""
    try:
        found: object = from_json(line)
    except ValueError:
        return None
    return cast("dict[str, Any]", found) if isinstance(found, dict) else None


@asynccontextmanager
async def host_session(host: Host, known_hosts: Path) -> AsyncGenerator[HostSession]:
    """A host that serves us, until the block ends; HostFailed if it does not come to that, or no longer."""
    async with connected(host, known_hosts) as connection:
        process = await connection.create_process(start_command(host.python), encoding=None)
        async with process:
            session = HostSession(host, process)
            await session.begin()
            yield session
            process.stdin.write_eof()


def start_command(python: str) -> str:
    """The command for the host's shell; any Python prints its version; a supported one continues."""
    return f"exec {shlex.quote(python)} -c {shlex.quote(START)}"


@cache
def program() -> bytes:
    """What the started Python reads first: a length, and so many bytes of a program."""
    folder = Path(__file__).parent / "host_side"
    sources = [(name, (folder / f"{name}.py").read_text(encoding="utf-8")) for name in MODULES]
    text = LOADER.format(package=PACKAGE, sources=json.dumps(sources)).encode()
    return b"%d\n" % len(text) + text


Work = Callable[
    [HostSession, FleetRobot], Awaitable[RobotResult]
]  # of one robot; HostFailed: it is told, and others go on
Before = Callable[[HostSession, list[FleetRobot]], Awaitable[None]]  # of a host; HostFailed: for all its robots


async def nothing_before(session: HostSession, robots: list[FleetRobot]) -> None:
    """A host of which nothing is needed before its robots' turns."""


async def on_hosts(
    robots: Iterable[FleetRobot],
    known_hosts: Path,
    work: Work,
    before: Before = nothing_before,
    after: Before = nothing_before,
    watcher: Watcher = SILENT,
) -> list[RobotResult]:
    """The results of all robots, in their order; hosts work at the same time, robots of a host one by one."""
    chosen, gate = list(robots), asyncio.Semaphore(MOST)

    async def on_host(mine: list[FleetRobot]) -> list[RobotResult]:
        results: dict[str, RobotResult] = {}
        try:
            async with gate, host_session(mine[0].host, known_hosts) as session:
                await before(session, mine)
                for robot in mine:
                    results[robot.name] = await _guarded(work, session, robot)
                    watcher.end(results[robot.name])
                await after(session, mine)
        except HostFailed as error:
            for robot in mine:
                if robot.name not in results:
                    results[robot.name] = RobotResult.failed(robot.name, error)
                    watcher.end(results[robot.name])
        return list(results.values())

    done = await asyncio.gather(*map(on_host, hosts_of(chosen).values()))
    found = {result.robot: result for results in done for result in results}
    return [found[robot.name] for robot in chosen]


async def _guarded(work: Work, session: HostSession, robot: FleetRobot) -> RobotResult:
    try:
        return await work(session, robot)
    except HostFailed as error:
        return RobotResult.failed(robot.name, error)
    except SwarmwireError as error:  # of what was to be sent; what others get may be good
        return RobotResult(robot.name, False, str(error))
