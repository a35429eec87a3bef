"""Arenas: the episodes of an environment side by side, in as few worlds as their ages and settings allow."""

from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from swarmwire.agent.policy_io import Float32Array
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Light
from swarmwire.deploy.learn.options import ArenaState, EnvOptions, drawn
from swarmwire.deploy.learn.pack import Pack
from swarmwire.deploy.learn.setting import Setting, Settings
from swarmwire.deploy.runs.config import MAX_ARENAS, MAX_SEED

A = TypeVar("A", bound=np.ndarray[Any, Any])


class BadArgument(BadInput, ValueError):
    """A refused argument of `reset` or `step`, where Gymnasium's and PettingZoo's environments raise ValueError."""


class StepResult(NamedTuple):
    """The result of a step in each arena."""

    reward: FloatArray  # (arenas,), or (arenas, robots) from a reward function per robot
    terminated: BoolArray  # (arenas,)
    truncated: BoolArray  # (arenas,)


class Arenas:
    """The arenas of an environment, each with an episode; arrays have a row per arena.

    Attributes:
        count: number of arenas.
        robots: names of an arena's robots.
        controlled: indices of the robots that the policy controls, in the order of observations and actions.
        sizes: lengths of an observation and of an action, those of the longest group.
        seeds: (arenas,) seeds of the current episodes.
        hashed: True if episodes have trajectory hashes.
        values: random values of the current episodes, by path.
    """

    def __init__(self, scenario: Path | str | Mapping[str, Any], count: int, options: EnvOptions) -> None:
        """Create the arenas; BadInput for an invalid scenario or option."""
        if not 1 <= count <= MAX_ARENAS:
            raise BadInput("arenas", "", f"expected 1 to {MAX_ARENAS}, got {count!r}")
        self.count, self._options, self.hashed = count, options, options.hashes
        self.settings = Settings(scenario, options)
        first = self.settings.first
        self.robots = first.scenario.robot_names()
        layouts = first.layouts.values()
        self.controlled = np.concatenate([np.array(first.scenario.groups()[name]) for name in first.layouts])
        self._all_controlled = len(self.controlled) == len(self.robots)
        self.sizes = max(len(each.observation) for each in layouts), max(len(each.action) for each in layouts)
        self._packs: list[Pack] = []
        self._origin = np.arange(count)
        self._episode: IntArray = np.full(count, -1)  # number of each arena's episode since its seed
        seed = first.scenario.seed if options.seed is None else options.seed
        self.seed({arena: seed + arena for arena in range(count)})
        self.seeds: IntArray = self._origin.copy()
        self.values: list[dict[str, object]] = [{} for _ in range(count)]
        self._lights: list[tuple[Light, ...]] = [() for _ in range(count)]
        self._obstacles: list[tuple[Obstacle, ...]] = [() for _ in range(count)]
        self._light_m: FloatArray = np.empty((count, 0, 2))

    def seed(self, seeds: Mapping[int, int]) -> None:
        """Set the seed of the next episode of each of these arenas, by index; later seeds follow from it."""
        if not all(isinstance(seed, Integral) and 0 <= seed <= MAX_SEED for seed in seeds.values()):
            raise BadArgument("seed", "", f"expected whole numbers from 0 to {MAX_SEED}")
        for arena, seed in seeds.items():
            self._origin[arena], self._episode[arena] = seed, -1

    def check(self, actions: Float32Array) -> None:
        """Raise BadArgument for actions (arenas, robots, numbers) that are not finite."""
        if not (finite := np.isfinite(actions)).all():
            robot = self.robots[self.controlled[np.argwhere(~finite)[0, 1]]]
            raise BadArgument("actions", robot, "expected finite numbers")

    def close(self, over: BoolArray) -> None:
        """End the episodes of these arenas (arenas,): until `renew` they do not act, and all their numbers are 0."""
        packs: list[Pack] = []
        for pack in self._packs:
            pack_over = over[pack.slots]
            if not pack_over.all():
                if pack_over.any():
                    pack.leave(pack_over)
                packs.append(pack)
        self._packs = packs

    def renew(self, over: BoolArray) -> None:
        """Begin the next episode of these arenas (arenas,) in new worlds; other arenas continue."""
        self.close(over)
        slots_by_setting: dict[int, list[int]] = {}
        settings: list[Setting] = []
        self._episode[over] += 1
        for slot in np.flatnonzero(over).tolist():
            self.seeds[slot] = episode_seed(int(self._origin[slot]), int(self._episode[slot]))
            self.values[slot] = drawn(self._options.randomise, int(self.seeds[slot]))
            setting = self.settings.with_values(self.values[slot])
            if setting not in settings:
                settings.append(setting)
            slots_by_setting.setdefault(settings.index(setting), []).append(slot)
        for number, slots in slots_by_setting.items():
            index = np.array(slots)
            pack = Pack(settings[number], self.seeds[index].tolist(), index, self.sizes[0])
            self._packs.append(pack)
            for slot, lights, obstacles in zip(
                slots, pack.world.static.lights, pack.world.static.obstacles, strict=True
            ):
                self._lights[slot], self._obstacles[slot] = lights, obstacles
        self._light_m = _light_positions(self._lights)

    def observation(self) -> Float32Array:
        """Return the observation of each controlled robot, (arenas, robots, numbers)."""
        observation = self._gathered(lambda pack: pack.observation)
        if not self._all_controlled:
            return observation[:, self.controlled]
        # With several groups, the next step may return the same array again.
        return observation if len(self.settings.first.layouts) == 1 else observation.copy()

    def step(self, action: Float32Array, waiting: BoolArray | None = None) -> StepResult:
        """Act (arenas, robots, numbers), and run to the next action or the end of the episodes.

        Arenas `waiting` (arenas,) are at the start of an episode, or closed, and do not act; None: all act.
        RuntimeError if none has an episode.
        """
        if not self._all_controlled:
            all_actions = np.zeros((self.count, len(self.robots), action.shape[2]), np.float32)
            all_actions[:, self.controlled] = action
            action = all_actions
        for pack in self._packs:
            if waiting is None or not waiting[pack.slots].all():
                pack.step(self._scattered(pack, action))
        state = self._state(action)
        over, acted = self._each(lambda pack: pack.stopped()), True if waiting is None else ~waiting
        terminated = self._options.terminated
        if callable(terminated):
            flags = np.asarray(terminated(state), np.bool_)
            if flags.shape != over.shape:
                raise BadInput("terminated", "", f"expected an array {over.shape}, got {flags.shape}")
            over = over | flags
        at_end = self._each(lambda pack: np.full(len(pack.slots), pack.tick >= pack.setting.ticks))
        reward = self._reward(state)
        if waiting is not None:
            reward = np.where(waiting if reward.ndim == 1 else waiting[:, None], 0.0, reward)
        return StepResult(reward, over & acted, at_end & ~over & acted)

    def hexdigests(self) -> list[str]:
        """Return each arena's trajectory hash so far, equal to that of an ordinary run of its seed and values."""
        digests = [""] * self.count
        for pack in self._packs:
            for slot, digest in zip(pack.slots.tolist(), pack.hexdigests(), strict=True):
                digests[slot] = digest
        return digests

    @property
    def worlds(self) -> int:
        """Number of worlds of the arenas; the cost of a step grows with it."""
        return len(self._packs)

    def truth(self) -> Float32Array:
        """Return pose, velocity and 1 if alive of every robot, (arenas, robots, 7)."""
        poses, speeds = self._gathered(lambda pack: pack.world.pose), self._gathered(lambda pack: pack.world.velocity)
        return np.concatenate([poses, speeds, self.alive()[:, :, None]], axis=2).astype(np.float32)

    def alive(self) -> BoolArray:
        """Return True for living robots, (arenas, robots)."""
        return self._gathered(lambda pack: pack.world.alive)

    def _reward(self, state: ArenaState) -> FloatArray:
        function = self._options.reward
        if callable(function):
            reward = np.asarray(function(state), np.float64)
            if reward.shape not in ((self.count,), state.alive.shape):
                expected = f"({self.count},) or {state.alive.shape}"
                raise BadInput("reward", "", f"expected an array {expected}, got {reward.shape}")
            return reward
        total = np.zeros(self.count)
        for name, weight in self._options.weights.items():
            total += weight * np.nan_to_num(state.metrics[name])
        return total

    def _state(self, action: Float32Array) -> ArenaState:
        metrics = self.settings.first.metrics
        values = self._each(lambda pack: pack.measured().T) if metrics else np.empty((self.count, 0))
        return ArenaState(
            time_s=self._each(_time_s),
            pose=self._gathered(lambda pack: pack.world.pose),
            pose_before=self._gathered(lambda pack: pack.pose_before),
            velocity=self._gathered(lambda pack: pack.world.velocity),
            command=self._gathered(lambda pack: pack.world.command),
            alive=self.alive(),
            contacts=self._each(lambda pack: pack.contacts[pack.arenas]),
            action=action,
            metrics={metric.name: values[:, k] for k, metric in enumerate(metrics)},
            light_m=self._light_m,
            lights=tuple(self._lights),
            obstacles=tuple(self._obstacles),
            values=tuple(self.values),
        )

    def _gathered(self, values: Callable[[Pack], A]) -> A:
        """Return arrays with a row per robot of each pack, (rows, …), as (arenas, robots, …)."""
        robots = len(self.robots)

        def folded(pack: Pack) -> A:
            rows = values(pack)
            shaped = rows.reshape(-1, robots, *rows.shape[1:])
            return cast("A", shaped if len(shaped) == len(pack.arenas) else shaped[pack.arenas])

        return self._each(folded)

    def _each(self, values: Callable[[Pack], A]) -> A:
        """Join arrays with a row per arena of each pack in the order of the environment.

        RuntimeError if no arena has an episode.
        """
        if not self._packs:
            raise RuntimeError("no arena has an episode: call reset")
        if len(self._packs) == 1 and len(self._packs[0].slots) == self.count:
            return values(self._packs[0])  # already in the order of the environment
        parts = [values(pack) for pack in self._packs]
        joined = np.zeros((self.count, *parts[0].shape[1:]), parts[0].dtype)
        for pack, part in zip(self._packs, parts, strict=True):
            joined[pack.slots] = part
        return cast("A", joined)

    def _scattered(self, pack: Pack, action: Float32Array) -> Float32Array:
        """Return the actions of the rows of a pack's world; 0 in arenas that have left."""
        arenas = pack.world.static.arenas
        if len(pack.slots) == self.count == arenas:
            return action.reshape(-1, action.shape[2])
        rows = np.zeros((arenas, *action.shape[1:]), np.float32)
        rows[pack.arenas] = action[pack.slots]
        return rows.reshape(-1, action.shape[2])


def episode_seed(origin: int, episode: int) -> int:
    """Return the seed of an arena's episode: that of the arena for the first, derived from it for later ones."""
    return origin if episode == 0 else derive_key("episode", origin, episode) >> 1


def _time_s(pack: Pack) -> FloatArray:
    return np.full(len(pack.slots), tick_start_ns(pack.tick, pack.world.static.rate_hz) * 1e-9)


def _light_positions(lights: Sequence[Sequence[Light]]) -> FloatArray:
    """Return positions of lights, (arenas, lights, 2); NaN beyond the last of an arena."""
    position_m = np.full((len(lights), max(map(len, lights)), 2), np.nan)
    for arena, row in enumerate(lights):
        for k, light in enumerate(row):
            position_m[arena, k] = light.x_m, light.y_m
    return position_m
