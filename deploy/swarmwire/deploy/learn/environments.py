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
    """One arena, whose agents are the robots that the policy controls.

    Robots that die stay among the agents, with observations of 0, since an event may revive them. All agents are over
    together: terminated by a condition, or truncated at the scenario's `duration_s`.

    Copies and pickles continue where the original is: they run its episode again up to there.

    Attributes:
        arenas: the arena behind it.
        layouts: by controlled group, what the numbers of observations and actions are.
        state_space: of `state`.
        trajectory_sha256: of the episode that ended last; empty before the first end, or without `hashes`.
    """

    def __init__(self, scenario: Path | str | Mapping[str, Any], options: EnvOptions) -> None:
        """BadInput for a scenario or options that cannot be."""
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
        self._has_number = (np.arange(self.arenas.sizes[1]) < lengths)[None]  # of the actions, (1, agents, numbers)
        high = np.full((len(self.arenas.robots), 7), np.inf, np.float32)
        self.state_space = _box(-high, high)
        for agent, layout, shape in zip(self.possible_agents, layouts, self._action_shapes, strict=True):
            self.observation_spaces[agent] = _box(layout.low, layout.high)
            self.action_spaces[agent] = Box(-1.0, 1.0, shape, np.float32)

    def observation_space(self, agent: str) -> Space[Any]:
        """The numbers that an agent sees."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """The numbers that an agent sets."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Float32Array], dict[str, dict[str, Any]]]:
        """Begin an episode: that of this seed, else the next one. Infos hold its seed and the numbers that it drew."""
        if seed is not None:
            self.arenas.seed({0: seed})
        self.arenas.renew(np.ones(1, np.bool_))
        self.agents = self.possible_agents.copy()
        facts = {"seed": int(self.arenas.seeds[0]), **_numbers(self.arenas.values[0])}
        return self._seen(), {agent: dict(facts) for agent in self.agents}

    def step(
        self, actions: dict[str, Float32Array]
    ) -> tuple[dict[str, Float32Array], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Every agent acts.

        RuntimeError before the first `reset`, and after the end of an episode until the next one. ValueError for a
        missing action, that of an unknown agent, and one of another shape or with a number that is not finite.
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
            self._seen(),
            dict(zip(agents, rewards[self.arenas.controlled].tolist(), strict=True)),
            dict.fromkeys(agents, bool(terminated[0])),
            dict.fromkeys(agents, bool(truncated[0])),
            {agent: {} for agent in agents},
        )

    def state(self) -> Float32Array:
        """The truth of all robots of the arena, (robots, 7): pose, velocity, 1 if alive; for centralised critics."""
        return self.arenas.truth()[0]

    def _table(self, actions: Mapping[str, Float32Array]) -> Float32Array:
        """The actions as an array (1, agents, numbers), with 0 beyond the numbers of an agent."""
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

    def _seen(self) -> dict[str, Float32Array]:
        observation = self.arenas.observation()[0]
        return {
            agent: observation[index, : self._sizes[index]].copy() for index, agent in enumerate(self.possible_agents)
        }


class SwarmVectorEnv(VectorEnv[Any, Any, Any]):
    """Many arenas side by side, each of them one environment with all its robots.

    An observation is (robots, numbers) and an action (robots, numbers); with the arenas in front they fold without a
    copy to (arenas x robots, numbers) for policies that share parameters. Robots of groups with fewer numbers have 0 in
    the last ones. A reward per robot becomes their mean, and is in infos as `robot_reward`.

    An arena that is over begins its next episode alone: in the next step, or in the same. With autoreset disabled it
    waits for a `reset` of its own: until then it stays over, its reward and its observations are 0.

    Copies and pickles continue where the original is: they run its episodes again up to there.

    Attributes:
        arenas: the arenas behind it.
        layouts: by controlled group, what the numbers of observations and actions are.
        trajectory_sha256: of the episode of each arena that ended last; empty before the first end, or without
            `hashes`.
    """

    observation_space: Space[Any]
    action_space: Space[Any]

    def __init__(
        self, scenario: Path | str | Mapping[str, Any], arenas: int, autoreset: Autoreset, options: EnvOptions
    ) -> None:
        """BadInput for a scenario or options that cannot be."""
        if autoreset not in MODES:
            raise BadInput("autoreset", "", f"expected one of {', '.join(MODES)}; got {autoreset!r}")
        self.arenas = Arenas(scenario, arenas, options)
        self.num_envs, self._mode = arenas, MODES[autoreset]
        self.metadata = {"autoreset_mode": self._mode, "render_modes": []}
        self.trajectory_sha256 = ("",) * arenas
        first = self.arenas.settings.first
        self.layouts = first.layouts
        low, high = (np.zeros((len(self.arenas.controlled), self.arenas.sizes[0]), np.float32) for _ in range(2))
        place = 0
        for name, layout in first.layouts.items():
            rows = slice(place, place + first.scenario.robots[name].count)
            low[rows, : len(layout.low)], high[rows, : len(layout.high)] = layout.low, layout.high
            place = rows.stop
        self.single_observation_space = _box(low, high)
        self.single_action_space = Box(-1.0, 1.0, (len(low), self.arenas.sizes[1]), np.float32)
        self.observation_space = batch_space(self.single_observation_space, arenas)
        self.action_space = batch_space(self.single_action_space, arenas)
        self._over: BoolArray = np.zeros(arenas, np.bool_)
        self._flags: tuple[BoolArray, BoolArray] = self._over, self._over  # of the last step

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode in each arena: with one seed s, arena i has s + i; with a list its own; else the next.

        With `options["reset_mask"]` (arenas,) only in these arenas, and only they take seeds. ValueError for a mask or
        seeds that cannot be.
        """
        renewed = self._mask(options or {})
        if seed is not None:
            many = range(self.num_envs)
            seeds = [int(seed) + arena for arena in many] if isinstance(seed, int | np.integer) else seed
            if len(seeds) != self.num_envs:
                raise BadArgument("seed", "", f"expected one seed, or {self.num_envs}; got {len(seeds)}")
            self.arenas.seed({arena: each for arena, each in enumerate(seeds) if renewed[arena] and each is not None})
        if isinstance(seed, int | np.integer):
            super().reset(seed=int(seed))  # for `np_random`
        self.arenas.renew(renewed)
        self._over, (terminated, truncated) = self._over & ~renewed, self._flags
        self._flags = terminated & ~renewed, truncated & ~renewed
        return self.arenas.observation(), self._begun(renewed)

    def step(self, actions: Float32Array) -> tuple[Float32Array, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Every robot acts, (arenas, robots, numbers).

        RuntimeError if no arena can, as all wait for a reset; ValueError for actions of another shape, or with a
        number that is not finite.
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
        now = flags[0] | flags[1]
        if self._mode is AutoresetMode.DISABLED:
            flags = [old & waiting | new for old, new in zip(self._flags, flags, strict=True)]
        self._over, self._flags = flags[0] | flags[1], (flags[0], flags[1])
        observation = self.arenas.observation()
        if now.any():
            observation = self._end(now, observation, infos)
        terminated, truncated = self._flags
        return observation, reward, terminated.copy(), truncated.copy(), infos

    def _end(self, over: BoolArray, observation: Float32Array, infos: dict[str, Any]) -> Float32Array:
        """End these episodes, with their infos, as the mode has it; returns the observations of the step."""
        if self.arenas.hashed:
            each = zip(over.tolist(), self.arenas.hexdigests(), self.trajectory_sha256, strict=True)
            self.trajectory_sha256 = tuple(new if now else old for now, new, old in each)
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
        """The infos of episodes that begin: seed, and the numbers that they drew."""
        infos: dict[str, Any] = {"seed": np.where(arenas, self.arenas.seeds, 0), "_seed": arenas.copy()}
        rows = [_numbers(self.arenas.values[arena]) for arena in np.flatnonzero(arenas).tolist()]
        for path in [path for path in rows[0] if all(path in row for row in rows)]:
            drawn = np.array([row[path] for row in rows])  # as integers only if all are
            infos[path], infos[f"_{path}"] = np.zeros(self.num_envs, drawn.dtype), arenas.copy()
            infos[path][arenas] = drawn
        return infos

    def _mask(self, options: Mapping[str, Any]) -> BoolArray:
        """The arenas that `reset` renews, (arenas,): those of `reset_mask`, else all."""
        mask = np.asarray(options.get("reset_mask", np.ones(self.num_envs, np.bool_)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            expected = f"expected truth values ({self.num_envs},), one or more of them true"
            raise BadArgument("options", "reset_mask", f"{expected}; got {mask.dtype} {mask.shape}")
        return mask.copy()


def _numbers(values: Mapping[str, object]) -> dict[str, Any]:
    """Without texts and lists: tools make tensors of infos."""
    return {path: value for path, value in values.items() if isinstance(value, Real)}


def _box(low: Float32Array, high: Float32Array) -> Box[Any]:
    return Box(low, high, dtype=np.float32)
