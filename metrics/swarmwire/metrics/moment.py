"""One tick as metrics see it: the truth, and what several metrics share, worked out once."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Static, Truth


@dataclass(frozen=True)
class Components:
    """The components of the radio graph that hold a robot alive; none spans two arenas, since no edge does."""

    pieces: IntArray  # (arenas,) how many
    largest: IntArray  # (arenas,) robots alive in the one that holds most; 0 without a component


class Moment:
    """The truth of one tick with its rows folded to (arenas, robots)."""

    def __init__(self, static: Static, truth: Truth) -> None:
        self.static, self.truth = static, truth
        self._shape = static.arenas, static.robots

    @cached_property
    def alive(self) -> BoolArray:
        """Which robots are alive, (arenas, robots)."""
        return self.truth.alive.reshape(self._shape)

    @cached_property
    def robots_alive(self) -> IntArray:
        """How many robots of each arena are alive, (arenas,)."""
        return np.add.reduce(self.alive, 1, np.int64)

    @cached_property
    def per_robot_alive(self) -> FloatArray:
        """What to divide a sum over robots by for their mean, (arenas,); NaN if none is alive."""
        return np.where(self.robots_alive > 0, self.robots_alive, np.nan)

    def sum_alive(self, values: FloatArray) -> FloatArray:
        """The sum of `values` (arenas, robots) over the robots alive of each arena, (arenas,)."""
        return np.add.reduce(values, 1, where=self._counted)

    @cached_property
    def heading_rad(self) -> FloatArray:
        """Headings in the arena's frame, (arenas, robots), of the dead too."""
        return self.truth.pose[:, 2].reshape(self._shape)

    @property
    def position_m(self) -> FloatArray:
        """Where robots stand in the arena's frame, (arenas, robots, 2), the dead too."""
        return self.truth.pose[:, :2].reshape(*self._shape, 2)

    @property
    def velocity_mps(self) -> FloatArray:
        """Velocities in the arena's frame, (arenas, robots, 2), of the dead too."""
        return self.truth.velocity[:, :2].reshape(*self._shape, 2)

    @cached_property
    def components(self) -> Components | None:
        """The radio graph's components; None without a radio. One pass over all arenas, O(rows + edges)."""
        edges = self.truth.edges
        return None if edges is None else Components(*_components(edges, self.alive))

    @cached_property
    def _counted(self) -> BoolArray | bool:
        """A mask costs numpy as much as the sum: as most often all are alive, none is needed."""
        return self.alive if np.minimum.reduce(self.truth.alive) == 0 else True


@njit(cache=True)
def _components(edges, alive):
    """Union-find: how many components each arena has that hold a robot alive, and the most of them that one holds."""
    arenas, robots = alive.shape
    parent, size = np.arange(arenas * robots), np.zeros(arenas * robots, np.int64)
    for e in range(len(edges)):
        a, b = _root(parent, edges[e, 0]), _root(parent, edges[e, 1])
        parent[max(a, b)] = min(a, b)
    pieces, largest = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
    for arena in range(arenas):
        for i in range(robots):
            if alive[arena, i]:
                root = _root(parent, arena * robots + i)
                pieces[arena] += size[root] == 0
                size[root] += 1
                largest[arena] = max(largest[arena], size[root])
    return pieces, largest


@njit(cache=True)
def _root(parent, row):
    while parent[row] != row:
        parent[row] = parent[parent[row]]  # halves the way for those to come
        row = parent[row]
    return row
