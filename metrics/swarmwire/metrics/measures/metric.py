"""What a metric is: a frozen dataclass of parameters that names itself and measures a number per arena and tick.

Each measure reads the view of one tick: the truth, and values that several metrics share, computed once.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static, Truth

T = TypeVar("T")

ROUNDING = 1e-9  # 0.28 x 25 is a little more than 7 in floats
Kind = Literal["level", "count", "time"]
Need = Literal["poses", "contacts", "graph", "airtime", "latency"]  # latency: on air


@dataclass(frozen=True)
class Components:
    """The components of the radio graph that hold a robot alive; none spans two arenas, since no edge does."""

    pieces: IntArray  # (arenas,) how many
    largest: IntArray  # (arenas,) robots alive in the one that holds most; 0 without a component


class TickView:
    """The truth of one tick with its rows folded to (arenas, robots).

    Attributes:
        static: what does not change.
        truth: as observers see it.
        pose: (arenas, robots, 3) x, y in m, heading in rad, arena frame, of the dead too.
        velocity: (arenas, robots, 3) m/s, m/s, rad/s, arena frame, of the dead too.
        alive: (arenas, robots).
        robots_alive: (arenas,) how many.
        components: of the radio graph; None without a radio.
        per_robot_alive: (arenas,) divisor of a mean over the robots alive: their number; NaN if there is none.
    """

    def __init__(self, static: Static, truth: Truth) -> None:
        self.static, self.truth = static, truth
        arenas, robots = static.arenas, static.robots
        self.pose: FloatArray = truth.pose.reshape(arenas, robots, 3)
        self.velocity: FloatArray = truth.velocity.reshape(arenas, robots, 3)
        self.alive: BoolArray = truth.alive.reshape(arenas, robots)
        self.robots_alive: IntArray
        self.per_robot_alive: FloatArray
        self.robots_alive, self.per_robot_alive, everyone = _count(self.alive)
        edges = truth.edges
        self.components = None if edges is None else Components(*components_of(edges, self.alive))
        # Arenas that left would cost as much as those that have not; and a mask costs numpy as much as the sum.
        self._few: IntArray | None = None if everyone or truth.running.all() else np.flatnonzero(truth.running)
        counted = self.alive if self._few is None else self.alive[self._few]
        self._counted = True if everyone or counted.all() else counted
        self._shared: dict[Hashable, Any] = {}

    @property
    def position_m(self) -> FloatArray:
        """Where robots stand in the arena's frame, (arenas, robots, 2), the dead too."""
        return self.pose[:, :, :2]

    @property
    def heading_rad(self) -> FloatArray:
        """Headings in the arena's frame, (arenas, robots), of the dead too."""
        return self.pose[:, :, 2]

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosines and sines of the headings, (arenas, robots) each, of the dead too."""
        return _direction(self.pose)

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """The value that `make` returns for this key, computed once a tick."""
        if key not in self._shared:
            self._shared[key] = make()
        return self._shared[key]

    def robots_for(self, share: float) -> FloatArray:
        """How many robots such a share of those alive is, rounded up, at least one, (arenas,)."""
        return np.maximum(np.ceil(share * self.robots_alive - ROUNDING), 1.0)

    def sum_alive(self, values: FloatArray) -> FloatArray:
        """The sum of `values` (arenas, robots) over the robots alive of each arena, (arenas,)."""
        if self._few is None:
            return np.add.reduce(values, 1, where=self._counted)
        found = np.zeros(len(values))
        found[self._few] = np.add.reduce(values[self._few], 1, where=self._counted)
        return found


Measure = Callable[[TickView], FloatArray | float]  # to (arenas,), or one number for all; NaN: nothing to measure


class Metric(ABC):
    """One number per arena and tick.

    A `level` is a state that can be read off at any tick (order). A `count` is what happened within the tick
    (contacts), which adds up over the run. A `time` is when something happened, in s from the start of the run: NaN
    until it has, the same from then on; a run that ends before is right-censored.
    A subclass is a frozen dataclass whose fields, made by `comms.base.config.parameter`, are its parameters. What it
    must remember from tick to tick lives in the function that `begin` returns, so one metric serves many runs.
    """

    name: ClassVar[str]  # in scenarios, summaries and plots
    help: ClassVar[str]  # one line: formula and unit
    unit: ClassVar[str] = ""
    kind: ClassVar[Kind] = "level"
    standard: ClassVar[bool] = False  # measured in every run; others where a scenario lists them
    needs: ClassVar[tuple[Need, ...]] = ("poses",)  # data that logs of real robots may lack: it is left out then
    bounds: ClassVar[tuple[float | None, float | None]]  # least and largest value of a tick; None: there is none

    @abstractmethod
    def begin(self, static: Static) -> Measure:
        """A fresh measure for a run; it is called once per tick, in order."""


@dataclass(frozen=True)
class Sampled(Metric):
    """A metric that is measured at the start, then in the first tick at or after each multiple of `every_s`.

    In between it has the value of the last sample, even if robots have died since; 0 samples every tick.
    """

    every_s: float = parameter(1.0, help="from one sample to the next; 0: every tick", unit="s", at_least=0.0)

    @abstractmethod
    def sample(self, static: Static) -> Measure:
        """A fresh measure for a run; it is called for the ticks that are sampled, in order."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which holds what was sampled last."""
        sample, every_ns = self.sample(static), max(to_ns(self.every_s), 1)
        held: FloatArray | float = np.nan
        next_ns = 0

        def measure(view: TickView) -> FloatArray | float:
            nonlocal held, next_ns
            now_ns = view.truth.time_ns
            if now_ns >= next_ns:
                held, next_ns = sample(view), (now_ns // every_ns + 1) * every_ns
            return held

        return measure


@njit()
def agreement(x: FloatArray, y: FloatArray, alive: BoolArray, lengths: bool) -> FloatArray:
    """How near sums of vectors (arenas, robots) come to the most they can be, 0 to 1, (arenas,): |sum| / most.

    The most is the sum of their `lengths`, else the number of robots alive, as of unit vectors. The dead do not count;
    NaN if no robot is alive, 0 if all vectors are 0.
    """
    arenas, robots = alive.shape
    share = np.full(arenas, np.nan)
    for arena in range(arenas):
        along, across, most, n = 0.0, 0.0, 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                along += x[arena, i]
                across += y[arena, i]
                most += np.sqrt(x[arena, i] ** 2 + y[arena, i] ** 2) if lengths else 1.0
                n += 1
        if n:
            # Rounding may carry the sum of equal vectors just past that of their lengths.
            share[arena] = min(np.hypot(along, across) / most, 1.0) if most > 0.0 else 0.0
    return share


@njit()
def _direction(pose: AnyArray):
    """Both in one pass, which costs half of what two of numpy's do."""
    arenas, robots, _ = pose.shape
    c, s = np.empty((arenas, robots)), np.empty((arenas, robots))
    for arena in range(arenas):
        for i in range(robots):
            heading_rad = pose[arena, i, 2]
            c[arena, i], s[arena, i] = np.cos(heading_rad), np.sin(heading_rad)
    return c, s


@njit()
def _count(alive: AnyArray):
    """How many robots of each arena are alive, the same with NaN for none, and whether all are."""
    arenas, robots = alive.shape
    count, divisor, everyone = np.zeros(arenas, np.int64), np.full(arenas, np.nan), True
    for arena in range(arenas):
        for i in range(robots):
            count[arena] += alive[arena, i]
        if count[arena]:
            divisor[arena] = count[arena]
        everyone = everyone and count[arena] == robots
    return count, divisor, everyone


@njit()
def components_of(edges: IntArray, alive: BoolArray) -> tuple[IntArray, IntArray]:
    """How many components each arena has that hold a robot alive, and the most of them that one holds, (arenas,) each.

    Union-find over the `edges` (e, 2) between robot rows; `alive` is (arenas, robots).
    """
    arenas, robots = alive.shape
    parent = np.arange(arenas * robots, dtype=np.int64)
    size = np.zeros(arenas * robots, np.int64)
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


@njit()
def _root(parent: AnyArray, row: Any):
    while parent[row] != row:
        parent[row] = parent[parent[row]]  # halves the way for those to come
        row = parent[row]
    return row


@njit()
def neighbours_of(edges: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """`start` (nodes + 1,) and `other` (2 e,): node i is joined by an edge (e, 2) to other[start[i] : start[i + 1]]."""
    start, other = np.zeros(nodes + 1, np.int64), np.empty(2 * len(edges), np.int64)
    for e in range(len(edges)):
        for end in range(2):
            start[edges[e, end] + 1] += 1
    start = np.cumsum(start)
    at = start[:-1].copy()
    for e in range(len(edges)):
        for end in range(2):
            node = edges[e, end]
            other[at[node]] = edges[e, 1 - end]
            at[node] += 1
    return start, other
