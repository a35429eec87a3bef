"""One tick as metrics see it: the truth, and what several metrics share, worked out once."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components  # pyright: ignore[reportUnknownVariableType] - it brings no types

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Static, Truth


@dataclass(frozen=True)
class Components:
    """The connected components of the radio graph that hold a robot alive, c of them over all arenas."""

    arena: IntArray  # (c,) a component never spans two arenas, since no edge does
    size: IntArray  # (c,) robots alive


@dataclass(frozen=True)
class Moment:
    """The truth of one tick with its rows folded to (arenas, robots)."""

    static: Static
    truth: Truth

    @cached_property
    def alive(self) -> BoolArray:
        """Which robots are alive, (arenas, robots)."""
        return self.truth.alive.reshape(self._shape)

    @cached_property
    def robots_alive(self) -> IntArray:
        """How many robots of each arena are alive, (arenas,)."""
        return np.count_nonzero(self.alive, axis=1)

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
        if edges is None:
            return None
        rows = self.truth.alive.size
        graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(rows, rows))
        count, label = cast(tuple[int, IntArray], cast(Any, connected_components)(graph, directed=False))
        size = np.bincount(label[self.truth.alive], minlength=count)
        arena = np.zeros(count, np.int64)
        arena[label] = np.arange(rows) // self.static.robots
        held = size > 0  # a dead robot is a component of its own, of nobody
        return Components(arena[held], size[held])

    @property
    def _shape(self) -> tuple[int, int]:
        return self.static.arenas, self.static.robots
