"""What the settings of a robot come to: agent, body, driver and limits, found and checked at the door."""

import hashlib
import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.agent.declared import BadParameter, checked
from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.loading import AgentClass, NoAgent, load_agent
from swarmwire.agent.on_robot.driver_registry import load_driver
from swarmwire.agent.on_robot.limits import SpeedLimits, limits_for
from swarmwire.agent.on_robot.needs import OF_POSES, Offer, check_needs
from swarmwire.agent.on_robot.settings import RobotSettings
from swarmwire.comms.assignment import params_of
from swarmwire.comms.bodies.body import Body, body_from, load_body
from swarmwire.comms.bodies.tables import built
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.config import read_toml
from swarmwire.comms.errors import BadInput


@dataclass(frozen=True)
class Plan:
    """One robot, ready to be run; nothing is connected.

    Attributes:
        where: the file of the settings, for errors.
        params: the agent's parameters; of lists with a value for each robot, this robot's.
    """

    settings: RobotSettings
    where: str
    agent: AgentClass
    params: dict[str, Any]
    body: Body
    driver: Driver
    limits: SpeedLimits

    @property
    def offer(self) -> Offer:
        """What the agent finds; of the world's air, what it tells is known once it was joined."""
        settings = self.settings
        tells = OF_POSES if settings.radio.kind == "zenoh" and settings.tracker else ()
        return Offer(
            self.body, settings.driver.name, self.driver.gives, settings.radio.kind, frozenset(tells), settings.tracker
        )

    def __str__(self) -> str:
        settings, limits = self.settings, self.limits
        at = f" at {settings.driver.address}" if settings.driver.address else ""
        return (
            f"{settings.agent.rpartition('/')[2]} on {self.body.name} by {settings.driver.name}{at}, "
            f"radio {settings.radio.kind}, {settings.rate_hz} Hz, "
            f"at most {limits.linear_mps:.3g} m/s and {limits.angular_radps:.3g} rad/s"
        )


def plan_of(settings: RobotSettings, where: str, clock: DatedClock) -> Plan:
    """What the settings in `where` come to; BadInput names the first key that is wrong."""
    driver, body = driver_of(settings, where, clock)
    agent, params = _agent(settings, where)
    if settings.watchdog_s * settings.rate_hz <= 1.0:
        period_s = 1.0 / settings.rate_hz
        raise BadInput(where, "watchdog_s", f"expected more than a period of rate_hz, {period_s:g} s")
    limits = limits_for(body, settings.max_linear_mps, settings.max_angular_radps, where)
    plan = Plan(settings, where, agent, params, body, driver, limits)
    needs = agent.needs
    if settings.radio.kind == "air":  # what the air tells is known once it was joined
        needs = tuple(need for need in needs if not need.startswith("radio."))
    check_needs(agent.__name__, needs, plan.offer, where)
    if settings.network and settings.network.proves:
        from swarmwire.agent.on_robot.proof import check_proof  # ssl costs memory

        check_proof(settings.network, where)
    return plan


def driver_of(settings: RobotSettings, where: str, clock: DatedClock) -> tuple[Driver, Body]:
    """The driver, not yet connected, and the body that it drives; BadInput names the key that is wrong."""
    kind = load_driver(settings.driver.name, where, "driver.name")
    options = built(kind.options, settings.driver.options, where, "driver")
    body = _body(settings.body, where) if settings.body else load_body(kind.body_name)
    try:
        driver = kind(settings.driver.address, body, options, clock)
    except BadInput as error:
        raise BadInput(where, ".".join(filter(None, ("driver", error.key))), error.expected) from error
    driver.robot = settings.name
    return driver, body


def agent_sha256(agent: AgentClass) -> str:
    """The digest of the file that the agent stands in; empty if it has none."""
    file = inspect.getsourcefile(agent) if agent.__module__ != "builtins" else None
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else ""


def _agent(settings: RobotSettings, where: str) -> tuple[AgentClass, dict[str, Any]]:
    try:
        kind = load_agent(settings.agent)
        params = checked(kind, settings.params, len(settings.robots))
    except NoAgent as error:
        raise BadInput(where, "agent", str(error)) from error
    except BadParameter as error:
        raise BadInput(where, f"params.{error.key}", error.expected) from error
    own = params_of(params, np.array([settings.index]))
    return kind, {name: value[0] if isinstance(value, list) else value for name, value in own.items()}


def _body(name: str, where: str) -> Body:
    if not name.endswith(".toml"):
        try:
            return load_body(name)
        except BadInput as error:
            raise BadInput(where, "body", error.expected) from None
    path = Path(name)
    return body_from(read_toml(path, (where, "body")), str(path), path.parent)
