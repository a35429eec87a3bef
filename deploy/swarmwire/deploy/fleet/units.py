"""What robots run: `swarmwire robots start`, `stop`, `rollback`, `status` and `estop`.

An emergency stop takes two ways at the same time, the robots' network and SSH; one confirmation is enough.
"""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import asyncssh

from swarmwire.agent.on_robot.safety import STOP_REQUESTED
from swarmwire.comms.errors import SwarmwireError
from swarmwire.comms.wire.access_control import access_control
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, STOPPED, ask_all, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.deploy.fleet.connecting import connected, lost
from swarmwire.deploy.fleet.fleet import Fleet, Host, Robot, hosts_of
from swarmwire.deploy.fleet.host_session import HostSession, on_hosts
from swarmwire.deploy.fleet.host_side.system import unit_of
from swarmwire.deploy.fleet.release import operator_network
from swarmwire.deploy.fleet.result import SILENT, HostFailed, Result, Watcher

AT_REST = ("inactive", "failed")
LOOK = "swarmwire robots logs shows its agent's output"
NETWORK_S = 3.0  # who has not answered by then will not
CONNECT_S, STOP_S = 5.0, 10.0
STOP = """export XDG_RUNTIME_DIR="${{XDG_RUNTIME_DIR:-/run/user/$(id -u)}}"
systemctl --user stop {units}
exec systemctl --user show --property ActiveState {units}"""
OFF = ("inactive",)
Said = dict[str, str]  # by robot: "" if it is confirmed, else why not


async def start(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher = SILENT) -> list[Result]:
    """Start robots' agents, each by its current release; running agents do not change.

    An agent that still runs after an emergency stop is a failure: only its end clears the latch.
    """

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
        status: dict[str, str] = state["status"] or {}
        if state["ActiveState"] == "active" and status.get("state") == STOP_REQUESTED:
            raise HostFailed("an emergency stop keeps its motors off", "swarmwire robots stop, then start")
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
    """Go back to the release before the current one; running robots are restarted with it."""

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


async def estop(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher = SILENT) -> list[Result]:
    """A line per robot: by which way it was confirmed that its motors are off, or why by neither."""
    by_network, by_ssh = await asyncio.gather(
        asyncio.to_thread(_over_network, fleet, robots), _over_ssh(fleet, robots, watcher)
    )
    return [_result(robot.name, by_network[robot.name], by_ssh[robot.name]) for robot in robots]


def _result(robot: str, by_network: str, by_ssh: str) -> Result:
    ways = {"over the network": by_network, "by SSH": by_ssh}
    confirmed = [way for way, fault in ways.items() if not fault]
    faults = "; ".join(f"{way}: {fault}" for way, fault in ways.items() if fault)
    if confirmed:
        return Result(robot, True, f"stopped, confirmed {' and '.join(confirmed)}" + (f" ({faults})" if faults else ""))
    return Result(robot, False, f"NOT CONFIRMED: {faults}", "switch it off by hand")


def _over_network(fleet: Fleet, robots: Sequence[Robot]) -> Said:
    names = [robot.name for robot in robots]
    try:
        revoked, keys = fleet.revoked(), SwarmKeys(fleet.swarm)
        folder = fleet.certificates or fleet.file.parent
        where = str(fleet.file)
        network = Network.from_mapping(operator_network(fleet, revoked, robots), where, folder, "operator")
        everybody = [robot.name for robot in fleet.robots]
        access = access_control(keys, everybody, fleet.operator, operator=fleet.operator, revoked=revoked)
        session = open_swarm(network, access if network.proves else None, small=False)
    except SwarmwireError as error:
        return dict.fromkeys(names, str(error))
    try:
        replies = ask_all(session, keys, ESTOP, names, NETWORK_S)
    finally:
        close_session(session)
    return {name: "" if said == STOPPED else said or "no answer" for name, said in replies.items()}


async def _over_ssh(fleet: Fleet, robots: Sequence[Robot], watcher: Watcher) -> Said:
    async def on_host(host: Host, mine: list[Robot]) -> Said:
        names = [robot.name for robot in mine]
        for name in names:
            watcher.step(name, "stop")
        try:
            async with connected(host, fleet.known_hosts, CONNECT_S) as connection:
                return await _stopped(connection, names)
        except HostFailed as error:
            return dict.fromkeys(names, error.cause)
        except SwarmwireError as error:  # whatever this way lacks, the other's answers are told
            return dict.fromkeys(names, str(error))

    done = await asyncio.gather(*(on_host(host, mine) for host, mine in hosts_of(robots).items()))
    return {name: fault for said in done for name, fault in said.items()}


async def _stopped(connection: asyncssh.SSHClientConnection, names: list[str]) -> Said:
    command = STOP.format(units=" ".join(map(unit_of, names)))
    try:
        done = await connection.run(command, timeout=STOP_S, errors="replace")
    except asyncssh.TimeoutError:
        raise HostFailed(f"systemctl takes longer than {STOP_S:g} s") from None
    if done.exit_status is None:
        raise lost()
    states = [line.partition("=")[2] for line in str(done.stdout).splitlines() if line.startswith("ActiveState=")]
    if len(states) != len(names):
        said = str(done.stderr).strip().partition("\n")[0]
        raise HostFailed(said or f"systemctl ended with {done.exit_status}")
    return {name: "" if state in OFF else f"its unit is {state}" for name, state in zip(names, states, strict=True)}
