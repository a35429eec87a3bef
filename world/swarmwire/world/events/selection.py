"""Names of a run's robots in events, and the `Selection` of the robots that an event affects.

A selection is a group, a list of names, or a number of robots drawn with a keyed draw.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.config import did_you_mean, parameter
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.errors import BadInput

Groups = Mapping[str, range]  # name -> indices within an arena
CHOICE_PURPOSE = purpose("event robots")
ROUNDING = 1e-9  # 0.145 x 100 is slightly below 14.5


@dataclass(frozen=True, slots=True)
class Swarm:
    """Robot row r is robot r % robots of arena r // robots."""

    groups: Groups
    robots: int  # robots per arena
    keys: KeyArray  # (arenas,) for draws
    pose: FloatArray  # (rows, 3) present x, y in m, heading in rad

    @property
    def rows(self) -> int:
        """Robots of all arenas."""
        return len(self.keys) * self.robots


def index_of(name: str, groups: Groups) -> int | None:
    """Return the index within an arena of the robot `group-i`; None if no robot has this name."""
    group, _, number = name.rpartition("-")
    members = groups.get(group, range(0))
    exists = number.isdecimal() and number == str(int(number)) and int(number) < len(members)
    return members[int(number)] if exists else None


def members_of(name: str, groups: Groups) -> range:
    """Return the indices within an arena of the group or robot with this name; empty if neither exists."""
    index = index_of(name, groups)
    return groups.get(name, range(0)) if index is None else range(index, index + 1)


@dataclass(frozen=True)
class Selection:
    """{ group }, { names }, or { share } or { count } of a group or of all; each arena has its own draws."""

    group: str | None = parameter(None, help="the robots of this group; of all groups if omitted")
    names: tuple[str, ...] | None = parameter(None, help="the robots with these names")
    share: float | None = parameter(
        None, help="random robots: this share of the eligible robots; rounded half up, at least one", above=0, at_most=1
    )
    count: int | None = parameter(
        None, help="random robots: this number of the eligible ones; all if fewer", at_least=1
    )

    def check(self, groups: Groups) -> None:
        """Raise BadInput, with a key within this table, for values that contradict each other or the groups."""
        if self.names is not None:
            if (self.group, self.share, self.count) != (None, None, None):
                raise BadInput("", "", "expected either names or some of group, share and count")
            if not self.names:
                raise BadInput("", "names", "expected a list that is not empty, got []")
            for name in self.names:
                if index_of(name, groups) is None:
                    raise BadInput("", "names", f"expected names of robots, such as {_example(groups)}; got {name!r}")
        elif self.share is not None and self.count is not None:
            raise BadInput("", "", "expected either share or count")
        elif (self.group, self.share, self.count) == (None, None, None):
            raise BadInput("", "", "expected group, names, share or count")
        elif self.group is not None and self.group not in groups:
            raise BadInput("", "group", f"expected {did_you_mean(groups, self.group)}; got {self.group!r}")

    def rows(self, serial: int, swarm: Swarm, eligible: BoolArray) -> BoolArray:
        """Select robots for the event with this index in the scenario, (rows,).

        `group` and `names` select all robots that they name. `share` and `count` select among the `eligible` robots
        (rows,) of each arena by a draw keyed by (robot, event).
        """
        named = np.zeros(swarm.robots, np.bool_)
        named[self._indices(swarm)] = True
        if self.share is None and self.count is None:
            return np.tile(named, len(swarm.keys))
        chosen = np.zeros((len(swarm.keys), swarm.robots), np.bool_)
        for arena, candidates in enumerate(eligible.reshape(chosen.shape) & named):
            index = np.flatnonzero(candidates)
            rank = uniform(int(swarm.keys[arena]), index, serial, 0, CHOICE_PURPOSE)
            chosen[arena, index[np.argsort(rank, kind="stable")[: self._count(len(index))]]] = True
        return chosen.reshape(-1)

    def groups(self, groups: Groups) -> list[str]:
        """Return the names of the groups from which it selects."""
        if self.names is not None:
            return list(dict.fromkeys(name.rpartition("-")[0] for name in self.names))
        return list(groups) if self.group is None else [self.group]

    def _indices(self, swarm: Swarm) -> IntArray:
        if self.names is not None:
            indices = [index_of(name, swarm.groups) for name in self.names]
            return np.array([index for index in indices if index is not None], np.int64)
        return np.array(range(swarm.robots) if self.group is None else swarm.groups[self.group], np.int64)

    def _count(self, candidates: int) -> int:
        if self.share is None:
            return self.count or 0
        return max(1, int(np.floor(self.share * candidates + 0.5 + ROUNDING)))


def _example(groups: Groups) -> str:
    return f"{next(iter(groups))}-0"
