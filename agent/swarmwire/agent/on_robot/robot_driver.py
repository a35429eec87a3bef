"""The driver of one robot and its body, by its settings. Light to import: `stop-motors` waits for it."""

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
    """The driver, not yet connected, and the body that it drives; BadInput names the wrong key."""
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
    """The driver without options, and without a body, that do not fit; BadInput if it cannot reach the robot so."""
    kind = load_driver(settings.driver.name, where, "driver.name")
    options, default_body = _fitting(kind.options, settings.driver.options, where), load_body(kind.body_name)
    try:
        driver = kind(
            settings.driver.address, _body(settings.body, where) if settings.body else default_body, options, clock
        )
    except BadInput:  # which may concern the body, or options that contradict each other
        driver = kind(settings.driver.address, default_body, parse_table(kind.options, {}, where, "driver"), clock)
    driver.robot = settings.name
    return driver


def _fitting(kind: type, options: dict[str, Any], where: str) -> Any:
    """The options less those that do not fit, which have their defaults; BadInput if one must be given."""
    fitting = dict(options)
    while True:
        try:
            return parse_table(kind, fitting, where, "driver")
        except BadInput as error:
            name = re.split(r"[.\[]", error.key.removeprefix("driver."))[0]
            if name not in fitting:
                raise
            del fitting[name]


def _body(name: str, where: str) -> Body:
    if not name.endswith(".toml"):
        try:
            return load_body(name)
        except BadInput as error:
            raise BadInput(where, "body", error.expected) from None
    path = Path(name)
    return body_from(read_toml(path, (where, "body")), str(path), path.parent)
