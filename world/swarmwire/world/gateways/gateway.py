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

GROUP = "swarmwire.gateways"  # of entry points
FRESH: Mapping[str, int] = MappingProxyType({})  # ages of readings that are all new


@dataclass(frozen=True, slots=True)
class ForeignCommands:
    """The commands of foreign programs to the robots of a gateway since the last call, a row per robot of the group."""

    drive: BoolArray  # (n,) False: the last command holds
    linear_mps: FloatArray  # (n,)
    angular_radps: FloatArray  # (n,)
    lateral_mps: FloatArray  # (n,)
    leds: SparseTable  # rows are indices in the group, 0 to n - 1
    motors: SparseTable = NOTHING_SET  # the same rows; of flying bodies: 1 on, 0 off (on the floor), until the next


class Gateway(ABC):
    """Emulated robots of one group. The loop calls it, from one thread; the servers for programs run beside it.

    Attributes:
        options: the class of the gateway's options, a frozen dataclass of `parameter`s.
        sensors: the sensors of a body that it can publish, by their names in specs.
        unsaid: sensors that the emulated robot has and does not publish either: no difference.
        separate: whether each robot has a network of its own, and so a server of its own. Set before `open`.
    """

    options: ClassVar[type] = NoParameters
    sensors: ClassVar[frozenset[str]]
    unsaid: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        """Empty `address`: the gateway chooses one. BadInput if the address or the body does not fit."""
        self.names, self.body, self.address, self.options_given, self.clock = (
            tuple(names),
            body,
            address,
            options,
            clock,
        )
        self.separate = False

    def differences(self) -> tuple[str, ...]:
        """The differences between this body and the emulated robot, in words; none: they are the same.

        Sensors that a tracker provides are no difference.
        """
        known = self.sensors | self.unsaid
        missing = [name for name, spec in self.body.sensors.items() if not (name in known or spec.is_global)]
        without_actuator = [*self.body.actuators]
        return tuple(
            f"{words} {', '.join(names)}"
            for words, names in (("no program receives its", missing), ("no program moves its", without_actuator))
            if names
        )

    def enter(self, scene: Scene, first: int) -> None:  # noqa: B027 - most gateways need readings alone
        """Called once, before `open`: the arena, always the present, and the index in it of the first robot."""

    @abstractmethod
    def open(self) -> tuple[str, ...]:
        """Start to answer; returns each robot's address, as its driver takes it. BadInput if one is in use."""

    def on_robot(self, address: str) -> str:
        """The address at which programs on a robot with a network of its own reach what answers at `address`."""
        return address

    @abstractmethod
    def publish(
        self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray, ages_ns: Mapping[str, int] = FRESH
    ) -> None:
        """Publish the newest readings: "sensor.field" -> (n,) or (n, width); those of a dead robot stay private.

        `ages_ns` is how long before `time_ns` a sensor measured; those that are not in it did so at that time.
        A dead robot is silent: it answers nothing, and takes no command.
        """

    @abstractmethod
    def take(self) -> ForeignCommands:
        """The newest command of each robot since the last call."""

    @abstractmethod
    def counts(self) -> dict[str, int]:
        """Faults by name, such as input from programs that no robot accepts."""

    @abstractmethod
    def close(self) -> None:
        """Close all connections and free the addresses; safe to call more than once."""


def gateway_names() -> list[str]:
    """The kinds of gateways that are installed."""
    return list(installed_points(GROUP))


def gateway_kind(name: str, where: str, key: str = "") -> type[Gateway]:
    """The gateway of this kind; BadInput at `where` and `key` as `installed_class`."""
    return installed_class(GROUP, name, Gateway, "gateway", where, key)
