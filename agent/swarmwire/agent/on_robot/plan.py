"""Whether an agent finds what it needs on its robot: on the body, from driver, radio and tracker."""

import hashlib
import inspect
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.drivers.driver import Command, Driver, load_driver
from swarmwire.agent.on_robot.settings import RobotSettings
from swarmwire.agent.parameters import BadParameter, checked
from swarmwire.comms.assignment import params_of
from swarmwire.comms.bodies.body import Body, body_from, load_body
from swarmwire.comms.bodies.drives import Wheels
from swarmwire.comms.bodies.tables import built
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.config import read_toml
from swarmwire.comms.errors import BadInput

OF_TRACKER = ("positioning", "compass")  # senses that poses of a tracker stand in for
OF_POSES = ("radio.range", "radio.bearing")  # what poses add to a real radio


@dataclass(frozen=True)
class Capabilities:
    """What there is on a robot."""

    body: Body
    driver: str  # its name
    driver_gives: AbstractSet[str]
    radio: str  # its kind
    radio_gives: AbstractSet[str]
    tracker: bool


def check_needs(agent: str, needs: tuple[str, ...], offer: Capabilities, where: str) -> None:
    """BadInput at `agent` in `where` for the first need that is not met: which, and what would give it."""
    for need in needs:
        fault = _of_radio(need, offer) if need.startswith("radio.") else _of_robot(need, offer)
        if fault:
            raise BadInput(where, "agent", f"{agent} needs {need!r}, which {fault}")


def tracked(needs: tuple[str, ...], offer: Capabilities) -> frozenset[str]:
    """The senses that the tracker gives: those of the body that the driver does not."""
    if not offer.tracker:
        return frozenset()
    return frozenset(need for need in needs if need in OF_TRACKER and need not in offer.driver_gives)


def _of_robot(need: str, offer: Capabilities) -> str | None:
    body = offer.body
    if need not in body.sensors:
        return f"the body {body.name} lacks: it has {', '.join(body.sensors) or 'no sensors'}"
    if need in offer.driver_gives or need in tracked((need,), offer):
        return None
    measures = ", ".join(sorted(offer.driver_gives)) or "nothing"
    cure = ": expected tracker = true" if need in OF_TRACKER else ""
    return f"the driver {offer.driver} does not give (it gives {measures}){cure}"


def _of_radio(need: str, offer: Capabilities) -> str | None:
    if need in offer.radio_gives:
        return None
    if offer.radio == "none":
        return 'only a radio tells: expected radio.kind "zenoh" or "world"'
    if need in OF_POSES and offer.radio == "zenoh":
        return "a real radio does not tell: expected tracker = true"
    measures = ", ".join(sorted(offer.radio_gives)) or "nothing of a packet"
    return f"the radio {offer.radio} does not tell: it tells {measures}"


# --- Speed limits of a robot, below what its hardware can do.


SHARE = 0.5  # of what the body can do, unless the settings say otherwise
FASTEST = 1e6  # in place of inf, so that a command keeps its direction


@dataclass(frozen=True)
class SpeedLimits:
    """How fast the robot may go: a command above is slowed down as a whole, so that its curve stays."""

    linear_mps: float  # in any direction of the plane
    angular_radps: float
    wheel_mps: float | None = None  # of each of two wheels, which drive and turn share
    wheel_base_m: float = 0.0

    def clipped(self, command: Command) -> Command:
        """The command within the limits, the same object if it is; its numbers may be infinite, but not nan."""
        linear, angular, lateral = (
            max(-FASTEST, min(FASTEST, speed))
            for speed in (command.linear_mps, command.angular_radps, command.lateral_mps)
        )
        excess = max(hypot(linear, lateral) / self.linear_mps, abs(angular) / self.angular_radps)
        if self.wheel_mps is not None:
            excess = max(excess, (abs(linear) + 0.5 * self.wheel_base_m * abs(angular)) / self.wheel_mps)
        if excess <= 1.0:
            return command
        return replace(
            command, linear_mps=linear / excess, angular_radps=angular / excess, lateral_mps=lateral / excess
        )


def limits_for(body: Body, max_linear_mps: float | None, max_angular_radps: float | None, where: str) -> SpeedLimits:
    """The limits that the settings in `where` ask for; BadInput where they are above the body's own."""
    linear = _limit(max_linear_mps, body.max_linear_mps, where, "max_linear_mps", f"m/s, which the {body.name} can do")
    turn = _limit(
        max_angular_radps, body.max_angular_radps, where, "max_angular_radps", f"rad/s, which the {body.name} can do"
    )
    if isinstance(body.drive, Wheels):
        return SpeedLimits(linear, turn, body.drive.max_wheel_mps, body.drive.wheel_base_m)
    return SpeedLimits(linear, turn)


def _limit(given: float | None, most: float, where: str, key: str, unit: str) -> float:
    if given is None:
        return SHARE * most
    if given > most:
        raise BadInput(where, key, f"expected at most {most:.4g} {unit}; got {given!r}")
    return given


# --- What the settings of a robot come to: agent, body, driver and limits, found and checked at the door.


@dataclass(frozen=True)
class RobotConfig:
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
    def offer(self) -> Capabilities:
        """What the agent finds; of the world's air, what it tells is known once it was joined."""
        settings = self.settings
        tells = OF_POSES if settings.radio.kind == "zenoh" and settings.tracker else ()
        return Capabilities(
            self.body,
            settings.driver.name,
            self.driver.measures,
            settings.radio.kind,
            frozenset(tells),
            settings.tracker,
        )

    def __str__(self) -> str:
        settings, limits = self.settings, self.limits
        at = f" at {settings.driver.address}" if settings.driver.address else ""
        return (
            f"{settings.agent.rpartition('/')[2]} on {self.body.name} by {settings.driver.name}{at}, "
            f"radio {settings.radio.kind}, {settings.rate_hz} Hz, "
            f"at most {limits.linear_mps:.3g} m/s and {limits.angular_radps:.3g} rad/s"
        )


def robot_config(settings: RobotSettings, where: str, clock: DatedClock) -> RobotConfig:
    """What the settings in `where` come to; BadInput names the first key that is wrong."""
    driver, body = driver_of(settings, where, clock)
    agent, params = _agent(settings, where)
    if settings.watchdog_s * settings.rate_hz <= 1.0:
        period_s = 1.0 / settings.rate_hz
        raise BadInput(where, "watchdog_s", f"expected more than a period of rate_hz, {period_s:g} s")
    limits = limits_for(body, settings.max_linear_mps, settings.max_angular_radps, where)
    plan = RobotConfig(settings, where, agent, params, body, driver, limits)
    needs = agent.needs
    if settings.radio.kind == "world":  # what the medium tells is known once it was joined
        needs = tuple(need for need in needs if not need.startswith("radio."))
    check_needs(agent.__name__, needs, plan.offer, where)
    if settings.network and settings.network.proves:
        from swarmwire.agent.on_robot.network_check import check_certificates  # ssl costs memory

        check_certificates(settings.network, where)
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
