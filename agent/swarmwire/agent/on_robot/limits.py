"""Speed limits of a robot, below what its hardware can do."""

from dataclasses import dataclass, replace
from math import hypot

from swarmwire.agent.drivers.driver import Command
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Wheels
from swarmwire.comms.errors import BadInput

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
