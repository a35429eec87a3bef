"""`swarmwire robots estop`: every robot is stopped by two ways at the same time; one that says so is enough."""

import asyncio
from collections.abc import Sequence

import asyncssh

from swarmwire.comms.errors import SwarmwireError
from swarmwire.comms.wire.access_control import access_control
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, STOPPED, ask_all, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.deploy.fleet.connecting import connected, lost
from swarmwire.deploy.fleet.fleet import Fleet, Host, Robot, hosts_of
from swarmwire.deploy.fleet.host_failed import HostFailed
from swarmwire.deploy.fleet.host_side.units import unit_of
from swarmwire.deploy.fleet.result import Result
from swarmwire.deploy.fleet.robot_settings import operator_network
from swarmwire.deploy.fleet.watcher import SILENT, Watcher

NETWORK_S = 3.0  # who has not answered by then will not
CONNECT_S, STOP_S = 5.0, 10.0
STOP = """export XDG_RUNTIME_DIR="${{XDG_RUNTIME_DIR:-/run/user/$(id -u)}}"
systemctl --user stop {units}
exec systemctl --user show --property ActiveState {units}"""
OFF = ("inactive",)
Said = dict[str, str]  # by robot: "" if it is confirmed, else why not


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
