"""The resolved configuration of one robot: agent, body, driver and speed limits, loaded and checked.

`robot_config` turns settings into a `RobotConfig` before anything is connected; BadInput names the first wrong key.
`check_needs` compares the agent's `needs` with the capabilities of body, driver, radio and tracker. `SpeedLimits` clips
the agent's commands.
"""

import hashlib
import inspect
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.drivers.driver import Command, Driver
from swarmwire.agent.on_robot.robot_driver import driver_of
from swarmwire.agent.on_robot.settings import LOCAL_ENDPOINT, RobotSettings
from swarmwire.agent.parameters import BadParameter, checked_parameters
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Wheels, wheels_of_twist
from swarmwire.comms.wire.assignment import params_of

TRACKER_SENSORS = ("positioning", "compass")  # sensors that a tracker's poses can replace
POSE_MEASUREMENTS = ("radio.range", "radio.bearing")  # measurements that poses add to a real radio
DEFAULT_SPEED_SHARE = 0.5  # default limits as a share of the body's
MAX_COMMAND = 1e6  # replaces inf in commands, which keeps their direction


@dataclass(frozen=True)
class Capabilities:
    """The sensors and measurements of a robot."""

    body: Body
    driver: str  # name of the driver
    driver_measures: AbstractSet[str]
    radio: str  # kind of the radio
    radio_measures: AbstractSet[str]
    tracker: bool


def check_needs(agent: str, needs: tuple[str, ...], capabilities: Capabilities, where: str) -> None:
    """Raise BadInput at `agent` in `where` for the first unmet need, with the setting that would meet it."""
    for need in needs:
        fault = _radio_fault(need, capabilities) if need.startswith("radio.") else _robot_fault(need, capabilities)
        if fault:
            raise BadInput(where, "agent", f"{agent} needs {need!r}, which {fault}")


def tracked_sensors(needs: tuple[str, ...], capabilities: Capabilities) -> frozenset[str]:
    """Return the needs that the tracker meets: sensors of the body that the driver does not read."""
    if not capabilities.tracker:
        return frozenset()
    return frozenset(need for need in needs if need in TRACKER_SENSORS and need not in capabilities.driver_measures)


def _robot_fault(need: str, capabilities: Capabilities) -> str | None:
    body = capabilities.body
    if need not in body.sensors:
        return f"the body {body.name} lacks: it has {', '.join(body.sensors) or 'no sensors'}"
    if need in capabilities.driver_measures or need in tracked_sensors((need,), capabilities):
        return None
    measures = ", ".join(sorted(capabilities.driver_measures)) or "nothing"
    hint = ": expected tracker = true" if need in TRACKER_SENSORS else ""
    return f"the driver {capabilities.driver} does not give (it gives {measures}){hint}"


def _radio_fault(need: str, capabilities: Capabilities) -> str | None:
    if need in capabilities.radio_measures:
        return None
    if capabilities.radio == "none":
        with_poses = 'radio.kind "zenoh" with tracker = true, or ' if need in POSE_MEASUREMENTS else ""
        hint = f'for agents on this machine alone, listen = ["{LOCAL_ENDPOINT}"]'
        return f'needs a radio: expected {with_poses}radio.kind "world"; {hint}'
    if need in POSE_MEASUREMENTS and capabilities.radio == "zenoh":
        return "a real radio does not measure it: expected tracker = true"
    measures = ", ".join(sorted(capabilities.radio_measures)) or "nothing of a packet"
    return f"the radio {capabilities.radio} does not measure it: it measures {measures}"


@dataclass(frozen=True)
class SpeedLimits:
    """The robot's greatest speeds, at most those of its hardware.

    All speeds of a command above a limit are scaled by one factor, so that the robot stays on its curve.
    """

    linear_mps: float  # the limit in every direction of the plane
    angular_radps: float
    wheel_mps: float | None = None  # limit of each of two wheels, which driving and turning share; None: no limit
    wheel_base_m: float = 0.0

    def clipped(self, command: Command) -> Command:
        """Return the command within the limits, the same object if unchanged. Speeds may be infinite, but not nan."""
        linear, angular, lateral = (
            max(-MAX_COMMAND, min(MAX_COMMAND, speed))
            for speed in (command.linear_mps, command.angular_radps, command.lateral_mps)
        )
        excess = max(hypot(linear, lateral) / self.linear_mps, abs(angular) / self.angular_radps)
        if self.wheel_mps is not None:
            excess = max(excess, max(map(abs, wheels_of_twist(linear, angular, self.wheel_base_m))) / self.wheel_mps)
        if excess <= 1.0:
            return command
        return replace(
            command, linear_mps=linear / excess, angular_radps=angular / excess, lateral_mps=lateral / excess
        )


def limits_for(body: Body, max_linear_mps: float | None, max_angular_radps: float | None, where: str) -> SpeedLimits:
    """Return the limits of the settings in `where`; BadInput for a limit above the body's."""
    linear = _limit(max_linear_mps, body.max_linear_mps, where, "max_linear_mps", f"m/s, which the {body.name} can do")
    turn = _limit(
        max_angular_radps, body.max_angular_radps, where, "max_angular_radps", f"rad/s, which the {body.name} can do"
    )
    if isinstance(body.drive, Wheels):
        return SpeedLimits(linear, turn, body.drive.max_wheel_mps, body.drive.wheel_base_m)
    return SpeedLimits(linear, turn)


def _limit(limit: float | None, body_limit: float, where: str, key: str, unit: str) -> float:
    if limit is None:
        return DEFAULT_SPEED_SHARE * body_limit
    if limit > body_limit:
        raise BadInput(where, key, f"expected at most {body_limit:.4g} {unit}; got {limit!r}")
    return limit


@dataclass(frozen=True)
class RobotConfig:
    """One robot, ready to run; nothing is connected yet.

    Attributes:
        where: the file of the settings, for errors.
        params: the agent's parameters; from a list per robot, the value of this robot.
    """

    settings: RobotSettings
    where: str
    agent: AgentClass
    params: dict[str, Any]
    body: Body
    driver: Driver
    limits: SpeedLimits

    @property
    def capabilities(self) -> Capabilities:
        """The capabilities before the start; a world's radio medium has its own, known once the robot has joined."""
        settings = self.settings
        measures = POSE_MEASUREMENTS if settings.radio.kind == "zenoh" and settings.tracker else ()
        return Capabilities(
            self.body,
            settings.driver.name,
            self.driver.measures,
            settings.radio.kind,
            frozenset(measures),
            settings.tracker,
        )

    def __str__(self) -> str:
        settings, limits = self.settings, self.limits
        location = f" at {settings.driver.address}" if settings.driver.address else ""
        return (
            f"{settings.agent.rpartition('/')[2]} on {self.body.name} by {settings.driver.name}{location}, "
            f"radio {settings.radio.kind}, {settings.rate_hz} Hz, "
            f"at most {limits.linear_mps:.3g} m/s and {limits.angular_radps:.3g} rad/s"
        )


def robot_config(settings: RobotSettings, where: str, clock: DatedClock) -> RobotConfig:
    """Resolve the settings in `where`; BadInput names the first wrong key."""
    driver, body = driver_of(settings, where, clock)
    agent, params = _agent(settings, where)
    if settings.watchdog_s * settings.rate_hz <= 1.0:
        period_s = 1.0 / settings.rate_hz
        raise BadInput(where, "watchdog_s", f"expected more than a period of rate_hz, {period_s:g} s")
    limits = limits_for(body, settings.max_linear_mps, settings.max_angular_radps, where)
    plan = RobotConfig(settings, where, agent, params, body, driver, limits)
    needs = agent.needs
    if settings.radio.kind == "world":  # known once the robot has joined the medium
        needs = tuple(need for need in needs if not need.startswith("radio."))
    check_needs(agent.__name__, needs, plan.capabilities, where)
    if issubclass(agent, VectorAgent):
        try:
            agent.check_body(body)
        except ValueError as error:
            raise BadInput(where, "agent", str(error)) from error
    if settings.network and settings.network.proves:
        from swarmwire.agent.on_robot.network_check import check_certificates  # ssl costs memory

        check_certificates(settings.network, where)
    return plan


def agent_sha256(agent: AgentClass) -> str:
    """Return the sha256 of the agent's source file; empty if it has none."""
    file = inspect.getsourcefile(agent) if agent.__module__ != "builtins" else None
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else ""


def _agent(settings: RobotSettings, where: str) -> tuple[AgentClass, dict[str, Any]]:
    try:
        kind = load_agent(settings.agent)
        params = checked_parameters(kind, settings.params, len(settings.robots))
    except NoAgent as error:
        raise BadInput(where, "agent", str(error)) from error
    except BadParameter as error:
        raise BadInput(where, f"params.{error.key}", error.expected) from error
    robot_params = params_of(params, np.array([settings.index]))
    return kind, {name: value[0] if isinstance(value, list) else value for name, value in robot_params.items()}
