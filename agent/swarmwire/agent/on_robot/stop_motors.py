"""`swarmwire-agent stop-motors`: switch the motors of one robot off, despite any other fault.

Wrong keys that a stop does not need, and a lock that is not usable, do not delay the stop: the fault is reported
afterwards. An agent that drives the robot stops it permanently; if none answers, this process connects.
"""

import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarmwire.agent.drivers.driver import Driver, MotorsOff
from swarmwire.agent.on_robot.robot_driver import driver_for_stop, driver_of
from swarmwire.agent.on_robot.robot_lock import RobotLock
from swarmwire.agent.on_robot.safety import SIGNALS
from swarmwire.agent.on_robot.settings import (
    AGENT,
    ENDED,
    FAILED,
    NO_FILE,
    DriverSettings,
    Flags,
    RobotSettings,
    read_settings,
)
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.partial_toml import Table, merge, read_fragments, table_in

NO_AGENT = "none:None"  # a stop needs no agent
Report = Callable[[SwarmwireError], None]


def stop_motors(file: Path | None, flags: Flags, report: Report, *, standby: bool) -> int:
    """Stop the robot of these settings, then `report` their faults; return the exit code, FAILED after a fault.

    With `standby`, for the guard: wait for its request, then stop the robot, whose agent is dead.
    BadInput if the settings name no robot, DriverLost if it cannot be reached.
    """
    name, driver, settings_fault = _driver(file, flags)
    if standby:
        if _is_requested():
            _stop(driver)
        return ENDED
    holder, lock_fault = _request_stop(name, driver)
    faults = [error for error in (settings_fault, lock_fault) if error is not None]
    try:
        if holder is None:
            _stop(driver)
    finally:
        for error in faults:
            report(error)
    detail = "" if holder is None else f" by process {holder}, which drives it; start its agent again to continue"
    sys.stdout.write(f"{driver.robot}: stopped{detail}\n")
    return FAILED if faults else ENDED


def _driver(file: Path | None, flags: Flags) -> tuple[str, Driver, BadInput | None]:
    """Return name and driver of the robot, not yet connected, and the first fault of the settings, if any."""
    where, clock = str(file) if file else NO_FILE, WallClock()
    try:
        settings = read_settings(file, {**flags, "agent": (AGENT, NO_AGENT)})
        return settings.driver.name, driver_of(settings, where, clock)[0], None
    except BadInput as error:
        settings = _settings_for_stop(file, flags)
        if settings is None:
            raise
        return settings.driver.name, driver_for_stop(settings, where, clock), error


def _settings_for_stop(file: Path | None, flags: Flags) -> RobotSettings | None:
    """Read the settings that a stop needs, without invalid ones; return None without the name of a driver."""
    table = Table()
    with suppress(BadInput):  # an unreadable file; the flags may be sufficient
        for fragment in read_fragments(file) if file else ():
            merge(table, fragment)
    driver: dict[str, Any] = {**table_in(table, "driver"), **_without_prefix("driver.", flags)}
    name, address = driver.pop("name", None), driver.pop("address", "")
    if not isinstance(name, str) or not isinstance(address, str):
        return None
    settings = RobotSettings(agent=NO_AGENT, driver=DriverSettings(name, address, driver))
    for key in ("name", "body"):
        value = flags[key][1] if key in flags else table.get(key)
        if isinstance(value, str):
            settings = replace(settings, **{key: value})
    return settings


def _without_prefix(prefix: str, flags: Flags) -> Mapping[str, Any]:
    """Return the values of the flags whose keys have a prefix, by the remaining key."""
    return {key.removeprefix(prefix): value for key, (_, value) in flags.items() if key.startswith(prefix)}


def _request_stop(name: str, driver: Driver) -> tuple[int | None, SwarmwireError | None]:
    """Request a stop; return the process that stopped the robot it drives, if any, and the fault of the request."""
    try:
        return RobotLock(name, driver, WallClock()).request_stop(), None
    except SwarmwireError as error:
        return None, error


def _stop(driver: Driver) -> None:
    try:
        with suppress(MotorsOff):
            driver.open()
            driver.emergency_stop()
    finally:
        driver.close()


def _is_requested() -> bool:
    """Wait for the guard; return True if it requests the stop. Signals to all processes do not end this one."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    return sys.stdin.buffer.read(1) != b""
