"""The robot's side of the robots' network: one session, which radio, tracker and control share."""

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
from swarmwire.agent.on_robot.plan import OF_POSES, RobotConfig, agent_sha256, check_needs, tracked
from swarmwire.agent.on_robot.reporting import RobotObservers, StatusFile, Terminal, status_path
from swarmwire.agent.on_robot.robot_lock import RobotLock, stop_requests
from swarmwire.agent.on_robot.safety import OUT_OF_REACH, Control, Heartbeats, Motors, StopFlag, Watchdog
from swarmwire.agent.on_robot.settings import ENDED, FAILED, INTERRUPTED, RobotSettings
from swarmwire.agent.radios.radio import NoRadio, RadioLog, RobotRadio
from swarmwire.comms.clock import DatedClock, WallClock
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.wire.radio_bridge import Pose

if TYPE_CHECKING:
    import zenoh

    from swarmwire.agent.radios.tracker import Tracker
    from swarmwire.comms.wire.robot_network import SwarmKeys

Say = Callable[[str], None]


def nowhere() -> Pose | None:
    """Where a robot without a tracker is."""
    return None


@dataclass(frozen=True)
class NetworkParts:
    """What of a robot stands on its network, open; of a robot without one nobody hears, sees or asks."""

    radio: RobotRadio = field(default_factory=NoRadio)
    own_pose: Callable[[], Pose | None] = nowhere
    look: Callable[[], None] = lambda: None  # once a second: tell whether others are received, and poses come
    counts: Callable[[], dict[str, int]] = dict  # what came to tracker and control and was of no use
    listen: Callable[[Control], None] = lambda _: None  # let the robot be controlled from now on


def network_parts(
    plan: RobotConfig, clock: DatedClock, log: RadioLog | None, say: Say, closing: ExitStack
) -> NetworkParts:
    """Radio, tracker and control as the settings say; `closing` is given what is to be closed at the end.

    BadInput if an endpoint is taken, or there is no world whose air is to be joined, or it has not this robot.
    """
    settings = plan.settings
    network = settings.network
    if network is None:
        return NetworkParts()
    # zenoh costs memory and time, and is of no use to a robot by itself.
    from swarmwire.agent.radios.control import ControlPoint
    from swarmwire.comms.wire.access_control import access_of
    from swarmwire.comms.wire.robot_network import SwarmKeys, open_swarm
    from swarmwire.comms.wire.sessions import close_session

    if network.warning:
        say(network.warning)
    keys, own = SwarmKeys(settings.swarm), settings.name
    session = open_swarm(network, access_of(network, keys, settings.robots, own))
    closing.callback(close_session, session)
    tracker = _opened_tracker(settings, session, keys, closing)
    radio = _made_radio(plan, session, keys, tracker, clock, log, say)
    closing.callback(radio.close)
    radio.open()

    def own_pose() -> Pose | None:
        return tracker.pose(own, clock.utc_ns()) if tracker else None

    presence = LivenessWatch(clock, say, *_others(settings, radio), own_pose if tracker else None, settings.pace)
    points: list[ControlPoint] = []

    def listen(control: Control) -> None:
        point = ControlPoint(session, keys, own, control)
        closing.callback(point.close)
        point.open()
        points.append(point)

    def counts() -> dict[str, int]:
        of_tracker = tracker.counts() if tracker else {}
        of_points = {name: count for point in points for name, count in point.counts().items()}
        return of_tracker | presence.counts() | of_points

    return NetworkParts(radio, own_pose, presence.look, counts, listen)


def _opened_tracker(
    settings: RobotSettings, session: "zenoh.Session", keys: "SwarmKeys", closing: ExitStack
) -> "Tracker | None":
    """Poses of all robots, or only its own: the medium of a world tells range and bearing itself."""
    from swarmwire.agent.radios.tracker import Tracker

    if not settings.tracker:
        return None
    tracker = Tracker(session, keys, settings.robots if settings.radio.kind == "zenoh" else (settings.name,))
    closing.callback(tracker.close)
    tracker.open()
    return tracker


def _made_radio(
    plan: RobotConfig,
    session: "zenoh.Session",
    keys: "SwarmKeys",
    tracker: "Tracker | None",
    clock: DatedClock,
    log: RadioLog | None,
    say: Say,
) -> RobotRadio:
    """The radio of this kind, not open yet."""
    from swarmwire.agent.radios.world_radio import WorldRadio
    from swarmwire.agent.radios.zenoh_radio import ZenohRadio

    robots, own, radio = plan.settings.robots, plan.settings.name, plan.settings.radio
    if radio.kind == "zenoh":
        asks_pose = any(need in OF_POSES for need in plan.agent.needs)
        return ZenohRadio(session, keys, robots, own, radio.max_payload_bytes, clock, tracker, asks_pose, log, say)
    return WorldRadio(session, keys, robots, own, clock, log) if radio.kind == "world" else NoRadio()


def _others(settings: RobotSettings, radio: RobotRadio) -> tuple[list[str], Callable[[], list[str]]]:
    """Whom the robot is to hear, and what tells whom it has received so far: known of the robots' own network alone."""
    from swarmwire.agent.radios.zenoh_radio import ZenohRadio

    if not isinstance(radio, ZenohRadio):
        return [], list
    others = [robot for robot in settings.robots if robot != settings.name]
    return others, lambda: [settings.robots[sender] for sender in list(radio.links)]


# --- Runs the agent of one robot, from its settings to its exit code; what is opened is closed, motors off first.


LOG_FORMAT = 1  # of `robot.json`
NO_CALL = "no driver moves actuators of your own: what the agent tells them is counted, and does nothing"
ENDED_BY = {AgentFailed: "agent failed", DriverLost: "no driver"}
GUARD_GONE = "the guard is gone"


def run_robot(
    plan: RobotConfig,
    clock: DatedClock,
    end: StopFlag,
    stamp: str,
    duration_s: float | None = None,
    pipe: int | None = None,
) -> int:
    """The exit code of one robot's agent, which ran until something ended it.

    In the main thread, it is the only process of this machine that may drive the robot, and others may ask it to stop
    that for good. `stamp` names the log's folder; heartbeats go into the `pipe`, if there is a guard. AgentFailed,
    DriverLost or BadInput comes after everything is closed.
    """
    motors = Motors(plan.driver)
    with ExitStack() as alone:
        if threading.current_thread() is threading.main_thread():  # where signals come in
            lock = RobotLock(plan.settings.driver.name, plan.driver, WallClock())
            alone.enter_context(stop_requests(motors.control.estop, lock.tell))
            alone.enter_context(lock.held(plan.where))
        return _run_alone(plan, clock, end, motors, stamp, duration_s, pipe)


def _run_alone(
    plan: RobotConfig,
    clock: DatedClock,
    end: StopFlag,
    motors: Motors,
    stamp: str,
    duration_s: float | None,
    pipe: int | None,
) -> int:
    """As `run_robot`, while no other process of this machine drives the robot."""
    settings, terminal = plan.settings, Terminal(plan.settings.name)
    terminal.begin(str(plan))
    log = new_log(Path(settings.log), settings.robots, settings.name, stamp, plan.where) if settings.log else None
    if log:
        log.begin(robot_facts(plan, clock))
    facts = {"format": LOG_FORMAT, "name": settings.name, "swarm": settings.swarm, "log": log and str(log.folder)}
    file = StatusFile(status_path(settings.log, settings.name))
    onlookers = RobotObservers(clock, settings.pace, terminal, file, motors.control, facts, log)
    ended, cause = "error", None
    if plan.body.actuators:
        onlookers.say(f"{', '.join(plan.body.actuators)}: {NO_CALL}")
    try:
        with ExitStack() as closing:
            loop = _assembled(plan, clock, end, motors, onlookers, log, pipe, closing)
            onlookers.attach(loop.status)
            reporting.notify(reporting.READY)
            loop.run(duration_s)
            reporting.notify(reporting.STOPPING)
        ended = end.reason or ended
    except BaseException as error:
        ended = next((told for kind, told in ENDED_BY.items() if isinstance(error, kind)), ended)
        cause = _cause(error)
        raise
    finally:
        if not motors.reachable:
            onlookers.say(OUT_OF_REACH)
        onlookers.end(ended, "" if ended == GUARD_GONE else cause)
    if not motors.reachable:
        return FAILED
    return INTERRUPTED if ended == "SIGINT" else FAILED if ended == GUARD_GONE else ENDED


def _cause(error: BaseException) -> str:
    """What was raised, in a line: of an agent, the last one of its traceback, less the note of when it was."""
    lines = str(error).splitlines() or [type(error).__name__]
    notes = ("in tick ", " ") if isinstance(error, AgentFailed) else ()
    return next((line for line in reversed(lines) if not line.startswith(notes)), lines[-1])


def _assembled(
    plan: RobotConfig,
    clock: DatedClock,
    end: StopFlag,
    motors: Motors,
    onlookers: RobotObservers,
    log: RobotLog | None,
    pipe: int | None,
    closing: ExitStack,
) -> RobotLoop:
    """The loop of a robot that is connected, its motors at rest; `closing` gets what is to be closed, motors first."""
    settings = plan.settings
    beat = Heartbeats(pipe, lambda: motors.control.stopped, lambda: end.ask(GUARD_GONE))
    watchdog = Watchdog(settings.watchdog_s, motors.stop, clock, settings.pace, beat, onlookers.silent)
    closing.callback(watchdog.end)  # the last of all: the guard hears of an agent that takes its time to close
    network = network_parts(plan, clock, log, onlookers.say, closing)
    onlookers.look = network.look
    offer = plan.offer
    if settings.radio.kind == "world":
        offer = replace(offer, radio_gives=network.radio.needs)
        check_needs(plan.agent.__name__, plan.agent.needs, offer, plan.where)
    group = group_of(settings.name, settings.index, settings.agent, plan.params, plan.body, settings.seed)
    measures = None if settings.radio.kind == "none" else network.radio.measures
    mind = Controller(group, settings.rate_hz, measures, plan.limits)
    needs = frozenset(need for need in plan.agent.needs if not need.startswith("radio."))
    sensors = RobotSensors(plan.driver, needs, tracked(plan.agent.needs, offer), network.own_pose)
    parts = RobotParts(plan.driver, network.radio, mind, sensors, motors, watchdog, clock)
    watchdog.start()  # before the driver, so that the guard is there when motors can move
    closing.callback(plan.driver.close)
    plan.driver.open()
    network.listen(motors.control)
    closing.callback(motors.stop)
    return RobotLoop(parts, settings.rate_hz, end, onlookers, network.counts)


def robot_facts(plan: RobotConfig, clock: DatedClock) -> dict[str, Any]:
    """What `robot.json` says of a robot."""
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
