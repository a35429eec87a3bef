"""What every driver is: one robot's senses and motors behind the protocol that the robot speaks."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, ClassVar

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.config import NoParameters, bounds_of
from swarmwire.comms.errors import BadInput, SwarmwireError
from swarmwire.comms.plugins import installed_class, installed_points


class DriverLost(SwarmwireError):
    """The robot does not answer, or no longer as its protocol says; `Driver.open` may bring it back."""


@dataclass(frozen=True, slots=True)
class Command:
    """What one robot is told to do, within its limits."""

    linear_mps: float = 0.0
    angular_radps: float = 0.0  # positive to the left
    lateral_mps: float = 0.0  # of holonomic bodies
    leds: Mapping[int, int] = field(default_factory=dict[int, int])  # which LED -> 0xRRGGBB; those switched now


STOP = Command()


class Driver(ABC):
    """One robot. `open`, `sense`, `act` and `close` are called from one thread, `stop` from any.

    Attributes:
        options: the class of the driver's options, a frozen dataclass of `parameter`s.
        body_name: the body that the robot is, unless its user names another.
        robot: its name in its swarm; set before `open` by whoever knows it.
    """

    options: ClassVar[type] = NoParameters
    body_name: ClassVar[str]
    robot: str = ""

    def __init__(self, address: str, body: Body, options: Any, clock: DatedClock) -> None:
        """Nothing is connected yet; BadInput if the address cannot be one of such a robot, or the body does not fit."""
        self.address, self.body, self.options_given, self.clock = address, body, options, clock

    @property
    def target(self) -> str:
        """What is driven, told apart from all others that are reached so: two agents must not drive the same."""
        return self.address

    @property
    @abstractmethod
    def measures(self) -> frozenset[str]:
        """The senses of the body that the robot can tell, by the names that sheets and `needs` have for them."""

    @abstractmethod
    def open(self) -> None:
        """Connect, anew if it was lost, with the motors at rest; DriverLost if nobody answers in time."""

    @abstractmethod
    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        """The newest readings of these senses: "sense.field" -> (1,) or (1, width), as in `GroupReadings.fields`.

        It returns within a tenth of a second, or so; DriverLost if the robot has been silent for too long.
        """

    @abstractmethod
    def act(self, command: Command) -> None:
        """Hand the command to the robot; DriverLost if it cannot be. The robot keeps to it until the next one."""

    @abstractmethod
    def stop(self) -> None:
        """Motors off at once; nothing happens, and nothing is raised but DriverLost, where there is no connection."""

    @abstractmethod
    def counts(self) -> dict[str, int]:
        """What went wrong on the way so far, by name: garbage, reconnections, time-outs."""

    @abstractmethod
    def close(self) -> None:
        """Motors off, if the robot can be reached, and the connection closed; safe to call more than once."""


# --- Drivers that are installed, by entry points of the group `swarmwire.drivers`; imported when one is asked for.


GROUP = "swarmwire.drivers"  # of entry points


def driver_names() -> list[str]:
    """The names of all drivers that are installed."""
    return list(installed_points(GROUP))


def load_driver(name: str, where: str, key: str) -> type[Driver]:
    """The driver of that name; BadInput at `where` and `key` as `installed_class`."""
    return installed_class(GROUP, name, Driver, "driver", where, key)


def list_drivers() -> list[str]:
    """Every driver in lines for people: its name, body and options, or why it cannot be used."""
    lines: list[str] = []
    for name in driver_names():
        try:
            kind = load_driver(name, "", "")
        except BadInput as error:
            lines.append(f"{name}: {error.expected}")
            continue
        told = (kind.__doc__ or "").strip().partition("\n")[0]
        lines.append(f"{name}: {told} Body: {kind.body_name}")
        lines += [f"  {option_text(of)}" for of in fields(kind.options)]
    return lines or ["no drivers are installed"]


def option_text(of: "Field[Any]") -> str:
    """An option in a line: its name, default, unit and meaning."""
    limits = bounds_of(of)
    value = "must be given" if of.default is MISSING else f"{of.default!r}{f' {limits.unit}' if limits.unit else ''}"
    return f"{of.name} ({value}): {limits.help}"
