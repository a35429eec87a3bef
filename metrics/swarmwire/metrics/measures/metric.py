"""Interface of metrics: a frozen dataclass with a name and parameters that measures a number per arena and tick.

Each measure reads the view of one tick: the truth, and values that several metrics share, computed once.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isinf
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static, Truth

T = TypeVar("T")

ROUNDING = 1e-9  # 0.28 x 25 is a little more than 7 in floats
Kind = Literal["level", "count", "time"]
Need = Literal["poses", "commands", "contacts", "graph", "packets", "airtime", "latency"]  # latency: on air


class Components(NamedTuple):
    """The components of a graph that hold a robot alive; none spans two arenas, since no edge does."""

    number: IntArray  #: (arenas,) number of components
    largest: IntArray  #: (arenas,) robots alive in the largest component; 0 without a component


class TickView:
    """The truth of one tick with its rows folded to (arenas, robots)."""

    static: Static  #: constants of the run
    truth: Truth  #: the tick's ground truth
    pose: FloatArray  #: (arenas, robots, 3) x, y in m, heading in rad, arena frame, dead robots included
    velocity: FloatArray  #: (arenas, robots, 3) m/s, m/s, rad/s, arena frame, dead robots included
    alive: BoolArray  #: (arenas, robots) True if alive
    robots_alive: IntArray  #: (arenas,) number of robots alive
    #: (arenas,) divisor of a mean over the robots alive: their number; NaN if there is none
    per_robot_alive: FloatArray
    components: Components | None  #: components of the radio graph; None without a radio

    def __init__(self, static: Static, truth: Truth) -> None:
        self.static, self.truth = static, truth
        arenas, robots = static.arenas, static.robots
        self.pose = truth.pose.reshape(arenas, robots, 3)
        self.velocity = truth.velocity.reshape(arenas, robots, 3)
        self.alive = truth.alive.reshape(arenas, robots)
        self.robots_alive, self.per_robot_alive, all_alive = _count(self.alive)
        edges = truth.edges
        self.components = None if edges is None else components_of(edges, self.alive)
        # Sums skip arenas that have left, and use a mask only if a robot is dead: a mask costs numpy as much as a sum.
        self._summed: IntArray | None = None if all_alive or truth.running.all() else np.flatnonzero(truth.running)
        alive = self.alive if self._summed is None else self.alive[self._summed]
        self._mask = True if all_alive or alive.all() else alive
        self._shared: dict[Hashable, Any] = {}

    @property
    def position_m(self) -> FloatArray:
        """Positions in the arena's frame, (arenas, robots, 2), dead robots included."""
        return self.pose[:, :, :2]

    @property
    def heading_rad(self) -> FloatArray:
        """Headings in the arena's frame, (arenas, robots), dead robots included."""
        return self.pose[:, :, 2]

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosines and sines of the headings, (arenas, robots) each, dead robots included."""
        return _direction(self.pose)

    def once(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return the value that `compute` returns for this key, computed once a tick."""
        if key not in self._shared:
            self._shared[key] = compute()
        return self._shared[key]

    def robots_for(self, share: float) -> FloatArray:
        """Return the number of robots that make up a share of those alive, rounded up, at least one, (arenas,)."""
        return np.maximum(np.ceil(share * self.robots_alive - ROUNDING), 1.0)

    def sum_alive(self, values: FloatArray) -> FloatArray:
        """Return the sum of `values` (arenas, robots) over the robots alive of each arena, (arenas,)."""
        if self._summed is None:
            return np.add.reduce(values, 1, where=self._mask)
        sums = np.zeros(len(values))
        sums[self._summed] = np.add.reduce(values[self._summed], 1, where=self._mask)
        return sums


# Returns (arenas,), or one number for all arenas; NaN without a value.
Measure = Callable[[TickView], FloatArray | float]


class Metric(ABC):
    """One number per arena and tick.

    A `level` is a quantity at a tick (order). A `count` is the number of occurrences within the tick (contacts), which
    adds up over the run. A `time` is the time of an event, in s from the start of the run: NaN until the event, the
    same from then on; a run that ends before is right-censored.
    A subclass is a frozen dataclass whose fields, made by `comms.base.config.parameter`, are its parameters. The
    function that `begin` returns holds the memory from tick to tick, so one metric serves many runs.
    """

    name: ClassVar[str]  #: name for scenarios, summaries and plots
    help: ClassVar[str]  #: one line: formula and unit
    unit: ClassVar[str] = ""
    kind: ClassVar[Kind] = "level"
    standard: ClassVar[bool] = False  #: measured in every run; other metrics only if a scenario lists them
    needs: ClassVar[tuple[Need, ...]] = ("poses",)  #: data without which logs of real robots have no value
    bounds: ClassVar[tuple[float | None, float | None]]  #: least and largest value of a tick; None: unbounded

    @abstractmethod
    def begin(self, static: Static) -> Measure:
        """Return a measure for a new run; it is called once per tick, in order."""


@dataclass(frozen=True)
class Sampled(Metric):
    """A metric that is measured at the start, then in the first tick at or after each multiple of `every_s`.

    Between samples it repeats the last one, even if robots have died since; 0 samples every tick.
    """

    every_s: float = parameter(1.0, help="from one sample to the next; 0: every tick", unit="s", at_least=0.0)

    @abstractmethod
    def sample(self, static: Static) -> Measure:
        """Return a measure for a new run; it is called for the ticks that are sampled, in order."""

    def begin(self, static: Static) -> Measure:
        """Return a measure that repeats the last sample."""
        sample, every_ns = self.sample(static), max(to_ns(self.every_s), 1)
        latest: FloatArray | float = np.nan
        next_ns = 0

        def measure(view: TickView) -> FloatArray | float:
            nonlocal latest, next_ns
            now_ns = view.truth.time_ns
            if now_ns >= next_ns:
                latest, next_ns = sample(view), (now_ns // every_ns + 1) * every_ns
            return latest

        return measure


@njit()
def agreement(x: FloatArray, y: FloatArray, alive: BoolArray, lengths: bool) -> FloatArray:
    """Return |sum of vectors| / bound over the robots alive, 0 to 1, (arenas,); `x` and `y` are (arenas, robots).

    The bound is the sum of the vectors' lengths if `lengths`, else the number of robots, as for unit vectors. NaN if no
    robot is alive, 0 if all vectors are 0.
    """
    arenas, robots = alive.shape
    share = np.full(arenas, np.nan)
    for arena in range(arenas):
        along, across, bound, n = 0.0, 0.0, 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                along += x[arena, i]
                across += y[arena, i]
                bound += np.sqrt(x[arena, i] ** 2 + y[arena, i] ** 2) if lengths else 1.0
                n += 1
        if n:
            # Rounding may carry the sum of equal vectors just past that of their lengths.
            share[arena] = min(np.hypot(along, across) / bound, 1.0) if bound > 0.0 else 0.0
    return share


@njit()
def _direction(pose: AnyArray):
    """Return cosines and sines in one pass, in half the time of numpy's two."""
    arenas, robots, _ = pose.shape
    c, s = np.empty((arenas, robots)), np.empty((arenas, robots))
    for arena in range(arenas):
        for i in range(robots):
            heading_rad = pose[arena, i, 2]
            c[arena, i], s[arena, i] = np.cos(heading_rad), np.sin(heading_rad)
    return c, s


@njit()
def _count(alive: AnyArray):
    """Return the number of robots alive per arena, the same with NaN for none, and True if all robots are alive."""
    arenas, robots = alive.shape
    count, divisor, all_alive = np.zeros(arenas, np.int64), np.full(arenas, np.nan), True
    for arena in range(arenas):
        for i in range(robots):
            count[arena] += alive[arena, i]
        if count[arena]:
            divisor[arena] = count[arena]
        all_alive = all_alive and count[arena] == robots
    return count, divisor, all_alive


@njit()
def components_of(edges: IntArray, alive: BoolArray) -> Components:
    """Return the components that `edges` (e, 2) between robot rows form, by union-find; `alive` is (arenas, robots)."""
    arenas, robots = alive.shape
    parent = np.arange(arenas * robots, dtype=np.int64)
    size = np.zeros(arenas * robots, np.int64)
    for e in range(len(edges)):
        a, b = _root(parent, edges[e, 0]), _root(parent, edges[e, 1])
        parent[max(a, b)] = min(a, b)
    number, largest = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
    for arena in range(arenas):
        for i in range(robots):
            if alive[arena, i]:
                root = _root(parent, arena * robots + i)
                number[arena] += size[root] == 0
                size[root] += 1
                largest[arena] = max(largest[arena], size[root])
    return Components(number, largest)


@njit()
def _root(parent: AnyArray, row: Any):
    while parent[row] != row:
        parent[row] = parent[parent[row]]  # path halving
        row = parent[row]
    return row


@njit()
def neighbours_of(edges: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Return `start` (nodes + 1,) and `other` (2 e,): node i has the neighbours other[start[i] : start[i + 1]]."""
    start, other = np.zeros(nodes + 1, np.int64), np.empty(2 * len(edges), np.int64)
    for e in range(len(edges)):
        for end in range(2):
            start[edges[e, end] + 1] += 1
    start = np.cumsum(start)
    following = start[:-1].copy()
    for e in range(len(edges)):
        for end in range(2):
            node = edges[e, end]
            other[following[node]] = edges[e, 1 - end]
            following[node] += 1
    return start, other


@dataclass(frozen=True)
class MetricInfo:
    """A metric that a run measured."""

    name: str
    help: str  #: one line: formula and unit
    unit: str
    kind: str  #: "level", "count" or "time"
    bounds: tuple[float | None, float | None]  #: least and largest value of a tick; None: there is none


def metric_info(metric: Metric | type[Metric]) -> MetricInfo:
    """Return the entry of a metric in run.json."""
    least, largest = (None if bound is None or isinf(bound) else float(bound) for bound in metric.bounds)
    return MetricInfo(metric.name, metric.help, metric.unit, metric.kind, (least, largest))


def metric_infos(started: Mapping[str, Any]) -> tuple[MetricInfo, ...]:
    """Return the metrics that `run.json` lists; KeyError, TypeError or ValueError if the list is malformed."""
    return tuple(_info(item) for item in started["metrics"])


def _info(item: Any) -> MetricInfo:
    least, largest = item["bounds"]
    return MetricInfo(item["name"], item["help"], item["unit"], item["kind"], (least, largest))
