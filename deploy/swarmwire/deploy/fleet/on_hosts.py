"""The same work on many hosts at the same time: a result for each robot, and one that fails holds up no other."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.fleet.fleet import Robot, hosts_of
from swarmwire.deploy.fleet.host_failed import HostFailed
from swarmwire.deploy.fleet.host_session import HostSession, host_session
from swarmwire.deploy.fleet.result import Result
from swarmwire.deploy.fleet.watcher import SILENT, Watcher

MOST = 64  # hosts at the same time
Work = Callable[[HostSession, Robot], Awaitable[Result]]  # of one robot; HostFailed: it is told, and others go on
Before = Callable[[HostSession, list[Robot]], Awaitable[None]]  # of a host; HostFailed: for all its robots


async def nothing_before(session: HostSession, robots: list[Robot]) -> None:
    """A host of which nothing is needed before its robots' turns."""


async def on_hosts(
    robots: Iterable[Robot],
    known_hosts: Path,
    work: Work,
    before: Before = nothing_before,
    after: Before = nothing_before,
    watcher: Watcher = SILENT,
) -> list[Result]:
    """The results of all robots, in their order; hosts work at the same time, robots of a host one by one."""
    chosen, gate = list(robots), asyncio.Semaphore(MOST)

    async def on_host(mine: list[Robot]) -> list[Result]:
        results: dict[str, Result] = {}
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
                    results[robot.name] = Result.failed(robot.name, error)
                    watcher.end(results[robot.name])
        return list(results.values())

    done = await asyncio.gather(*map(on_host, hosts_of(chosen).values()))
    found = {result.robot: result for results in done for result in results}
    return [found[robot.name] for robot in chosen]


async def _guarded(work: Work, session: HostSession, robot: Robot) -> Result:
    try:
        return await work(session, robot)
    except HostFailed as error:
        return Result.failed(robot.name, error)
    except SwarmwireError as error:  # of what was to be sent; what others get may be good
        return Result(robot.name, False, str(error))
