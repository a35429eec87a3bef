"""Sides: the set of a partition in which each robot is, from 1; 0 is in none."""

from collections.abc import Sequence

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.events.swarm import Swarm, members_of

FIRST, SECOND = 1, 2


def sides_of_sets(sets: Sequence[Sequence[str]], swarm: Swarm) -> IntArray:
    """Each robot in the set that names it or its group, (rows,)."""
    side: IntArray = np.zeros(swarm.robots, np.int64)
    for place, names in enumerate(sets):
        side[_indices(names, swarm)] = place + 1
    return np.tile(side, len(swarm.keys))


def sides_of_loners(names: Sequence[str], swarm: Swarm) -> IntArray:
    """Each robot named in a set of its own, all others in the first, (rows,)."""
    side = np.full(swarm.robots, FIRST)
    alone = _indices(names, swarm)
    side[alone] = SECOND + np.arange(len(alone))
    return np.tile(side, len(swarm.keys))


def sides_of_bridge(names: Sequence[str], swarm: Swarm) -> IntArray:
    """The robots named in no set; of the others, in their order, the first half against the second, (rows,)."""
    side: IntArray = np.zeros(swarm.robots, np.int64)
    others = np.setdiff1d(np.arange(swarm.robots), _indices(names, swarm))
    side[others] = np.where(np.arange(len(others)) < (len(others) + 1) // 2, FIRST, SECOND)
    return np.tile(side, len(swarm.keys))


def sides_of_halves(axis: str, pose: FloatArray) -> IntArray:
    """Robots that stand left of (below) the arena's middle against all others, by `axis` "x" ("y"), (rows,)."""
    return two_sides(pose[:, 0 if axis == "x" else 1] < 0.0)


def two_sides(first: BoolArray) -> IntArray:
    """Those of `first` (rows,) against all others, (rows,)."""
    return np.where(first, FIRST, SECOND)


def without(side: IntArray, names: Sequence[str], swarm: Swarm) -> IntArray:
    """The same sets, with the robots named in none of them, (rows,)."""
    named = np.zeros(swarm.robots, np.bool_)
    named[_indices(names, swarm)] = True
    return np.where(np.tile(named, len(swarm.keys)), 0, side)


def _indices(names: Sequence[str], swarm: Swarm) -> IntArray:
    """The indices within an arena of groups and robots by name, rising."""
    return np.array(sorted({index for name in names for index in members_of(name, swarm.groups)}), np.int64)
