"""The environments: a PettingZoo ParallelEnv of one arena, and a Gymnasium VectorEnv of many."""

from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from pettingzoo import ParallelEnv

from swarmwire.agent.policy_io import Float32Array
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.learn.arenas import Arenas, BadArgument
from swarmwire.deploy.learn.options import EnvOptions

Autoreset = Literal["next_step", "same_step", "disabled"]
MODES: dict[Autoreset, AutoresetMode] = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


class SwarmParallelEnv(ParallelEnv[str, Any, Any]):
    """An arena whose agents are the robots that the policy controls.

    Dead robots remain agents, with observations of 0, since an event may revive them. All agents end together:
    terminated by a condition, or truncated at the scenario's `duration_s`.

    Copies and pickles continue at the state of the original: they execute its episode again.

    Attributes:
        arenas: the arena.
        layouts: meaning of the numbers of observations and actions, by controlled group.
        state_space: space of `state`.
        trajectory_sha256: hash of the latest ended episode; empty before the first end, or without `hashes`.
    """

    def __init__(self, scenario: Path | str | Mapping[str, Any], options: EnvOptions) -> None:
        """Create the environment; BadInput for an invalid scenario or option."""
        self.arenas = Arenas(scenario, 1, options)
        self.trajectory_sha256 = ""
        first = self.arenas.settings.first
        self.layouts = first.layouts
        self.metadata = {"name": first.scenario.name, "render_modes": [], "is_parallelizable": True}
        self.render_mode = None
        self.possible_agents = [self.arenas.robots[index] for index in self.arenas.controlled.tolist()]
        self.agents: list[str] = []
        self.observation_spaces: dict[str, Space[Any]] = {}
        self.action_spaces: dict[str, Space[Any]] = {}
        layouts = [
            first.layouts[name]
            for name, table in first.scenario.robots.items()
            if name in first.layouts
            for _ in range(table.count)
        ]
        self._sizes = [len(layout.low) for layout in layouts]
        self._action_shapes = [(len(layout.action),) for layout in layouts]
        lengths = np.array(self._action_shapes)
        self._has_number = (np.arange(self.arenas.sizes[1]) < lengths)[None]  # (1, agents, numbers)
        high = np.full((len(self.arenas.robots), 7), np.inf, np.float32)
        self.state_space = _box(-high, high)
        for agent, layout, shape in zip(self.possible_agents, layouts, self._action_shapes, strict=True):
            self.observation_spaces[agent] = _box(layout.low, layout.high)
            self.action_spaces[agent] = Box(-1.0, 1.0, shape, np.float32)

    def observation_space(self, agent: str) -> Space[Any]:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Float32Array], dict[str, dict[str, Any]]]:
        """Begin an episode: that of this seed, else the next one. Infos contain its seed and its random numbers."""
        if seed is not None:
            self.arenas.seed({0: seed})
        self.arenas.renew(np.ones(1, np.bool_))
        self.agents = self.possible_agents.copy()
        facts = {"seed": int(self.arenas.seeds[0]), **_numbers(self.arenas.values[0])}
        return self._observations(), {agent: dict(facts) for agent in self.agents}

    def step(
        self, actions: dict[str, Float32Array]
    ) -> tuple[dict[str, Float32Array], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Execute an action of every agent.

        RuntimeError before the first `reset`, and between an episode's end and the next `reset`. ValueError for a
        missing action, an unknown agent, a wrong shape, or a number that is not finite.
        """
        if not self.agents:
            raise RuntimeError("no episode: call reset")
        reward, terminated, truncated = self.arenas.step(self._table(actions))
        agents, over = self.agents, bool(terminated[0] or truncated[0])
        rewards = np.broadcast_to(reward, (1, len(self.arenas.robots)))[0] if reward.ndim == 1 else reward[0]
        if over:
            self.agents = []
        if over and self.arenas.hashed:
            self.trajectory_sha256 = self.arenas.hexdigests()[0]
        return (
            self._observations(),
            dict(zip(agents, rewards[self.arenas.controlled].tolist(), strict=True)),
            dict.fromkeys(agents, bool(terminated[0])),
            dict.fromkeys(agents, bool(truncated[0])),
            {agent: {} for agent in agents},
        )

    def state(self) -> Float32Array:
        """Return the true state of all robots, (robots, 7): pose, velocity, 1 if alive; for centralised critics."""
        return self.arenas.truth()[0]

    def _table(self, actions: Mapping[str, Float32Array]) -> Float32Array:
        """Return the actions as an array (1, agents, numbers), with 0 beyond the numbers of an agent."""
        if actions.keys() != self.action_spaces.keys():
            agent = min(actions.keys() ^ self.action_spaces.keys(), key=str)
            reason = f"expected agents {', '.join(self.agents)}" if agent in actions else "expected an action"
            raise BadArgument("actions", str(agent), reason)
        rows = [np.asarray(actions[agent], np.float32) for agent in self.possible_agents]
        for agent, row, shape in zip(self.possible_agents, rows, self._action_shapes, strict=True):
            if row.shape != shape:
                raise BadArgument("actions", agent, f"expected an array {shape}, got {row.shape}")
        table = np.zeros(self._has_number.shape, np.float32)
        table[self._has_number] = np.concatenate(rows)
        self.arenas.check(table)
        return table

    def _observations(self) -> dict[str, Float32Array]:
        observation = self.arenas.observation()[0]
        return {
            agent: observation[index, : self._sizes[index]].copy() for index, agent in enumerate(self.possible_agents)
        }


class SwarmVectorEnv(VectorEnv[Any, Any, Any]):
    """Many arenas, each an environment with all its robots.

    Observations and actions are (arenas, robots, numbers), which reshape without a copy to (arenas x robots, numbers)
    for policies that share parameters. Robots of groups with fewer numbers have 0 in the last ones. Rewards per robot
    become their mean, and are in infos as `robot_reward`.

    An arena that is over begins its next episode separately: in the next step, or in the same. With autoreset disabled
    it waits for its `reset`: until then it stays over, and its reward and observations are 0.

    Copies and pickles continue at the state of the original: they execute its episodes again.

    Attributes:
        arenas: the arenas.
        layouts: meaning of the numbers of observations and actions, by controlled group.
        trajectory_sha256: hash of the latest ended episode of each arena; empty before the first end, or without
            `hashes`.
    """

    observation_space: Space[Any]
    action_space: Space[Any]

    def __init__(
        self, scenario: Path | str | Mapping[str, Any], arenas: int, autoreset: Autoreset, options: EnvOptions
    ) -> None:
        """Create the environment; BadInput for an invalid scenario or option."""
        if autoreset not in MODES:
            raise BadInput("autoreset", "", f"expected one of {', '.join(MODES)}; got {autoreset!r}")
        self.arenas = Arenas(scenario, arenas, options)
        self.num_envs, self._mode = arenas, MODES[autoreset]
        self.metadata = {"autoreset_mode": self._mode, "render_modes": []}
        self.trajectory_sha256 = ("",) * arenas
        first = self.arenas.settings.first
        self.layouts = first.layouts
        low, high = (np.zeros((len(self.arenas.controlled), self.arenas.sizes[0]), np.float32) for _ in range(2))
        start = 0
        for name, layout in first.layouts.items():
            rows = slice(start, start + first.scenario.robots[name].count)
            low[rows, : len(layout.low)], high[rows, : len(layout.high)] = layout.low, layout.high
            start = rows.stop
        self.single_observation_space = _box(low, high)
        self.single_action_space = Box(-1.0, 1.0, (len(low), self.arenas.sizes[1]), np.float32)
        self.observation_space = batch_space(self.single_observation_space, arenas)
        self.action_space = batch_space(self.single_action_space, arenas)
        self._over: BoolArray = np.zeros(arenas, np.bool_)
        self._flags: tuple[BoolArray, BoolArray] = (
            self._over,
            self._over,
        )  # terminated, truncated

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode in each arena: with a seed s, arena i has s + i; with a list its element; else the next.

        `options["reset_mask"]` (arenas,) selects arenas, and only these get seeds. ValueError for an invalid mask or
        seed.
        """
        renewed = self._mask(options or {})
        if seed is not None:
            seeds = [int(seed) + i for i in range(self.num_envs)] if isinstance(seed, int | np.integer) else seed
            if len(seeds) != self.num_envs:
                raise BadArgument("seed", "", f"expected one seed, or {self.num_envs}; got {len(seeds)}")
            self.arenas.seed({arena: each for arena, each in enumerate(seeds) if renewed[arena] and each is not None})
        if isinstance(seed, int | np.integer):
            super().reset(seed=int(seed))  # seeds `np_random`
        self.arenas.renew(renewed)
        self._over, (terminated, truncated) = self._over & ~renewed, self._flags
        self._flags = terminated & ~renewed, truncated & ~renewed
        return self.arenas.observation(), self._begun(renewed)

    def step(self, actions: Float32Array) -> tuple[Float32Array, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Execute an action of every robot, (arenas, robots, numbers).

        RuntimeError if all arenas wait for a reset; ValueError for actions of another shape, or with a number that is
        not finite.
        """
        actions = np.asarray(actions, np.float32)
        if actions.shape != self.action_space.shape:
            raise BadArgument("actions", "", f"expected an array {self.action_space.shape}, got {actions.shape}")
        self.arenas.check(actions)
        waiting, infos = self._over, dict[str, Any]()
        if self._mode is AutoresetMode.NEXT_STEP and waiting.any():
            self.arenas.renew(waiting)
            infos = self._begun(waiting)
        reward, *flags = self.arenas.step(actions, waiting if waiting.any() else None)
        if reward.ndim == 2:
            infos["robot_reward"] = reward = reward[:, self.arenas.controlled]
            infos["_robot_reward"] = np.ones(self.num_envs, np.bool_)
            reward = reward.mean(axis=1)
        ended = flags[0] | flags[1]
        if self._mode is AutoresetMode.DISABLED:
            flags = [old & waiting | new for old, new in zip(self._flags, flags, strict=True)]
        self._over, self._flags = flags[0] | flags[1], (flags[0], flags[1])
        observation = self.arenas.observation()
        if ended.any():
            observation = self._end(ended, observation, infos)
        terminated, truncated = self._flags
        return observation, reward, terminated.copy(), truncated.copy(), infos

    def _end(self, over: BoolArray, observation: Float32Array, infos: dict[str, Any]) -> Float32Array:
        """End these episodes, with their infos, according to the mode; return the observations of the step."""
        if self.arenas.hashed:
            each = zip(over.tolist(), self.arenas.hexdigests(), self.trajectory_sha256, strict=True)
            self.trajectory_sha256 = tuple(new if is_over else old for is_over, new, old in each)
        for arena in np.flatnonzero(over).tolist():
            facts: dict[str, Any] = {"episode_seed": int(self.arenas.seeds[arena])}
            if self._mode is AutoresetMode.SAME_STEP:
                facts = {"final_obs": observation[arena].copy(), "final_info": facts}
            infos.update(self._add_info(infos, facts, arena))
        if self._mode is AutoresetMode.DISABLED:
            self.arenas.close(over)
        if self._mode is not AutoresetMode.SAME_STEP:
            return observation
        self.arenas.renew(over)
        infos.update(self._begun(over))
        self._over = np.zeros_like(over)
        return self.arenas.observation()

    def _begun(self, arenas: BoolArray) -> dict[str, Any]:
        """Return the infos of new episodes: seed and random numbers."""
        infos: dict[str, Any] = {"seed": np.where(arenas, self.arenas.seeds, 0), "_seed": arenas.copy()}
        rows = [_numbers(self.arenas.values[arena]) for arena in np.flatnonzero(arenas).tolist()]
        for path in [path for path in rows[0] if all(path in row for row in rows)]:
            numbers = np.array([row[path] for row in rows])  # integers if all are integers
            infos[path], infos[f"_{path}"] = np.zeros(self.num_envs, numbers.dtype), arenas.copy()
            infos[path][arenas] = numbers
        return infos

    def _mask(self, options: Mapping[str, Any]) -> BoolArray:
        """Return the arenas that `reset` renews, (arenas,): those of `reset_mask`, else all."""
        mask = np.asarray(options.get("reset_mask", np.ones(self.num_envs, np.bool_)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            expected = f"expected truth values ({self.num_envs},), one or more of them true"
            raise BadArgument("options", "reset_mask", f"{expected}; got {mask.dtype} {mask.shape}")
        return mask.copy()


def _numbers(values: Mapping[str, object]) -> dict[str, Any]:
    """Return the values that are numbers, since tools convert infos to tensors."""
    return {path: value for path, value in values.items() if isinstance(value, Real)}


def _box(low: Float32Array, high: Float32Array) -> Box[Any]:
    return Box(low, high, dtype=np.float32)
