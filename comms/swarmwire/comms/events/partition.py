"""Partition: sets of robots that cannot hear one another."""

from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events import sides
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent, within
from swarmwire.comms.events.region import Region
from swarmwire.comms.events.swarm import Groups, Swarm, members_of
from swarmwire.comms.parameters import parameter

KINDS = ("between", "region", "halves", "isolate", "bridge")


@dataclass(frozen=True, kw_only=True)
class Partition(LastingEvent):
    """No packet gets from a robot of one set to a robot of another; robots in none of the sets hear all, and all them.

    One of `between`, `region`, `halves`, `isolate` and `bridge` says who is in which set; `bridge` may also stand
    beside `halves`. Sets by place are those of the moment at which the partition begins, whoever moves where after.
    """

    do: str = parameter("partition", help="sets of robots cannot hear one another", choices=("partition",))
    between: tuple[tuple[str, ...], ...] | None = parameter(
        None, help="the sets: each a list of groups and names of robots"
    )
    region: Region | None = parameter(
        None, help="two sets: the robots that are in there at the beginning, and all others"
    )
    halves: str | None = parameter(
        None, help="two sets: the robots left of the arena's middle (y: below), and all others", choices=("x", "y")
    )
    isolate: tuple[str, ...] | None = parameter(
        None, help="groups and names of robots, each of which is alone, and a set of all others"
    )
    bridge: tuple[str, ...] | None = parameter(
        None,
        help="groups and names of robots in no set; the others are cut in two in their order, or as halves says",
    )
    one_way: bool = parameter(
        False, help="of two sets, the second does not hear the first, which goes on to hear the second"
    )
    needs_radio = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for sets that are too few, empty, unknown or overlap."""
        given = tuple(kind for kind in KINDS if getattr(self, kind) is not None)
        if len(given) != 1 and given != ("halves", "bridge"):
            listed = ", ".join(given) if given else "none"
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

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Hold the sets apart."""
        self._held(conditions)[serial] = self._sides(swarm)

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """All robots in one of the sets."""
        return self._held(conditions)[serial] > 0

    def _held(self, conditions: Conditions) -> dict[int, IntArray]:
        return conditions.one_way if self.one_way else conditions.partitions

    def _sides(self, swarm: Swarm) -> IntArray:
        if self.between is not None:
            return sides.sides_of_sets(self.between, swarm)
        if self.region is not None:
            return sides.two_sides(self.region.holds(swarm.pose))
        if self.isolate is not None:
            return sides.sides_of_loners(self.isolate, swarm)
        if self.halves is not None:
            return sides.without(sides.sides_of_halves(self.halves, swarm.pose), self.bridge or (), swarm)
        return sides.sides_of_bridge(self.bridge or (), swarm)


def _check_sets(sets: tuple[tuple[str, ...], ...], groups: Groups) -> None:
    if len(sets) < 2:
        raise BadInput("", "between", f"expected at least 2 sets of robots, got {len(sets)}")
    set_of: dict[int, int] = {}
    for place, names in enumerate(sets):
        key = f"between.{place}"
        _check_names(names, groups, key)
        for name in names:
            if any(set_of.setdefault(index, place) != place for index in members_of(name, groups)):
                raise BadInput("", key, f"expected sets that do not overlap; {name!r} is in two")


def _check_names(names: tuple[str, ...], groups: Groups, key: str) -> None:
    if not names:
        raise BadInput("", key, "expected a list that is not empty, got []")
    for name in names:
        if not members_of(name, groups):
            raise BadInput("", key, f"expected groups ({', '.join(groups)}) or names of robots; got {name!r}")
