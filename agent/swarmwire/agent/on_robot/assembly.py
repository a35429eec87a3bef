"""Assembles and runs one robot: from its resolved configuration to the exit code of its agent.

`network_parts` opens the robots' network: one session, shared by radio, tracker and control. `run_robot` acquires the
robot's lock, starts log, status file, watchdog and driver, runs the loop, and closes everything in reverse order,
motors first. The heartbeats begin before the driver opens, so that the guard runs before a motor can move, and the
watchdog's thread ends last, so that the guard also notices an agent that does not finish closing.
"""

import platform
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.on_robot import reporting
from swarmwire.agent.on_robot.controller import Controller, RobotSensors, group_of
from swarmwire.agent.on_robot.log import RobotLog, new_log
from swarmwire.agent.on_robot.loop import RobotLoop, RobotParts
from swarmwire.agent.on_robot.network_check import LivenessWatch
from swarmwire.agent.on_robot.plan import POSE_MEASUREMENTS, RobotConfig, agent_sha256, check_needs, tracked_sensors
from swarmwire.agent.on_robot.reporting import RobotObservers, StatusFile, Terminal, status_path
from swarmwire.agent.on_robot.robot_lock import RobotLock, stop_requests
from swarmwire.agent.on_robot.safety import OUT_OF_REACH, Control, Heartbeats, Motors, StopFlag, Watchdog
from swarmwire.agent.on_robot.settings import ENDED, FAILED, INTERRUPTED, RobotSettings
from swarmwire.agent.radios.radio import NoRadio, RadioLog, RobotRadio
from swarmwire.comms.base.clock import DatedClock, WallClock
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.wire.radio_bridge import Pose

if TYPE_CHECKING:
    import zenoh

    from swarmwire.agent.radios.tracker import Tracker
    from swarmwire.comms.wire.keys import SwarmKeys

Report = Callable[[str], None]  # prints a message for the user

LOG_FORMAT = 1  # format of `robot.json`
NO_ACTUATOR_DRIVER = "no driver supports custom actuators: their commands are counted and have no effect"
ENDED_BY = {AgentFailed: "agent failed", DriverLost: "no driver"}
GUARD_GONE = "the guard is gone"


def no_pose() -> Pose | None:
    """Return the pose of a robot without a tracker: None."""
    return None


@dataclass(frozen=True)
class NetworkParts:
    """The open parts of a robot on its network; the defaults are those of a robot without a network."""

    radio: RobotRadio = field(default_factory=NoRadio)
    own_pose: Callable[[], Pose | None] = no_pose
    check: Callable[[], None] = lambda: None  # once a second: report missing robots and poses
    counts: Callable[[], dict[str, int]] = dict  # unusable messages at tracker and control
    listen: Callable[[Control], None] = lambda _: None  # accept control requests from now on


def network_parts(
    plan: RobotConfig, clock: DatedClock, log: RadioLog | None, report: Report, closing: ExitStack
) -> NetworkParts:
    """Open radio, tracker and control of the settings; `closing` gets the callbacks that close them.

    BadInput if an endpoint is in use, no world with a radio medium answers, or that world lacks this robot.
    """
    settings = plan.settings
    network = settings.network
    if network is None:
        return NetworkParts()
    # Imported here: zenoh costs memory and time, and a robot without a network does not use it.
    from swarmwire.agent.radios.control import ControlPoint
    from swarmwire.comms.wire.access_control import access_of
    from swarmwire.comms.wire.keys import SwarmKeys
    from swarmwire.comms.wire.robot_network import open_swarm
    from swarmwire.comms.wire.sessions import close_session

    if network.warning:
        report(network.warning)
    keys, name = SwarmKeys(settings.swarm), settings.name
    session = open_swarm(network, access_of(network, keys, settings.robots, name))
    closing.callback(close_session, session)
    tracker = _open_tracker(settings, session, keys, closing)
    radio = _radio(plan, session, keys, tracker, clock, log, report)
    closing.callback(radio.close)
    radio.open()

    def own_pose() -> Pose | None:
        return tracker.pose(name, clock.utc_ns()) if tracker else None

    others, senders = _others(settings, radio)
    liveness = LivenessWatch(clock, report, others, senders, own_pose if tracker else None, settings.pace)
    control_points: list[ControlPoint] = []

    def listen(control: Control) -> None:
        point = ControlPoint(session, keys, name, control)
        closing.callback(point.close)
        point.open()
        control_points.append(point)

    def counts() -> dict[str, int]:
        merged = (tracker.counts() if tracker else {}) | liveness.counts()
        for point in control_points:
            merged |= point.counts()
        return merged

    return NetworkParts(radio, own_pose, liveness.check, counts, listen)


def _open_tracker(
    settings: RobotSettings, session: "zenoh.Session", keys: "SwarmKeys", closing: ExitStack
) -> "Tracker | None":
    """Subscribe to all robots' poses; with a world's radio, which measures range and bearing, to one robot's."""
    from swarmwire.agent.radios.tracker import Tracker

    if not settings.tracker:
        return None
    tracker = Tracker(session, keys, settings.robots if settings.radio.kind == "zenoh" else (settings.name,))
    closing.callback(tracker.close)
    tracker.open()
    return tracker


def _radio(
    plan: RobotConfig,
    session: "zenoh.Session",
    keys: "SwarmKeys",
    tracker: "Tracker | None",
    clock: DatedClock,
    log: RadioLog | None,
    report: Report,
) -> RobotRadio:
    """Create the radio of the settings, not open yet."""
    from swarmwire.agent.radios.world_radio import WorldRadio
    from swarmwire.agent.radios.zenoh_radio import ZenohRadio

    robots, name, radio = plan.settings.robots, plan.settings.name, plan.settings.radio
    if radio.kind == "zenoh":
        needs_pose = any(need in POSE_MEASUREMENTS for need in plan.agent.needs)
        return ZenohRadio(session, keys, robots, name, radio.max_payload_bytes, clock, tracker, needs_pose, log, report)
    return WorldRadio(session, keys, robots, name, clock, log) if radio.kind == "world" else NoRadio()


def _others(settings: RobotSettings, radio: RobotRadio) -> tuple[list[str], Callable[[], list[str]]]:
    """Return the other robots, and a call that lists the senders so far; without a ZenohRadio both are empty."""
    from swarmwire.agent.radios.zenoh_radio import ZenohRadio

    if not isinstance(radio, ZenohRadio):
        return [], list
    others = [robot for robot in settings.robots if robot != settings.name]
    return others, lambda: [settings.robots[sender] for sender in list(radio.senders)]


def run_robot(
    plan: RobotConfig,
    clock: DatedClock,
    end: StopFlag,
    stamp: str,
    duration_s: float | None = None,
    pipe: int | None = None,
) -> int:
    """Run the agent of one robot to its end; return the exit code.

    In the main thread the process holds the robot's lock: no other process of this machine drives the robot, and others
    can request an emergency stop. `stamp` names the log's folder; heartbeats go into the `pipe` to the guard, if any.
    AgentFailed, DriverLost or BadInput is raised after everything is closed.
    """
    start = _Start(plan, clock, end, Motors(plan.driver), pipe)
    with ExitStack() as locked:
        if threading.current_thread() is threading.main_thread():  # only the main thread can handle signals
            lock = RobotLock(plan.settings.driver.name, plan.driver, WallClock())
            locked.enter_context(stop_requests(start.motors.control.estop, lock.write_result))
            locked.enter_context(lock.acquire(plan.where))
        return _run_locked(start, stamp, duration_s)


@dataclass(frozen=True)
class _Start:
    """The parts of a run that exist before its loop."""

    plan: RobotConfig
    clock: DatedClock
    end: StopFlag
    motors: Motors
    pipe: int | None  # the guard's pipe for heartbeats; None: no guard


def _run_locked(start: _Start, stamp: str, duration_s: float | None) -> int:
    """Run the robot with its log and observers, under the robot's lock; return the exit code."""
    plan, clock, end, motors = start.plan, start.clock, start.end, start.motors
    settings, terminal = plan.settings, Terminal(plan.settings.name)
    terminal.begin(str(plan))
    log = new_log(Path(settings.log), settings.robots, settings.name, stamp, plan.where) if settings.log else None
    if log:
        log.begin(robot_facts(plan, clock))
    facts = {"format": LOG_FORMAT, "name": settings.name, "swarm": settings.swarm, "log": log and str(log.folder)}
    file = StatusFile(status_path(settings.log, settings.name))
    observers = RobotObservers(clock, settings.pace, terminal, file, motors.control, facts, log)
    ended, cause = "error", None
    if plan.body.actuators:
        observers.report(f"{', '.join(plan.body.actuators)}: {NO_ACTUATOR_DRIVER}")
    try:
        with ExitStack() as closing:
            loop = _assemble(start, observers, log, closing)
            observers.attach(loop.status)
            reporting.notify(reporting.READY)
            loop.run(duration_s)
            reporting.notify(reporting.STOPPING)
        ended = end.reason or ended
    except BaseException as error:
        ended = next((text for kind, text in ENDED_BY.items() if isinstance(error, kind)), ended)
        cause = _cause(error)
        raise
    finally:
        if not motors.reachable:
            observers.report(OUT_OF_REACH)
        observers.end(ended, "" if ended == GUARD_GONE else cause)
    if not motors.reachable:
        return FAILED
    return INTERRUPTED if ended == "SIGINT" else FAILED if ended == GUARD_GONE else ENDED


def _cause(error: BaseException) -> str:
    """Return the error in one line: for an agent, the last line of its traceback without the note of its time."""
    lines = str(error).splitlines() or [type(error).__name__]
    notes = ("in tick ", " ") if isinstance(error, AgentFailed) else ()
    return next((line for line in reversed(lines) if not line.startswith(notes)), lines[-1])


def _assemble(start: _Start, observers: RobotObservers, log: RobotLog | None, closing: ExitStack) -> RobotLoop:
    """Connect the robot, its motors at rest, and return its loop; `closing` closes its parts, motors first."""
    plan, clock, end, motors = start.plan, start.clock, start.end, start.motors
    settings = plan.settings
    beat = Heartbeats(start.pipe, lambda: motors.control.stopped, lambda: end.request(GUARD_GONE))
    watchdog = Watchdog(settings.watchdog_s, motors.stop, clock, settings.pace, beat, observers.report_silence)
    closing.callback(watchdog.end)  # called last: the guard notices an agent that does not finish closing
    network = network_parts(plan, clock, log, observers.report, closing)
    observers.check_network = network.check
    capabilities = plan.capabilities
    if settings.radio.kind == "world":
        capabilities = replace(capabilities, radio_measures=network.radio.needs)
        check_needs(plan.agent.__name__, plan.agent.needs, capabilities, plan.where)
    group = group_of(settings.name, settings.index, settings.agent, plan.params, plan.body, settings.seed)
    measures = None if settings.radio.kind == "none" else network.radio.measures
    controller = Controller(group, settings.rate_hz, measures, plan.limits)
    needs = frozenset(need for need in plan.agent.needs if not need.startswith("radio."))
    sensors = RobotSensors(plan.driver, needs, tracked_sensors(plan.agent.needs, capabilities), network.own_pose)
    parts = RobotParts(plan.driver, network.radio, controller, sensors, motors, watchdog, clock)
    watchdog.start()  # before the driver, so that the guard runs before a motor can move
    closing.callback(plan.driver.close)
    plan.driver.open()
    network.listen(motors.control)
    closing.callback(motors.stop)
    return RobotLoop(parts, settings.rate_hz, end, observers, network.counts)


def robot_facts(plan: RobotConfig, clock: DatedClock) -> dict[str, Any]:
    """Return the contents of `robot.json`."""
    settings, limits = plan.settings, plan.limits
    return {
        "format": LOG_FORMAT,
        "name": settings.name,
        "index": settings.index,
        "swarm": settings.swarm,
        "robots": list(settings.robots),
        "agent": settings.agent,
        "agent_sha256": agent_sha256(plan.agent),
        "params": plan.params,
        "body": plan.body.as_mapping(),
        "driver": asdict(settings.driver),
        "radio": asdict(settings.radio),
        "rate_hz": settings.rate_hz,
        "watchdog_s": settings.watchdog_s,
        "limits": {"max_linear_mps": limits.linear_mps, "max_angular_radps": limits.angular_radps},
        "started_utc_ns": clock.utc_ns(),
        "versions": {
            "swarmwire-agent": version("swarmwire-agent"),
            "python": platform.python_version(),
            "numpy": version("numpy"),
            "eclipse-zenoh": version("eclipse-zenoh"),
        },
    }
