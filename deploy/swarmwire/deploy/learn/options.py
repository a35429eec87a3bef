"""What an environment is asked to be: `EnvOptions`, what rewards read, and distributions of an episode's values."""

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

    Each has a row per arena; `robots` are those of an arena in the order of the scenario. Arenas that wait for a reset
    have 0 everywhere.
    """

    time_s: FloatArray  # (arenas,) since the start of the episode
    pose: FloatArray  # (arenas, robots, 3) x, y in m, heading in rad, arena frame
    pose_before: FloatArray  # (arenas, robots, 3) at the start of the last tick
    velocity: FloatArray  # (arenas, robots, 3) m/s, m/s, rad/s, arena frame
    command: FloatArray  # (arenas, robots, 3) in the last tick, within the drives' limits: forward, turn, to the left
    alive: BoolArray  # (arenas, robots)
    contacts: IntArray  # (arenas, 2) that began in the step: of robots with robots, and with walls or obstacles
    action: Float32Array  # (arenas, robots, numbers) as the policy gave it
    metrics: dict[str, FloatArray]  # (arenas,) each; a level at the start of the last tick, a count over the step
    light_m: FloatArray  # (arenas, lights, 2) where the lights stand; NaN beyond the last of an arena
    lights: tuple[tuple[Light, ...], ...]  # of each arena
    obstacles: tuple[tuple[Obstacle, ...], ...]  # of each arena, at the start
    values: tuple[dict[str, object], ...]  # what each episode drew, by path in the scenario


RewardFunction = Callable[[ArenaState], FloatArray]
TerminationFunction = Callable[[ArenaState], BoolArray]


@dataclass(frozen=True)
class Uniform:
    """Any number from `low` to `high`, all alike."""

    low: float
    high: float

    def value(self, share: float) -> object:
        """The value at a share of the distribution, 0 to 1."""
        return self.low + share * (self.high - self.low)

    def fault(self) -> str | None:
        """What is wrong with it; None: nothing."""
        good = isfinite(self.low) and isfinite(self.high) and self.low <= self.high
        return None if good else f"expected two finite numbers, the lower first; got {self}"


@dataclass(frozen=True)
class Choice:
    """One of these values, all alike: numbers, texts, truth values or lists, as a scenario takes them."""

    values: Sequence[object]

    def value(self, share: float) -> object:
        """The value at a share of the distribution, 0 to 1."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def fault(self) -> str | None:
        """What is wrong with it; None: nothing."""
        return None if len(self.values) else "expected one value or more"


Distribution = Uniform | Choice


def drawn(randomise: Mapping[str, Distribution], seed: int) -> dict[str, object]:
    """The values of an episode, by their keys in the scenario; they depend on its seed and on the key alone."""
    key = draws.derive_key("randomise", seed)
    shares = {name: float(draws.uniform(key, 0, 0, 0, draws.purpose(name))) for name in randomise}
    return {name: of.value(shares[name]) for name, of in randomise.items()}


@dataclass(frozen=True, kw_only=True)
class EnvOptions:
    """The options of `parallel_env` and `vector_env`."""

    seed: int | None = None  # of the first episode, until `reset` names one; None: the scenario's
    overrides: Sequence[str] = ()  # of the scenario: "path=value", as for `swarmwire run --set`
    randomise: Mapping[str, Distribution] = field(default_factory=dict[str, Distribution])  # by path in the scenario
    reward: RewardFunction | Mapping[str, float] | str | None = None  # to (arenas, …); or weights of metrics; or one
    terminated: TerminationFunction | Condition | None = None  # beside the scenario's stop conditions
    groups: Sequence[str] | None = None  # that the policy controls; others run the scenario's agents; None: all
    sensors: Sequence[str] | None = None  # None: those that the scenario's agent reads
    neighbours: int = 4  # whose messages a robot sees
    order: Literal["nearest", "newest"] | None = None  # None: nearest where the radio measures ranges
    message: int = 2  # numbers that the policy sends in each step
    shared: Sequence[str] | None = None  # sensors whose numbers are sent along; None: the compass
    speed_mps: float | None = None  # of the action 1; None: the body's limit
    turn_radps: float | None = None
    hashes: bool = True  # whether each episode has its trajectory hash; without, a step takes a tenth less

    def __post_init__(self) -> None:
        for path, of in self.randomise.items():
            if type(of) not in (Uniform, Choice):
                raise BadInput("randomise", path, f"expected a Uniform or a Choice, got {of!r}")
            if fault := of.fault():
                raise BadInput("randomise", path, fault)

    @property
    def weights(self) -> Mapping[str, float]:
        """By metric, if metrics are the reward; a function leaves none."""
        if isinstance(self.reward, str):
            return {self.reward: 1.0}
        return {} if self.reward is None or callable(self.reward) else self.reward
