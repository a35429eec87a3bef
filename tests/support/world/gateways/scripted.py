"""A gateway that no program talks to: it remembers what it was told, and says what a test has put into it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.config import parameter
from swarmwire.comms.tick_io import NOTHING_SET, SparseTable
from swarmwire.world.gateways.gateway import Commands, Gateway


@dataclass(frozen=True)
class ScriptedOptions:
    """What may be set of it."""

    first: int = parameter(1, help="number of the first address", at_least=1)


@dataclass
class Published:
    """One call of `publish`."""

    time_ns: int
    fields: dict[str, FloatArray]
    alive: BoolArray


class ScriptedGateway(Gateway):
    """Robots at "scripted:1" and so on, which drive as `drive` says."""

    options: ClassVar[type] = ScriptedOptions
    sensors: ClassVar[frozenset[str]] = frozenset({"proximity", "odometry", "imu"})
    made: ClassVar[list["ScriptedGateway"]] = []

    def __init__(self, names, body, address, options, clock) -> None:
        super().__init__(names, body, address, options, clock)
        self.published: list[Published] = []
        self.drive: dict[int, tuple[float, float]] = {}  # by place, until it is taken
        self.leds: SparseTable = NOTHING_SET
        self.faults: dict[str, int] = {}
        self.is_open = False
        ScriptedGateway.made.append(self)

    def open(self) -> tuple[str, ...]:
        self.is_open = True
        return tuple(f"scripted:{self.options_given.first + at}" for at in range(len(self.names)))

    def publish(self, time_ns, fields, alive) -> None:
        self.published.append(Published(time_ns, fields, alive))

    def take(self) -> Commands:
        drive, linear, angular = np.zeros(len(self.names), np.bool_), *np.zeros((2, len(self.names)))
        for place, command in self.drive.items():
            drive[place] = True
            linear[place], angular[place] = command
        leds, self.drive, self.leds = self.leds, {}, NOTHING_SET
        return Commands(drive, linear, angular, np.zeros_like(linear), leds)

    def counts(self) -> dict[str, int]:
        return self.faults

    def close(self) -> None:
        self.is_open = False
