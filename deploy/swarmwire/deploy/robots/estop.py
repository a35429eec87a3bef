"""An emergency stop of robots by two ways: over their network at once, then by SSH, too; one confirmation is enough.

The request over the network waits for no import that only SSH or the terminal needs: these take longer than a robot
takes to answer. A way that fails, for any reason, holds up neither the other one nor another robot.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import FLEET
from swarmwire.comms.wire.access_control import access_control
from swarmwire.comms.wire.keys import SwarmKeys, fault_of_name
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, STOPPED, ask_all, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.deploy.robots.certificates.register import AUTHORITY, certificate_path, key_path
from swarmwire.deploy.robots.fleet import Host
from swarmwire.deploy.robots.result import SILENT, HostFailed, RobotResult, Watcher
from swarmwire.deploy.robots.stop_targets import StopTarget, StopTargets

if TYPE_CHECKING:
    import asyncssh

NETWORK_S = 3.0  # who has not answered by then will not
HEAD_START_S = 0.2  # of the network, in which healthy robots answer, before SSH takes the processor
CONNECT_S, STOP_S = 5.0, 10.0
STOP = """export XDG_RUNTIME_DIR="${{XDG_RUNTIME_DIR:-/run/user/$(id -u)}}"
systemctl --user stop {units}
exec systemctl --user show --property ActiveState {units}"""
OFF = ("inactive",)
NO_ENDPOINT, NO_HOST = "its address is not known", "its address or user is not known"
Answers = dict[str, str]  # by robot: "" if its stop is confirmed, else why not


def ask_network(fleet: StopTargets, robots: Sequence[StopTarget]) -> "Future[Answers]":
    """Request the stop over the network; returns once all robots have answered, or after the head start."""
    executor = ThreadPoolExecutor(1, "network")
    answers = executor.submit(_over_network, fleet, robots)
    executor.shutdown(wait=False)
    wait([answers], HEAD_START_S)
    return answers


async def estop(
    fleet: StopTargets, robots: Sequence[StopTarget], asked: "Future[Answers]", watcher: Watcher = SILENT
) -> list[RobotResult]:
    """A line per robot: by which way it was confirmed that its motors are off, or why by neither.

    `asked` has the answers over the network.
    """
    import asyncio

    by_network, by_ssh = await asyncio.gather(asyncio.wrap_future(asked), _over_ssh(fleet, robots, watcher))
    names = [target.robot for target in robots]
    for name in {name for name in names if names.count(name) > 1}:
        by_network[name] = by_network[name] or "an answer, of one of several robots of this name"
    return [_result(target.robot, by_network[target.robot], by_ssh[target]) for target in robots]


def _result(robot: str, by_network: str, by_ssh: str) -> RobotResult:
    ways = {"over the network": by_network, "by SSH": by_ssh}
    confirmed = [way for way, fault in ways.items() if not fault]
    faults = "; ".join(f"{way}: {fault}" for way, fault in ways.items() if fault)
    if confirmed:
        return RobotResult(
            robot, True, f"stopped, confirmed {' and '.join(confirmed)}" + (f" ({faults})" if faults else "")
        )
    return RobotResult(robot, False, f"NOT CONFIRMED: {faults}", "switch it off by hand")


def _over_network(fleet: StopTargets, robots: Sequence[StopTarget]) -> Answers:
    endpoints = fleet.endpoints(robots)
    faults = {target.robot: "no answer" if target.endpoint else NO_ENDPOINT for target in robots}
    if not endpoints:
        return faults
    try:
        network, keys = _network(fleet, endpoints), SwarmKeys(fleet.swarm)
        everybody = list(dict.fromkeys(target.robot for target in fleet.robots))
        access = access_control(keys, everybody, fleet.operator, operator=fleet.operator, revoked=fleet.revoked)
        session = open_swarm(network, access if network.proves else None, small=False)
        try:
            replies = ask_all(session, keys, ESTOP, faults, NETWORK_S)
        finally:
            close_session(session)
    except Exception as error:  # noqa: BLE001 - robots are stopped by the other way
        return dict.fromkeys(faults, str(error) or type(error).__name__)
    return {name: "" if said == STOPPED else said or faults[name] for name, said in replies.items()}


def _network(fleet: StopTargets, endpoints: tuple[str, ...]) -> Network:
    """The network of a client of these robots on this machine; BadInput if its certificates or keys are not known."""
    where, folder = str(fleet.file), fleet.certificates
    if fault_of_name(fleet.swarm):
        raise BadInput(where, "swarm", "expected the root of the network's keys")
    if folder is None:
        if not fleet.insecure:
            raise BadInput(where, "certificates", "expected the folder of `swarmwire certs`, or insecure = true")
        return Network(connect=endpoints, insecure=True)
    names = (AUTHORITY, certificate_path), (fleet.operator, certificate_path), (fleet.operator, key_path)
    ca, certificate, key = (path(folder, name) for name, path in names)
    for path in (ca, certificate, key):
        if not path.is_file():
            raise BadInput(where, "certificates", f"expected a file, {path} is none")
    return Network(connect=endpoints, ca=ca, certificate=certificate, key=key)


async def _over_ssh(fleet: StopTargets, robots: Sequence[StopTarget], watcher: Watcher) -> Mapping[StopTarget, str]:
    import asyncio

    answers = dict.fromkeys(robots, NO_HOST)
    hosts: dict[Host, list[StopTarget]] = {}
    for target in robots:
        if target.host is not None:
            hosts.setdefault(target.host, []).append(target)

    async def on_host(host: Host, mine: list[StopTarget]) -> None:
        for target in mine:
            watcher.step(target.robot, "stop")
        try:
            FLEET.need("SSH")
            faults = await _stopped(host, fleet.known_hosts, [target.robot for target in mine])
        except HostFailed as error:
            faults = [error.cause] * len(mine)
        except Exception as error:  # noqa: BLE001 - other hosts and the network are asked
            faults = [str(error) or type(error).__name__] * len(mine)
        answers.update(zip(mine, faults, strict=True))

    await asyncio.gather(*(on_host(host, mine) for host, mine in hosts.items()))
    return answers


async def _stopped(host: Host, known_hosts: Path, names: list[str]) -> list[str]:
    """The fault of each robot whose unit is not inactive, else ""; HostFailed if the host cannot tell."""
    from swarmwire.deploy.robots.connecting import connected

    async with connected(host, known_hosts, CONNECT_S) as connection:
        return await _stop_units(connection, names)


async def _stop_units(connection: "asyncssh.SSHClientConnection", names: list[str]) -> list[str]:
    import asyncssh

    from swarmwire.deploy.robots.connecting import lost
    from swarmwire.deploy.robots.host_side.system import unit_of

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
    return ["" if state in OFF else f"its unit is {state}" for state in states]
