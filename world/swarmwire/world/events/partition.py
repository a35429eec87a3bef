"""Partitions: sets of robots that cannot communicate with one another, by name or by region.

The side of a robot is the number of its set, from 1; 0: no set.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.events.effects import ActiveEffects
from swarmwire.world.events.event import LastingEvent, within
from swarmwire.world.events.selection import Groups, Swarm, members_of

KINDS = ("between", "region", "halves", "isolate", "bridge")
FIRST, SECOND = 1, 2  # sides


@dataclass(frozen=True)
class PartitionRegion:
    """A closed disc { at, radius_m } or rectangle { at, size_m } of the arena."""

    at: tuple[float, float] = parameter((0.0, 0.0), help="its centre, in the arena's frame", unit="m")
    radius_m: float | None = parameter(None, help="radius of the disc", unit="m", above=0, at_most=10_000)
    size_m: tuple[float, float] | None = parameter(None, help="full extents of the rectangle along x and y", unit="m")

    def check(self) -> None:
        """Raise BadInput, with a key within this table, unless exactly one shape is defined."""
        if (self.radius_m is None) == (self.size_m is None):
            raise BadInput("", "", "expected either radius_m or size_m")
        if self.size_m is not None and min(self.size_m) <= 0.0:
            raise BadInput("", "size_m", f"expected two numbers above 0 (m), got {list(self.size_m)}")

    def contains(self, pose: FloatArray) -> BoolArray:
        """True for robots at `pose` (rows, 3) whose centre is in the region, (rows,)."""
        offset_m = pose[:, :2] - self.at
        if self.radius_m is not None:
            return portable.hypot(offset_m[:, 0], offset_m[:, 1]) <= self.radius_m
        inside = np.abs(offset_m) <= 0.5 * np.array(self.size_m)
        return inside[:, 0] & inside[:, 1]


def sides_of_sets(sets: Sequence[Sequence[str]], swarm: Swarm) -> IntArray:
    """Side of each robot, (rows,): the set that names it or its group."""
    side: IntArray = np.zeros(swarm.robots, np.int64)
    for i, names in enumerate(sets):
        side[_indices(names, swarm)] = i + 1
    return np.tile(side, len(swarm.keys))


def sides_of_isolated(names: Sequence[str], swarm: Swarm) -> IntArray:
    """Side of each robot, (rows,): each named robot in a separate set, all others in the first."""
    side = np.full(swarm.robots, FIRST)
    isolated = _indices(names, swarm)
    side[isolated] = SECOND + np.arange(len(isolated))
    return np.tile(side, len(swarm.keys))


def sides_of_bridge(names: Sequence[str], swarm: Swarm) -> IntArray:
    """Side of each robot, (rows,): the named robots in no set, the first half of the others against the second."""
    side: IntArray = np.zeros(swarm.robots, np.int64)
    others = np.setdiff1d(np.arange(swarm.robots), _indices(names, swarm))
    side[others] = np.where(np.arange(len(others)) < (len(others) + 1) // 2, FIRST, SECOND)
    return np.tile(side, len(swarm.keys))


def sides_of_halves(axis: str, pose: FloatArray) -> IntArray:
    """Side of each robot, (rows,): robots to the left of (below) the arena's centre first, by `axis` "x" ("y")."""
    return two_sides(pose[:, 0 if axis == "x" else 1] < 0.0)


def two_sides(first: BoolArray) -> IntArray:
    """Side of each robot, (rows,): robots of the mask `first` (rows,) against all others."""
    return np.where(first, FIRST, SECOND)


def remove_robots(side: IntArray, names: Sequence[str], swarm: Swarm) -> IntArray:
    """Remove the named robots from their sets; return the sides, (rows,)."""
    named = np.zeros(swarm.robots, np.bool_)
    named[_indices(names, swarm)] = True
    return np.where(np.tile(named, len(swarm.keys)), 0, side)


def _indices(names: Sequence[str], swarm: Swarm) -> IntArray:
    """The indices within an arena of groups and robots by name, rising."""
    return np.array(sorted({index for name in names for index in members_of(name, swarm.groups)}), np.int64)


@dataclass(frozen=True, kw_only=True)
class Partition(LastingEvent):
    """No packet gets from a robot of one set to a robot of another; robots in no set communicate with all.

    One of `between`, `region`, `halves`, `isolate` and `bridge` defines the sets; `halves` and `bridge` may be
    combined. Sets by position are computed once, at the start of the partition.
    """

    do: str = parameter("partition", help="sets of robots cannot hear one another", choices=("partition",))
    between: tuple[tuple[str, ...], ...] | None = parameter(
        None, help="the sets: each a list of groups and names of robots"
    )
    region: PartitionRegion | None = parameter(
        None, help="two sets: the robots in the region at the start, and all others"
    )
    halves: str | None = parameter(
        None, help="two sets: the robots left of the arena's middle (y: below), and all others", choices=("x", "y")
    )
    isolate: tuple[str, ...] | None = parameter(
        None, help="groups and names of robots, each in a separate set; all others are one set"
    )
    bridge: tuple[str, ...] | None = parameter(
        None,
        help="groups and names of robots in no set; the others are divided in two in their order, or by halves",
    )
    one_way: bool = parameter(
        False,
        help="one-way cut of two sets: the second no longer receives the first; the first still receives the second",
    )
    needs_radio = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for sets that are too few, empty, unknown or overlap."""
        kinds = tuple(kind for kind in KINDS if getattr(self, kind) is not None)
        if len(kinds) != 1 and kinds != ("halves", "bridge"):
            listed = ", ".join(kinds) if kinds else "none"
            raise BadInput("", "", f"expected one of {', '.join(KINDS)}, or halves and bridge; got {listed}")
        if self.between is not None:
            _check_sets(self.between, groups)
        if self.region is not None:
            with within("region"):
                self.region.check()
        for key, names in (("isolate", self.isolate), ("bridge", self.bridge)):
            if names is not None:
                _check_names(names, groups, key)
        if self.one_way and (self.isolate is not None or len(self.between or (1, 2)) != 2):
            raise BadInput("", "one_way", "expected two sets with it: the second does not hear the first")

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Separate the sets."""
        self._partitions(effects)[serial] = self._sides(swarm)

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """All robots in one of the sets."""
        return self._partitions(effects)[serial] > 0

    def _partitions(self, effects: ActiveEffects) -> dict[int, IntArray]:
        return effects.one_way if self.one_way else effects.partitions

    def _sides(self, swarm: Swarm) -> IntArray:
        if self.between is not None:
            return sides_of_sets(self.between, swarm)
        if self.region is not None:
            return two_sides(self.region.contains(swarm.pose))
        if self.isolate is not None:
            return sides_of_isolated(self.isolate, swarm)
        if self.halves is not None:
            return remove_robots(sides_of_halves(self.halves, swarm.pose), self.bridge or (), swarm)
        return sides_of_bridge(self.bridge or (), swarm)


def _check_sets(sets: tuple[tuple[str, ...], ...], groups: Groups) -> None:
    if len(sets) < 2:
        raise BadInput("", "between", f"expected at least 2 sets of robots, got {len(sets)}")
    set_of: dict[int, int] = {}
    for number, names in enumerate(sets):
        key = f"between.{number}"
        _check_names(names, groups, key)
        for name in names:
            if any(set_of.setdefault(index, number) != number for index in members_of(name, groups)):
                raise BadInput("", key, f"expected sets that do not overlap; {name!r} is in two")


def _check_names(names: tuple[str, ...], groups: Groups, key: str) -> None:
    if not names:
        raise BadInput("", key, "expected a list that is not empty, got []")
    for name in names:
        if not members_of(name, groups):
            raise BadInput("", key, f"expected groups ({', '.join(groups)}) or names of robots; got {name!r}")
