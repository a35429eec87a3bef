"""Options of environments (`EnvOptions`), the input of reward functions, and distributions of an episode's values."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Literal

from swarmwire.agent.policy_io import Float32Array
from swarmwire.comms.base import draws
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Light
from swarmwire.metrics.measures.measure import Condition


@dataclass(frozen=True, slots=True, kw_only=True)
class ArenaState:
    """All arenas after a step, before any begins a new episode. Do not write to the arrays.

    Arrays have a row per arena; robots are in the scenario's order. Arenas that wait for a reset have 0 everywhere.
    """

    time_s: FloatArray  #: (arenas,) time since the start of the episode
    pose: FloatArray  #: (arenas, robots, 3) x, y in m, heading in rad, arena frame
    pose_before: FloatArray  #: (arenas, robots, 3) pose at the start of the last tick
    velocity: FloatArray  #: (arenas, robots, 3) m/s, m/s, rad/s, arena frame
    command: FloatArray  #: (arenas, robots, 3) clipped command of the last tick: forward, turn, to the left
    alive: BoolArray  #: (arenas, robots)
    contacts: IntArray  #: (arenas, 2) new contacts of robots in the step: with robots, with walls or obstacles
    action: Float32Array  #: (arenas, robots, numbers) action of the policy
    metrics: dict[str, FloatArray]  #: (arenas,) each; a level at the start of the last tick, a count over the step
    light_m: FloatArray  #: (arenas, lights, 2) positions of lights; NaN beyond the last of an arena
    lights: tuple[tuple[Light, ...], ...]  #: lights of each arena
    obstacles: tuple[tuple[Obstacle, ...], ...]  #: obstacles of each arena at the start
    values: tuple[dict[str, object], ...]  #: random values of each episode, by path in the scenario


RewardFunction = Callable[[ArenaState], FloatArray]
TerminationFunction = Callable[[ArenaState], BoolArray]


@dataclass(frozen=True)
class Uniform:
    """The uniform distribution from `low` to `high`."""

    low: float
    high: float

    def value(self, share: float) -> object:
        """Return the quantile of a share, 0 to 1."""
        return self.low + share * (self.high - self.low)

    def fault(self) -> str | None:
        """Return the expectation that the distribution breaks; None: valid."""
        is_valid = isfinite(self.low) and isfinite(self.high) and self.low <= self.high
        return None if is_valid else f"expected two finite numbers, the lower first; got {self}"


@dataclass(frozen=True)
class Choice:
    """A uniform choice of these values of a scenario: numbers, texts, truth values or lists."""

    values: Sequence[object]

    def value(self, share: float) -> object:
        """Return the quantile of a share, 0 to 1."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def fault(self) -> str | None:
        """Return the expectation that the distribution breaks; None: valid."""
        return None if len(self.values) else "expected one value or more"


Distribution = Uniform | Choice


def drawn(randomise: Mapping[str, Distribution], seed: int) -> dict[str, object]:
    """Return the values of an episode by path in the scenario; they depend only on its seed and the path."""
    key = draws.derive_key("randomise", seed)
    shares = {name: float(draws.uniform(key, 0, 0, 0, draws.purpose(name))) for name in randomise}
    return {name: distribution.value(shares[name]) for name, distribution in randomise.items()}


@dataclass(frozen=True, kw_only=True)
class EnvOptions:
    """The options of `parallel_env` and `vector_env`."""

    seed: int | None = None  #: seed of the first episode without `reset(seed=…)`; None: the scenario's
    overrides: Sequence[str] = ()  #: overrides of the scenario: "path=value"
    randomise: Mapping[str, Distribution] = field(
        default_factory=dict[str, Distribution]
    )  #: distributions by path in the scenario
    reward: RewardFunction | Mapping[str, float] | str | None = None  #: a function, weights of metrics, or a metric
    terminated: TerminationFunction | Condition | None = None  #: added to the scenario's stop conditions
    groups: Sequence[str] | None = None  #: groups that the policy controls, others run their agents; None: all
    sensors: Sequence[str] | None = None  #: None: the sensors of the scenario's agent
    neighbours: int = 4  #: number of senders in an observation
    order: Literal["nearest", "newest"] | None = None  #: None: nearest if the radio measures ranges
    message: int = 2  #: numbers that the policy sends in each step
    shared: Sequence[str] | None = None  #: sensors whose readings are part of messages; None: the compass
    speed_mps: float | None = None  #: speed at action 1; None: the body's limit
    turn_radps: float | None = None
    hashes: bool = True  #: compute trajectory hashes, a tenth of the time of a step

    def __post_init__(self) -> None:
        for path, distribution in self.randomise.items():
            if type(distribution) not in (Uniform, Choice):
                raise BadInput("randomise", path, f"expected a Uniform or a Choice, got {distribution!r}")
            if fault := distribution.fault():
                raise BadInput("randomise", path, fault)

    @property
    def weights(self) -> Mapping[str, float]:
        """Weights by metric, if metrics are the reward; empty for a function."""
        if isinstance(self.reward, str):
            return {self.reward: 1.0}
        return {} if self.reward is None or callable(self.reward) else self.reward
