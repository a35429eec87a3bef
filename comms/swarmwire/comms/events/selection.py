"""The robots of a run, as events name them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.config import did_you_mean, parameter
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.errors import BadInput

Groups = Mapping[str, range]  # by name: indices within an arena


@dataclass(frozen=True, slots=True)
class Swarm:
    """Robot row r is robot r % robots of arena r // robots."""

    groups: Groups
    robots: int  # in each arena
    keys: KeyArray  # (arenas,) for draws
    pose: FloatArray  # (rows, 3) where robots stand at the moment: x, y in m, heading in rad

    @property
    def rows(self) -> int:
        """Robots of all arenas."""
        return len(self.keys) * self.robots


def index_of(name: str, groups: Groups) -> int | None:
    """The index within an arena of the robot `group-i`; None if there is none of this name."""
    group, _, number = name.rpartition("-")
    members = groups.get(group, range(0))
    known = number.isdecimal() and number == str(int(number)) and int(number) < len(members)
    return members[int(number)] if known else None


def members_of(name: str, groups: Groups) -> range:
    """Indices within an arena of a group, or the one of a robot; empty if there is neither of this name."""
    index = index_of(name, groups)
    return groups.get(name, range(0)) if index is None else range(index, index + 1)


# --- Which robots an event befalls: by group, by name, or so many by keyed choice.


CHOICE = purpose("event robots")
ROUNDING = 1e-9  # 0.145 x 100 is a hair below 14.5


@dataclass(frozen=True)
class Selection:
    """{ group }, { names }, or { share } or { count } of a group or of all; every arena draws for itself."""

    group: str | None = parameter(None, help="the robots of this group; of all groups if left out")
    names: tuple[str, ...] | None = parameter(None, help="the robots of these names")
    share: float | None = parameter(
        None, help="this share of those eligible, drawn; rounded half up, at least one", above=0, at_most=1
    )
    count: int | None = parameter(None, help="so many of those eligible, drawn; all if there are fewer", at_least=1)

    def check(self, groups: Groups) -> None:
        """Raise BadInput, with a key within this table, for what contradicts itself or does not fit these groups."""
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
        """The robots chosen for the event with this place in the scenario, (rows,).

        Group and names take all that they name; share and count choose, in each arena for itself, among those
        `eligible` (rows,), by a draw keyed by (robot, event).
        """
        named = np.zeros(swarm.robots, np.bool_)
        named[self._indices(swarm)] = True
        if self.share is None and self.count is None:
            return np.tile(named, len(swarm.keys))
        chosen = np.zeros((len(swarm.keys), swarm.robots), np.bool_)
        for arena, candidates in enumerate(eligible.reshape(chosen.shape) & named):
            index = np.flatnonzero(candidates)
            rank = uniform(int(swarm.keys[arena]), index, serial, 0, CHOICE)
            chosen[arena, index[np.argsort(rank, kind="stable")[: self._how_many(len(index))]]] = True
        return chosen.reshape(-1)

    def groups(self, groups: Groups) -> list[str]:
        """The groups that it may choose from."""
        if self.names is not None:
            return list(dict.fromkeys(name.rpartition("-")[0] for name in self.names))
        return list(groups) if self.group is None else [self.group]

    def _indices(self, swarm: Swarm) -> IntArray:
        if self.names is not None:
            found = [index_of(name, swarm.groups) for name in self.names]
            return np.array([index for index in found if index is not None], np.int64)
        return np.array(range(swarm.robots) if self.group is None else swarm.groups[self.group], np.int64)

    def _how_many(self, candidates: int) -> int:
        if self.share is None:
            return self.count or 0
        return max(1, int(np.floor(self.share * candidates + 0.5 + ROUNDING)))


def _example(groups: Groups) -> str:
    return f"{next(iter(groups))}-0"
