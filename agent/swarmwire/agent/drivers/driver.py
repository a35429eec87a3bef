"""The interface of drivers: one robot's sensors and motors behind the robot's own protocol.

Installed drivers are found by entry points of the group `swarmwire.drivers` and imported when one is used.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, ClassVar

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.config import NoParameters, bounds_of
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.plugins import installed_class, installed_points
from swarmwire.comms.robot.bodies.body import Body

GROUP = "swarmwire.drivers"  # group of entry points


class DriverLost(SwarmwireError):
    """The robot does not answer, or violates its protocol; `Driver.open` may reconnect it."""


class MotorsOff(DriverLost):
    """The robot answers, with its motors off until a person has switched it on again."""


@dataclass(frozen=True, slots=True)
class Command:
    """The command for one robot, within its limits."""

    linear_mps: float = 0.0
    angular_radps: float = 0.0  # positive to the left
    lateral_mps: float = 0.0  # positive to the left; holonomic bodies only
    leds: Mapping[int, int] = field(default_factory=dict[int, int])  # LED -> 0xRRGGBB; only LEDs that change


STOP = Command()


class Driver(ABC):
    """One robot. `open`, `sense`, `act` and `close` are called from one thread, `stop` from any.

    Attributes:
        options: the class of the driver's options, a frozen dataclass of `parameter`s.
        body_name: the robot's body, unless its settings name another.
        robot: the robot's name in its swarm; set before `open`.
    """

    options: ClassVar[type] = NoParameters
    body_name: ClassVar[str]
    robot: str = ""

    def __init__(self, address: str, body: Body, options: Any, clock: DatedClock) -> None:
        """Check the parameters without connecting; BadInput for a malformed address, or a body that does not fit."""
        self.address, self.body, self.options_given, self.clock = address, body, options, clock

    @property
    def target(self) -> str:
        """Unique text for the robot among those of this driver, by which two agents never drive the same robot."""
        return self.address

    @property
    def device(self) -> str:
        """The device of this machine that the driver needs exclusively, such as a radio on USB; empty: none."""
        return ""

    @property
    @abstractmethod
    def measures(self) -> frozenset[str]:
        """The sensors of the body that the driver can read, by their names in specs and `needs`."""

    @abstractmethod
    def open(self) -> None:
        """Connect, or reconnect, with the motors at rest; DriverLost if the robot does not answer in time."""

    @abstractmethod
    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        """Return the newest readings of these sensors, (1,) or (1, width), by "sensor.field" (`GroupReadings.fields`).

        The call takes at most about a tenth of a second; DriverLost if the robot has been silent for too long.
        """

    @abstractmethod
    def act(self, command: Command) -> None:
        """Send a command; DriverLost if that fails. The robot executes it until the next one."""

    @abstractmethod
    def stop(self) -> None:
        """Switch the motors off at once; do nothing without a connection. DriverLost is the only error."""

    def emergency_stop(self) -> None:
        """Switch the motors off at once and permanently, even if the robot falls; by default calls `stop`."""
        self.stop()

    @abstractmethod
    def counts(self) -> dict[str, int]:
        """Return the numbers of faults so far, by name: garbage, reconnections, timeouts."""

    @abstractmethod
    def close(self) -> None:
        """Switch the motors off, if the robot is reachable, and close the connection; safe to call more than once."""


def driver_names() -> list[str]:
    """Return the names of all installed drivers."""
    return list(installed_points(GROUP))


def load_driver(name: str, where: str, key: str) -> type[Driver]:
    """Load the driver class of this name; BadInput at `where` and `key` if `installed_class` refuses it."""
    return installed_class(GROUP, name, Driver, "driver", where, key)


def list_drivers() -> list[str]:
    """Describe each installed driver in lines: name, body and options, or the reason why it cannot be loaded."""
    lines: list[str] = []
    for name in driver_names():
        try:
            kind = load_driver(name, "", "")
        except BadInput as error:
            lines.append(f"{name}: {error.expected}")
            continue
        summary = (kind.__doc__ or "").strip().partition("\n")[0]
        lines.append(f"{name}: {summary} Body: {kind.body_name}")
        lines += [f"  {option_text(option)}" for option in fields(kind.options)]
    return lines or ["no drivers are installed"]


def option_text(option: "Field[Any]") -> str:
    """Describe an option in one line: name, default, unit and meaning."""
    limits = bounds_of(option)
    value = (
        "must be given"
        if option.default is MISSING
        else f"{option.default!r}{f' {limits.unit}' if limits.unit else ''}"
    )
    return f"{option.name} ({value}): {limits.help}"
