"""Units of robots on their hosts: `swarmwire robots start`, `stop`, `rollback` and `status`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from swarmwire.agent.on_robot.states import STOP_REQUESTED
from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
from swarmwire.deploy.robots.host_session import HostSession, on_hosts
from swarmwire.deploy.robots.host_side.messages import (
    ControlUnits,
    EnableLinger,
    Lock,
    ReadUnits,
    RollBack,
    UnitState,
)
from swarmwire.deploy.robots.result import HostFailed, RobotResult, Watcher

AT_REST = ("inactive", "failed")  # states of a unit that does not run
RUNNING = ("active", "activating")
SEE_LOGS = "swarmwire robots logs shows its agent's output"


async def unit_state(session: HostSession, robot: str) -> UnitState:
    """Return the state of a robot's unit."""
    return (await session.request(ReadUnits([robot])))[robot]


async def control_unit(session: HostSession, verb: str, robot: str) -> str:
    """Start, stop or restart a robot's unit; return the fault, or ""."""
    return (await session.request(ControlUnits(verb, [robot])))[robot]


async def start(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher) -> list[RobotResult]:
    """Start each robot's agent in its current release; running agents do not change.

    An agent that still runs after an emergency stop is a failure: only its end clears the latch.
    """

    async def prepare(session: HostSession, _: list[FleetRobot]) -> None:
        session.need_manager()
        fault = await session.request(EnableLinger())
        if fault:
            remedy = f"on the robot: sudo loginctl enable-linger {session.host.user}"
            raise HostFailed(f"its units would end with this connection ({fault})", remedy)

    async def start_robot(session: HostSession, robot: FleetRobot) -> RobotResult:
        state = await unit_state(session, robot.name)
        if state.current is None:
            raise HostFailed("there is no release to start", "swarmwire robots deploy")
        if state.active == "active" and (state.status or {}).get("state") == STOP_REQUESTED:
            raise HostFailed("an emergency stop keeps its motors off", "swarmwire robots stop, then start")
        if state.active == "active":
            return RobotResult(robot.name, True, f"runs already: {state.running or state.current}")
        watcher.step(robot.name, "start")
        fault = await control_unit(session, "start", robot.name)
        if fault:
            raise HostFailed(f"{state.current} does not start: {fault}", SEE_LOGS)
        return RobotResult(robot.name, True, f"started: {state.current}")

    return await on_hosts(robots, fleet.known_hosts, start_robot, prepare, watcher=watcher)


async def stop(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher) -> list[RobotResult]:
    """Stop robots' agents, and with them the motors."""

    async def stop_robot(session: HostSession, robot: FleetRobot) -> RobotResult:
        before = await unit_state(session, robot.name)
        if before.load == "not-found":
            return RobotResult(robot.name, True, "does not run: nothing was ever deployed")
        watcher.step(robot.name, "stop")
        fault = await control_unit(session, "stop", robot.name)
        if fault:
            raise HostFailed(f"does not stop: {fault}", "swarmwire robots estop, or switch it off")
        after = await unit_state(session, robot.name)
        if after.active == "failed":
            raise HostFailed(f"its agent has ended, but not well ({after.result}): are its motors off?", SEE_LOGS)
        return RobotResult(robot.name, True, "did not run" if before.active in AT_REST else "stopped")

    return await on_hosts(robots, fleet.known_hosts, stop_robot, watcher=watcher)


async def rollback(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher) -> list[RobotResult]:
    """Go back to the release before the current one; running robots are restarted with it."""

    async def lock(session: HostSession, _: list[FleetRobot]) -> None:
        await session.request(Lock())

    async def roll_back_robot(session: HostSession, robot: FleetRobot) -> RobotResult:
        state = await unit_state(session, robot.name)
        watcher.step(robot.name, "roll back")
        release = await session.request(RollBack(robot.name))
        if state.active not in RUNNING:
            return RobotResult(robot.name, True, f"back to {release}")
        fault = await control_unit(session, "restart", robot.name)
        if fault:
            raise HostFailed(f"back to {release}, which does not start: {fault}", SEE_LOGS)
        return RobotResult(robot.name, True, f"back to {release}, restarted")

    return await on_hosts(robots, fleet.known_hosts, roll_back_robot, lock, watcher=watcher)


@dataclass(frozen=True)
class RobotStatus:
    """Status of one robot."""

    robot: str
    unit: str  # "active (running)", "inactive", …; "" if the host does not answer
    release: str  # release that runs, or starts next
    since: str
    restarts: int
    agent: Mapping[str, Any] = field(default_factory=dict[str, Any])  # content of its status file
    fault: str = ""

    @property
    def ok(self) -> bool:
        """True if the host answers and the unit has not failed."""
        return not self.fault and not self.unit.startswith("failed")


async def status(fleet: Fleet, robots: Sequence[FleetRobot], watcher: Watcher) -> list[RobotStatus]:
    """Return the status of each robot, with the fault of a host that does not answer."""
    statuses: dict[str, RobotStatus] = {}

    async def read_status(session: HostSession, robot: FleetRobot) -> RobotResult:
        statuses[robot.name] = _status(robot.name, await unit_state(session, robot.name))
        return RobotResult(robot.name, True, "")

    results = await on_hosts(robots, fleet.known_hosts, read_status, watcher=watcher)
    return [
        statuses.get(result.robot) or RobotStatus(result.robot, "", "", "", 0, fault=_fault(result))
        for result in results
    ]


def _status(robot: str, state: UnitState) -> RobotStatus:
    release = state.current or ""
    if state.running and state.running != state.current:
        release = f"{state.running} (next: {state.current})"
    unit = state.active if state.active == state.sub else f"{state.active} ({state.sub})"
    return RobotStatus(
        robot=robot,
        unit="never deployed" if state.current is None else unit,
        release=release,
        since=state.active_since.partition(" ")[2] if state.active == "active" else "",  # without the weekday
        restarts=state.restarts,
        agent=state.status or {},
    )


def _fault(result: RobotResult) -> str:
    return "; ".join(filter(None, (result.text, result.remedy)))
