"""The driver and body of one robot from its settings. Imports little, since `stop-motors` waits for it."""

import re
from pathlib import Path
from typing import Any

from swarmwire.agent.drivers.driver import Driver, load_driver
from swarmwire.agent.on_robot.settings import RobotSettings
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.config import read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import Body, body_from, load_body
from swarmwire.comms.robot.bodies.tables import parse_table


def driver_of(settings: RobotSettings, where: str, clock: DatedClock) -> tuple[Driver, Body]:
    """Return the driver, not yet connected, and its body; BadInput names the wrong key."""
    kind = load_driver(settings.driver.name, where, "driver.name")
    options = parse_table(kind.options, settings.driver.options, where, "driver")
    body = _body(settings.body, where) if settings.body else load_body(kind.body_name)
    try:
        driver = kind(settings.driver.address, body, options, clock)
    except BadInput as error:
        raise BadInput(where, ".".join(filter(None, ("driver", error.key))), error.expected) from error
    driver.robot = settings.name
    return driver, body


def driver_for_stop(settings: RobotSettings, where: str, clock: DatedClock) -> Driver:
    """Return the driver of a robot to be stopped: invalid options and an invalid body become the defaults.

    BadInput if the driver cannot reach the robot without them.
    """
    kind = load_driver(settings.driver.name, where, "driver.name")
    options, default_body = _valid_options(kind.options, settings.driver.options, where), load_body(kind.body_name)
    try:
        driver = kind(
            settings.driver.address, _body(settings.body, where) if settings.body else default_body, options, clock
        )
    except BadInput:  # an unsuitable body, or options that contradict each other
        driver = kind(settings.driver.address, default_body, parse_table(kind.options, {}, where, "driver"), clock)
    driver.robot = settings.name
    return driver


def _valid_options(kind: type, options: dict[str, Any], where: str) -> Any:
    """Return the options, invalid ones with their defaults; BadInput if an option without default is invalid."""
    valid = dict(options)
    while True:
        try:
            return parse_table(kind, valid, where, "driver")
        except BadInput as error:
            name = re.split(r"[.\[]", error.key.removeprefix("driver."))[0]
            if name not in valid:
                raise
            del valid[name]


def _body(name: str, where: str) -> Body:
    if not name.endswith(".toml"):
        try:
            return load_body(name)
        except BadInput as error:
            raise BadInput(where, "body", error.expected) from None
    path = Path(name)
    return body_from(read_toml(path, (where, "body")), str(path), path.parent)
