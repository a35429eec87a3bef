"""An emergency stop of robots over their network and by SSH; one confirmation is enough.

The network comes first. Its request precedes the imports that SSH needs, which take longer than a robot's answer. A
failure of one route delays neither the other route nor another robot.
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
from swarmwire.deploy.robots.result import HostFailed, RobotResult
from swarmwire.deploy.robots.stop_targets import StopTarget, StopTargets

if TYPE_CHECKING:
    import asyncssh

NETWORK_TIMEOUT_S = 3.0
HEAD_START_S = 0.1  # time in which healthy robots answer, before SSH needs the processor
CONNECT_TIMEOUT_S, STOP_TIMEOUT_S = 5.0, 10.0
STOP_COMMAND = """export XDG_RUNTIME_DIR="${{XDG_RUNTIME_DIR:-/run/user/$(id -u)}}"
systemctl --user stop {units}
exec systemctl --user show --property ActiveState {units}"""
OFF = ("inactive",)  # states of a unit whose motors are off
NO_ENDPOINT, NO_HOST = "its address is not known", "its address or user is not known"
Faults = dict[str, str]  # reason by robot; "": its stop is confirmed


def request_stop(fleet: StopTargets, robots: Sequence[StopTarget]) -> "Future[Faults]":
    """Request the stop over the network; return once all robots have answered, or after the head start."""
    executor = ThreadPoolExecutor(1, "network")
    network_faults = executor.submit(_stop_over_network, fleet, robots)
    executor.shutdown(wait=False)
    wait([network_faults], HEAD_START_S)
    return network_faults


async def stop_by_ssh(
    fleet: StopTargets, robots: Sequence[StopTarget], network_faults: "Future[Faults]"
) -> list[RobotResult]:
    """Stop the robots by SSH, too; return the results of both routes, one per robot."""
    import asyncio

    by_network, by_ssh = await asyncio.gather(asyncio.wrap_future(network_faults), _stop_over_ssh(fleet, robots))
    names = [target.robot for target in robots]
    for name in {name for name in names if names.count(name) > 1}:
        by_network[name] = by_network[name] or "an answer, of one of several robots of this name"
    return [_result(target.robot, by_network[target.robot], by_ssh[target]) for target in robots]


def _result(robot: str, network_fault: str, ssh_fault: str) -> RobotResult:
    routes = {"over the network": network_fault, "by SSH": ssh_fault}
    confirmed = [route for route, fault in routes.items() if not fault]
    faults = "; ".join(f"{route}: {fault}" for route, fault in routes.items() if fault)
    if not confirmed:
        return RobotResult(robot, False, f"NOT CONFIRMED: {faults}", "switch it off by hand")
    return RobotResult(
        robot, True, f"stopped, confirmed {' and '.join(confirmed)}" + (f" ({faults})" if faults else "")
    )


def _stop_over_network(fleet: StopTargets, robots: Sequence[StopTarget]) -> Faults:
    endpoints = fleet.endpoints(robots)
    faults = {target.robot: "no answer" if target.endpoint else NO_ENDPOINT for target in robots}
    if not endpoints:
        return faults
    try:
        network, keys = _network(fleet, endpoints), SwarmKeys(fleet.swarm)
        names = list(dict.fromkeys(target.robot for target in fleet.robots))
        access = access_control(keys, names, fleet.operator, operator=fleet.operator, revoked=fleet.revoked)
        session = open_swarm(network, access if network.proves else None, small=False)
        try:
            replies = ask_all(session, keys, ESTOP, faults, NETWORK_TIMEOUT_S)
        finally:
            close_session(session)
    except Exception as error:  # noqa: BLE001 - SSH still stops the robots
        return dict.fromkeys(faults, str(error) or type(error).__name__)
    return {name: "" if reply == STOPPED else reply or faults[name] for name, reply in replies.items()}


def _network(fleet: StopTargets, endpoints: tuple[str, ...]) -> Network:
    """Return the network of a client of these robots; BadInput if its certificates or keys are not known."""
    where, folder = str(fleet.file), fleet.certificates
    if fault_of_name(fleet.swarm):
        raise BadInput(where, "swarm", "expected the root of the network's keys")
    if folder is None:
        if not fleet.insecure:
            raise BadInput(where, "certificates", "expected the folder of `swarmwire certs`, or insecure = true")
        return Network(connect=endpoints, insecure=True)
    ca, certificate = certificate_path(folder, AUTHORITY), certificate_path(folder, fleet.operator)
    key = key_path(folder, fleet.operator)
    for path in (ca, certificate, key):
        if not path.is_file():
            raise BadInput(where, "certificates", f"expected a file, {path} is none")
    return Network(connect=endpoints, ca=ca, certificate=certificate, key=key)


async def _stop_over_ssh(fleet: StopTargets, robots: Sequence[StopTarget]) -> Mapping[StopTarget, str]:
    """Stop the robots of all hosts at the same time; return the fault of each robot, "" if it is stopped."""
    import asyncio

    faults = dict.fromkeys(robots, NO_HOST)
    hosts: dict[Host, list[StopTarget]] = {}
    for target in robots:
        if target.host is not None:
            hosts.setdefault(target.host, []).append(target)

    async def stop_host(host: Host, targets: list[StopTarget]) -> None:
        try:
            FLEET.need("SSH")
            host_faults = await _stop_host(host, fleet.known_hosts, [target.robot for target in targets])
        except HostFailed as error:
            host_faults = [error.cause] * len(targets)
        except Exception as error:  # noqa: BLE001 - other hosts and the network still stop their robots
            host_faults = [str(error) or type(error).__name__] * len(targets)
        faults.update(zip(targets, host_faults, strict=True))

    await asyncio.gather(*(stop_host(host, targets) for host, targets in hosts.items()))
    return faults


async def _stop_host(host: Host, known_hosts: Path, names: list[str]) -> list[str]:
    """Return the fault of each robot whose unit is not inactive, else ""; HostFailed if the host does not report it."""
    from swarmwire.deploy.robots.connecting import connected

    async with connected(host, known_hosts, CONNECT_TIMEOUT_S) as connection:
        return await _stop_units(connection, names)


async def _stop_units(connection: "asyncssh.SSHClientConnection", names: list[str]) -> list[str]:
    import asyncssh

    from swarmwire.deploy.robots.connecting import lost
    from swarmwire.deploy.robots.host_side.system import unit_of

    command = STOP_COMMAND.format(units=" ".join(map(unit_of, names)))
    try:
        process = await connection.run(command, timeout=STOP_TIMEOUT_S, errors="replace")
    except asyncssh.TimeoutError:
        raise HostFailed(f"systemctl takes longer than {STOP_TIMEOUT_S:g} s") from None
    if process.exit_status is None:
        raise lost()
    states = [line.partition("=")[2] for line in str(process.stdout).splitlines() if line.startswith("ActiveState=")]
    if len(states) != len(names):
        error = str(process.stderr).strip().partition("\n")[0]
        raise HostFailed(error or f"systemctl ended with {process.exit_status}")
    return ["" if state in OFF else f"its unit is {state}" for state in states]
