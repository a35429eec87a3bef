"""A host that serves us: requests and answers, one after the other, over one connection."""

import asyncio
import json
import re
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, cast

import asyncssh

from swarmwire.comms.clock import DatedClock
from swarmwire.comms.config import from_json
from swarmwire.deploy.fleet.archive import Archive
from swarmwire.deploy.fleet.connecting import CONNECT_S, connected, lost
from swarmwire.deploy.fleet.fleet import Host
from swarmwire.deploy.fleet.host_failed import HostFailed
from swarmwire.deploy.fleet.host_side.facts import NO_SYSTEMD
from swarmwire.deploy.fleet.sent_along import OLDEST, program, start_command

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


class HostSession:
    """Requests to a host that is served by `host_side`; all raise HostFailed with the cause and the cure."""

    def __init__(
        self, host: Host, connection: asyncssh.SSHClientConnection, process: "asyncssh.SSHClientProcess[bytes]"
    ) -> None:
        """Over a process that has just been started."""
        self.host, self.connection, self._process = host, connection, process
        self.facts: dict[str, Any] = {}  # what `host_side.facts` tells

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
    cures = [f'packages = ["{missing[1]}"] in fleet.toml deploys what the agent imports'] if missing else lines[:-1]
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
            session = HostSession(host, connection, process)
            await session.begin()
            yield session
            process.stdin.write_eof()
