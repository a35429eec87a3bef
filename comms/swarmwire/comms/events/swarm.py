"""The robots of a run, as events name them."""

from collections.abc import Mapping
from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray, KeyArray

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
