"""`swarmwire robots check`: whether a deployment would work, and what runs afterwards."""

from collections.abc import Mapping, Sequence

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.deploy import SPARE_BYTES
from swarmwire.deploy.fleet.driver_address import driver_endpoint
from swarmwire.deploy.fleet.environment.target import Target
from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.host_failed import HostFailed
from swarmwire.deploy.fleet.host_session import HostSession
from swarmwire.deploy.fleet.on_hosts import on_hosts
from swarmwire.deploy.fleet.result import Result
from swarmwire.deploy.fleet.watcher import SILENT, Watcher

REACH_S = 3.0
MAX_AHEAD_NS = 20_000_000  # of a clock: more would show in latencies between robots
NS_PER_MS = 1_000_000
FIRST_DEPLOYMENT_BYTES = 150_000_000 + SPARE_BYTES  # what packages come to


async def check(
    fleet: Fleet, robots: Sequence[Robot], faults: Mapping[str, BadInput], watcher: Watcher = SILENT
) -> list[Result]:
    """A line per robot: what it is, or the first thing that is wrong; `faults` are those of settings, found here."""

    async def one(session: HostSession, robot: Robot) -> Result:
        if robot.name in faults:
            raise HostFailed(str(faults[robot.name]))
        watcher.step(robot.name, "check")
        said = session.facts
        target = Target.of(said)
        session.need_manager()
        if said["free_bytes"] < FIRST_DEPLOYMENT_BYTES:
            free = f"{said['free_bytes'] / 1e6:.0f} MB are free, {FIRST_DEPLOYMENT_BYTES / 1e6:.0f} MB are needed"
            raise HostFailed(f"the disk is full: {free}", "make room: df -h")
        notes = await _notes(session, robot)
        version = ".".join(map(str, said["python"]))
        machine = f"Python {version}, {target.machine}, glibc {target.glibc[0]}.{target.glibc[1]}"
        return Result(robot.name, True, "; ".join([machine, f"{said['free_bytes'] / 1e9:.1f} GB free", *notes]))

    return await on_hosts(robots, fleet.known_hosts, one, watcher=watcher)


async def _notes(session: HostSession, robot: Robot) -> list[str]:
    """What is as it should be, or can be lived with; HostFailed for a driver's robot that does not answer."""
    notes = [await _clock(session)]
    endpoint = driver_endpoint(robot.settings["driver"])
    if endpoint is not None:
        host, port = endpoint
        fault = await session.ask("reach", host=host, port=port, timeout_s=REACH_S)
        if fault:
            cure = "is it switched on, and driver.address right?"
            raise HostFailed(f"the driver's address {host}:{port} does not answer from there: {fault}", cure)
        notes.append(f"{host}:{port} answers")
    if not await session.ask("lingers"):
        notes.append("linger is off: start switches it on")
    return notes


async def _clock(session: HostSession) -> str:
    ahead_ns, within_ns = await session.clock_ahead_ns(WallClock())
    told = f"clock {ahead_ns / NS_PER_MS:+.0f} ms (within {within_ns / NS_PER_MS:.0f})"
    if abs(ahead_ns) - within_ns > MAX_AHEAD_NS:
        return f"{told}: latencies will be wrong by that, run NTP on it (timedatectl set-ntp true)"
    return told
