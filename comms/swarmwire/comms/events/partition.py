"""Partition: sets of robots that cannot hear one another."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.swarm import Groups, Swarm, index_of
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Partition(LastingEvent):
    """No packet gets from a robot of one set to a robot of another; robots in none of the sets hear all."""

    do: str = parameter("partition", help="sets of robots cannot hear one another", choices=("partition",))
    between: tuple[tuple[str, ...], ...] = parameter(help="the sets: each a list of groups and names of robots")
    needs_radio = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for sets that are too few, empty, unknown or overlap."""
        if len(self.between) < 2:
            raise BadInput("", "between", f"expected at least 2 sets of robots, got {len(self.between)}")
        set_of: dict[int, int] = {}
        for place, names in enumerate(self.between):
            if not names:
                raise BadInput("", f"between.{place}", "expected a list that is not empty, got []")
            for name in names:
                found = _members(name, groups)
                if not found:
                    expected = f"expected groups ({', '.join(groups)}) or names of robots; got {name!r}"
                    raise BadInput("", f"between.{place}", expected)
                if any(set_of.setdefault(index, place) != place for index in found):
                    raise BadInput("", f"between.{place}", f"expected sets that do not overlap; {name!r} is in two")

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Hold the sets apart; changed are all robots in one of them."""
        sides: IntArray = np.zeros(swarm.robots, np.int64)
        for place, names in enumerate(self.between):
            for name in names:
                sides[list(_members(name, swarm.groups))] = place + 1
        conditions.partitions[serial] = np.tile(sides, len(swarm.keys))
        return conditions.partitions[serial] > 0

    def end(self, serial: int, conditions: Conditions) -> BoolArray:
        """Let them hear one another again."""
        return conditions.partitions.pop(serial) > 0


def _members(name: str, groups: Groups) -> range:
    """Indices of a group, or the one of a robot; empty if there is neither of this name."""
    index = index_of(name, groups)
    return groups.get(name, range(0)) if index is None else range(index, index + 1)
