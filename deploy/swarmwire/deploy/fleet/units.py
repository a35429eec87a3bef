"""`swarmwire robots start`, `stop` and `rollback`: what runs on robots, and which release of it."""

from collections.abc import Sequence

from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.host_failed import HostFailed
from swarmwire.deploy.fleet.host_session import HostSession
from swarmwire.deploy.fleet.on_hosts import on_hosts
from swarmwire.deploy.fleet.result import Result
from swarmwire.deploy.fleet.watcher import SILENT, Watcher

AT_REST = ("inactive", "failed")
LOOK = "swarmwire robots logs tells what its agent says"


async def start(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher = SILENT) -> list[Result]:
    """Start robots' agents, each by its current release; those that run go on as they are."""

    async def before(session: HostSession, _: list[Robot]) -> None:
        session.need_manager()
        fault = await session.ask("linger")
        if fault:
            cure = f"on the robot: sudo loginctl enable-linger {session.host.user}"
            raise HostFailed(f"its units would end with this connection ({fault})", cure)

    async def one(session: HostSession, robot: Robot) -> Result:
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        if state["current"] is None:
            raise HostFailed("there is no release to start", "swarmwire robots deploy")
        if state["ActiveState"] == "active":
            return Result(robot.name, True, f"runs already: {state['running'] or state['current']}")
        watcher.step(robot.name, "start")
        said = (await session.ask("run_units", verb="start", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(f"{state['current']} does not start: {said}", LOOK)
        return Result(robot.name, True, f"started: {state['current']}")

    return await on_hosts(robots, fleet.known_hosts, one, before, watcher=watcher)


async def stop(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher = SILENT) -> list[Result]:
    """Stop robots' agents, and with them the motors."""

    async def one(session: HostSession, robot: Robot) -> Result:
        before = (await session.ask("state", robots=[robot.name]))[robot.name]
        if before["LoadState"] == "not-found":
            return Result(robot.name, True, "does not run: nothing was ever deployed")
        watcher.step(robot.name, "stop")
        said = (await session.ask("run_units", verb="stop", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(f"does not stop: {said}", "swarmwire robots estop, or switch it off")
        after = (await session.ask("state", robots=[robot.name]))[robot.name]
        if after["ActiveState"] == "failed":
            raise HostFailed(f"its agent has ended, but not well ({after['Result']}): are its motors off?", LOOK)
        return Result(robot.name, True, "did not run" if before["ActiveState"] in AT_REST else "stopped")

    return await on_hosts(robots, fleet.known_hosts, one, watcher=watcher)


async def rollback(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher = SILENT) -> list[Result]:
    """Go back to the release before the current one; robots that run are started anew with it."""

    async def before(session: HostSession, _: list[Robot]) -> None:
        await session.ask("lock")

    async def one(session: HostSession, robot: Robot) -> Result:
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        watcher.step(robot.name, "roll back")
        release = await session.ask("go_back", robot=robot.name)
        if state["ActiveState"] not in ("active", "activating"):
            return Result(robot.name, True, f"back to {release}")
        said = (await session.ask("run_units", verb="restart", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(f"back to {release}, which does not start: {said}", LOOK)
        return Result(robot.name, True, f"back to {release}, restarted")

    return await on_hosts(robots, fleet.known_hosts, one, before, watcher=watcher)
