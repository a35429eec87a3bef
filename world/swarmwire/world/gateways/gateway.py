"""The gateway interface: emulated robots of one group behind the protocol of real ones.

Gateways are entry points of the group `swarmwire.gateways`; `gateway_kind` imports one of them on demand.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.config import NoParameters
from swarmwire.comms.base.plugins import installed_class, installed_points
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.tick_io import NOTHING_SET, SparseTable
from swarmwire.world.sensors.sensor import Scene

GROUP = "swarmwire.gateways"  # group of entry points
FRESH: Mapping[str, int] = MappingProxyType({})  # ages if all readings are new


@dataclass(frozen=True, slots=True)
class ForeignCommands:
    """New commands of foreign programs to the robots of a gateway, one row per robot of the group."""

    drive: BoolArray  # (n,) False: the robot keeps its last command
    linear_mps: FloatArray  # (n,)
    angular_radps: FloatArray  # (n,)
    lateral_mps: FloatArray  # (n,)
    leds: SparseTable  # rows are indices in the group, 0 to n - 1
    motors: SparseTable = NOTHING_SET  # rows as in `leds`; for flying bodies, 1: motors on, 0: off (on the floor)


class Gateway(ABC):
    """Emulated robots of one group. The loop calls it from one thread; servers for programs run in other threads.

    Attributes:
        options: the class of the gateway's options, a frozen dataclass of `parameter`s.
        sensors: names of the sensors that it can publish.
        unpublished: names of the sensors that the real robot does not publish, either: no difference.
        separate: True if each robot has a separate network and server. Set before `open`.
    """

    options: ClassVar[type] = NoParameters
    sensors: ClassVar[frozenset[str]]
    unpublished: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        """Empty `address`: the gateway chooses one. BadInput if the address or the body does not fit."""
        self.names, self.body, self.address, self.clock = tuple(names), body, address, clock
        self.option_values = options
        self.separate = False

    def differences(self) -> tuple[str, ...]:
        """Describe the differences between this body and the emulated robot.

        Sensors that a tracker provides are no difference.
        """
        expected = self.sensors | self.unpublished
        missing = [name for name, spec in self.body.sensors.items() if not (name in expected or spec.is_global)]
        without_actuator = [*self.body.actuators]
        return tuple(
            f"{words} {', '.join(names)}"
            for words, names in (("no program receives its", missing), ("no program moves its", without_actuator))
            if names
        )

    def enter(self, scene: Scene, first: int) -> None:  # noqa: B027 - most gateways need readings alone
        """Set the present arena, and the index in it of the first robot; called once, before `open`."""

    @abstractmethod
    def open(self) -> tuple[str, ...]:
        """Start to answer, and return each robot's address for its driver; BadInput if an address is in use.

        An empty address means that the robot is elsewhere, and uses this run's radio alone.
        """

    def on_robot(self, address: str) -> str:
        """Return the address for programs on a robot with a separate network that reaches `address`."""
        return address

    @abstractmethod
    def publish(
        self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray, ages_ns: Mapping[str, int] = FRESH
    ) -> None:
        """Publish the newest readings, "sensor.field" -> (n,) or (n, width), except readings of dead robots.

        `ages_ns` is the time between a sensor's measurement and `time_ns`; the default is 0. A dead robot neither
        answers nor accepts commands.
        """

    @abstractmethod
    def pop_commands(self) -> ForeignCommands:
        """Remove and return the newest command of each robot."""

    @abstractmethod
    def counts(self) -> dict[str, int]:
        """Return the numbers of faults by name, such as input that no robot accepts."""

    @abstractmethod
    def close(self) -> None:
        """Close all connections and free the addresses; safe to call more than once."""


def gateway_names() -> list[str]:
    """Return the kinds of installed gateways."""
    return list(installed_points(GROUP))


def gateway_kind(name: str, where: str, key: str = "") -> type[Gateway]:
    """Return the gateway of this kind; BadInput at `where` and `key` as `installed_class`."""
    return installed_class(GROUP, name, Gateway, "gateway", where, key)
