"""What robots run: `swarmwire robots start`, `stop`, `rollback` and `status`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from swarmwire.agent.on_robot.safety import STOP_REQUESTED
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
from swarmwire.deploy.robots.host_session import HostSession, on_hosts
from swarmwire.deploy.robots.result import SILENT, HostFailed, RobotResult, Watcher

AT_REST = ("inactive", "failed")
LOOK = "swarmwire robots logs shows its agent's output"


async def start(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher = SILENT) -> list[RobotResult]:
    """Start robots' agents, each by its current release; running agents do not change.

    An agent that still runs after an emergency stop is a failure: only its end clears the latch.
    """

    async def before(session: HostSession, _: list[FleetRobot]) -> None:
        session.need_manager()
        fault = await session.ask("linger")
        if fault:
            cure = f"on the robot: sudo loginctl enable-linger {session.host.user}"
            raise HostFailed(f"its units would end with this connection ({fault})", cure)

    async def one(session: HostSession, robot: FleetRobot) -> RobotResult:
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        if state["current"] is None:
            raise HostFailed("there is no release to start", "swarmwire robots deploy")
        status: dict[str, str] = state["status"] or {}
        if state["ActiveState"] == "active" and status.get("state") == STOP_REQUESTED:
            raise HostFailed("an emergency stop keeps its motors off", "swarmwire robots stop, then start")
        if state["ActiveState"] == "active":
            return RobotResult(robot.name, True, f"runs already: {state['running'] or state['current']}")
        watcher.step(robot.name, "start")
        said = (await session.ask("run_units", verb="start", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(f"{state['current']} does not start: {said}", LOOK)
        return RobotResult(robot.name, True, f"started: {state['current']}")

    return await on_hosts(robots, fleet.known_hosts, one, before, watcher=watcher)


async def stop(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher = SILENT) -> list[RobotResult]:
    """Stop robots' agents, and with them the motors."""

    async def one(session: HostSession, robot: FleetRobot) -> RobotResult:
        before = (await session.ask("state", robots=[robot.name]))[robot.name]
        if before["LoadState"] == "not-found":
            return RobotResult(robot.name, True, "does not run: nothing was ever deployed")
        watcher.step(robot.name, "stop")
        said = (await session.ask("run_units", verb="stop", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(f"does not stop: {said}", "swarmwire robots estop, or switch it off")
        after = (await session.ask("state", robots=[robot.name]))[robot.name]
        if after["ActiveState"] == "failed":
            raise HostFailed(f"its agent has ended, but not well ({after['Result']}): are its motors off?", LOOK)
        return RobotResult(robot.name, True, "did not run" if before["ActiveState"] in AT_REST else "stopped")

    return await on_hosts(robots, fleet.known_hosts, one, watcher=watcher)


async def rollback(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher = SILENT) -> list[RobotResult]:
    """Go back to the release before the current one; running robots are restarted with it."""

    async def before(session: HostSession, _: list[FleetRobot]) -> None:
        await session.ask("lock")

    async def one(session: HostSession, robot: FleetRobot) -> RobotResult:
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        watcher.step(robot.name, "roll back")
        release = await session.ask("go_back", robot=robot.name)
        if state["ActiveState"] not in ("active", "activating"):
            return RobotResult(robot.name, True, f"back to {release}")
        said = (await session.ask("run_units", verb="restart", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(f"back to {release}, which does not start: {said}", LOOK)
        return RobotResult(robot.name, True, f"back to {release}, restarted")

    return await on_hosts(robots, fleet.known_hosts, one, before, watcher=watcher)


@dataclass(frozen=True)
class RobotState:
    """One robot's line."""

    robot: str
    unit: str  # "active (running)", "inactive", …; "" if it cannot be asked
    release: str  # what runs, or would be started
    since: str
    restarts: int
    agent: Mapping[str, Any] = field(default_factory=dict[str, Any])  # its status.json
    fault: str = ""

    @property
    def good(self) -> bool:
        """Whether nothing is wrong with it."""
        return not self.fault and not self.unit.startswith("failed")


async def status(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher = SILENT) -> list[RobotState]:
    """The state of each robot; of one that cannot be asked, why."""
    found: dict[str, RobotState] = {}

    async def one(session: HostSession, robot: FleetRobot) -> RobotResult:
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        found[robot.name] = _told(robot.name, state)
        return RobotResult(robot.name, True, "")

    results = await on_hosts(robots, fleet.known_hosts, one, watcher=watcher)
    return [found.get(of.robot) or RobotState(of.robot, "", "", "", 0, fault=_fault(of)) for of in results]


def _told(robot: str, state: Mapping[str, Any]) -> RobotState:
    active, sub = state["ActiveState"], state["SubState"]
    running, current = state["running"], state["current"]
    release = f"{running} (next: {current})" if running and running != current else current or ""
    return RobotState(
        robot=robot,
        unit="never deployed" if current is None else active if active == sub else f"{active} ({sub})",
        release=release,
        since=state["ActiveEnterTimestamp"].partition(" ")[2] if active == "active" else "",  # less the weekday
        restarts=int(state.get("NRestarts") or 0),
        agent=state["status"] or {},
    )


def _fault(result: RobotResult) -> str:
    return "; ".join(filter(None, (result.said, result.cure)))
