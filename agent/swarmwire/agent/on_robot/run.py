"""Runs the agent of one robot, from its settings to its exit code; what is opened is closed, motors off first."""

import platform
import threading
from contextlib import ExitStack
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.on_robot import sd_notify
from swarmwire.agent.on_robot.end import End
from swarmwire.agent.on_robot.exit_codes import ENDED, FAILED, INTERRUPTED
from swarmwire.agent.on_robot.heartbeats import Heartbeats
from swarmwire.agent.on_robot.mind import Mind, group_of
from swarmwire.agent.on_robot.motors import OUT_OF_REACH, Motors
from swarmwire.agent.on_robot.needs import check_needs, tracked
from swarmwire.agent.on_robot.network_parts import network_parts
from swarmwire.agent.on_robot.onlookers import Onlookers
from swarmwire.agent.on_robot.plan import Plan, agent_sha256
from swarmwire.agent.on_robot.robot_lock import RobotLock
from swarmwire.agent.on_robot.robot_log import RobotLog, new_log
from swarmwire.agent.on_robot.robot_loop import RobotLoop, RobotParts
from swarmwire.agent.on_robot.senses import SensesOnRobot
from swarmwire.agent.on_robot.status_file import StatusFile, status_path
from swarmwire.agent.on_robot.stop_requests import stop_requests
from swarmwire.agent.on_robot.terminal import Terminal
from swarmwire.agent.on_robot.watchdog import Watchdog
from swarmwire.comms.clock import DatedClock, WallClock
from swarmwire.comms.errors import AgentFailed

LOG_FORMAT = 1  # of `robot.json`
NO_CALL = "no driver moves actuators of your own: what the agent tells them is counted, and does nothing"
ENDED_BY = {AgentFailed: "agent failed", DriverLost: "no driver"}
GUARD_GONE = "the guard is gone"


def run_robot(
    plan: Plan, clock: DatedClock, end: End, stamp: str, duration_s: float | None = None, pipe: int | None = None
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
    plan: Plan, clock: DatedClock, end: End, motors: Motors, stamp: str, duration_s: float | None, pipe: int | None
) -> int:
    """As `run_robot`, while no other process of this machine drives the robot."""
    settings, terminal = plan.settings, Terminal(plan.settings.name)
    terminal.begin(str(plan))
    log = new_log(Path(settings.log), settings.robots, settings.name, stamp, plan.where) if settings.log else None
    if log:
        log.begin(robot_facts(plan, clock))
    facts = {"format": LOG_FORMAT, "name": settings.name, "swarm": settings.swarm, "log": log and str(log.folder)}
    file = StatusFile(status_path(settings.log, settings.name))
    onlookers = Onlookers(clock, settings.pace, terminal, file, motors.control, facts, log)
    ended, cause = "error", None
    if plan.body.actuators:
        onlookers.say(f"{', '.join(plan.body.actuators)}: {NO_CALL}")
    try:
        with ExitStack() as closing:
            loop = _assembled(plan, clock, end, motors, onlookers, log, pipe, closing)
            onlookers.attach(loop.status)
            sd_notify.notify(sd_notify.READY)
            loop.run(duration_s)
            sd_notify.notify(sd_notify.STOPPING)
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
    plan: Plan,
    clock: DatedClock,
    end: End,
    motors: Motors,
    onlookers: Onlookers,
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
    if settings.radio.kind == "air":
        offer = replace(offer, radio_gives=network.radio.needs)
        check_needs(plan.agent.__name__, plan.agent.needs, offer, plan.where)
    group = group_of(settings.name, settings.index, settings.agent, plan.params, plan.body, settings.seed)
    gives = None if settings.radio.kind == "none" else network.radio.gives
    mind = Mind(group, settings.rate_hz, gives, plan.limits)
    needs = frozenset(need for need in plan.agent.needs if not need.startswith("radio."))
    senses = SensesOnRobot(plan.driver, needs, tracked(plan.agent.needs, offer), network.own_pose)
    parts = RobotParts(plan.driver, network.radio, mind, senses, motors, watchdog, clock)
    watchdog.start()  # before the driver, so that the guard is there when motors can move
    closing.callback(plan.driver.close)
    plan.driver.open()
    network.listen(motors.control)
    closing.callback(motors.stop)
    return RobotLoop(parts, settings.rate_hz, end, onlookers, network.counts)


def robot_facts(plan: Plan, clock: DatedClock) -> dict[str, Any]:
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
