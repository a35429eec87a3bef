"""What every gateway is: emulated robots of one group behind the protocol that real ones speak."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.config import NoParameters
from swarmwire.comms.plugins import installed_class, installed_points
from swarmwire.comms.tick_io import LedChanges


@dataclass(frozen=True, slots=True)
class Commands:
    """What foreign programs told the robots of a gateway since they were asked last, a row per robot of the group."""

    drive: BoolArray  # (n,) False: the last command holds
    linear_mps: FloatArray  # (n,)
    angular_radps: FloatArray  # (n,)
    lateral_mps: FloatArray  # (n,)
    leds: LedChanges  # rows are places in the group, 0 to n - 1


class Gateway(ABC):
    """Emulated robots of one group. The loop calls it, from one thread; what serves the programs runs beside it.

    Attributes:
        options: the class of the gateway's options, a frozen dataclass of `parameter`s.
        senses: the senses of a body that it can tell, by the names that sheets have for them.
        unsaid: senses that the emulated robot's own sheet has and it does not tell either: no difference.
    """

    options: ClassVar[type] = NoParameters
    sensors: ClassVar[frozenset[str]]
    unsaid: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        """`address` is where they answer, empty: of the gateway's choice; BadInput if it will not do, or the body."""
        self.names, self.body, self.address, self.options_given, self.clock = (
            tuple(names),
            body,
            address,
            options,
            clock,
        )

    def differences(self) -> tuple[str, ...]:
        """What to know of this body as the robot that the gateway emulates, in words; none: it is one.

        Senses that a tracker tells are no difference.
        """
        told = self.sensors | self.unsaid
        untold = [name for name, spec in self.body.sensors.items() if not (name in told or spec.is_global)]
        unmoved = [*self.body.actuators]
        return tuple(
            f"{words} {', '.join(names)}"
            for words, names in (("nobody is told its", untold), ("nobody moves its", unmoved))
            if names
        )

    @abstractmethod
    def open(self) -> tuple[str, ...]:
        """Answer from now on; returns each robot's address, as its driver takes it. BadInput if one is taken."""

    @abstractmethod
    def publish(self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray) -> None:
        """The newest readings: "sense.field" -> (n,) or (n, width); those of a dead robot (n,) are not to be told.

        A dead robot is silent: it answers nothing, and takes no command.
        """

    @abstractmethod
    def take(self) -> Commands:
        """The newest command of each robot, among those that came since the last call."""

    @abstractmethod
    def counts(self) -> dict[str, int]:
        """What programs sent that no robot takes, and what else went wrong, by name."""

    @abstractmethod
    def close(self) -> None:
        """Hang up and free the addresses; safe to call more than once."""


# --- Gateways by kind: entry points of the group `swarmwire.gateways`, of which one is imported where somebody asks.


GROUP = "swarmwire.gateways"  # of entry points


def gateway_names() -> list[str]:
    """The kinds of gateways that are installed."""
    return list(installed_points(GROUP))


def gateway_kind(name: str, where: str, key: str = "") -> type[Gateway]:
    """The gateway of this kind; BadInput at `where` and `key` as `installed_class`."""
    return installed_class(GROUP, name, Gateway, "gateway", where, key)
