"""`swarmwire robots status`: what each robot runs, and what its agent says of itself."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.host_session import HostSession
from swarmwire.deploy.fleet.on_hosts import on_hosts
from swarmwire.deploy.fleet.result import Result
from swarmwire.deploy.fleet.watcher import SILENT, Watcher


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


async def status(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher = SILENT) -> list[RobotState]:
    """The state of each robot; of one that cannot be asked, why."""
    found: dict[str, RobotState] = {}

    async def one(session: HostSession, robot: Robot) -> Result:
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        found[robot.name] = _told(robot.name, state)
        return Result(robot.name, True, "")

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


def _fault(result: Result) -> str:
    return "; ".join(filter(None, (result.said, result.cure)))
