"""Environments in the wrappers of other libraries, as their documentation uses them, over the end of an episode.

SuperSuit comes with the tests where it has wheels. Stable-Baselines3 and TorchRL need PyTorch (gigabytes). The tests of
what is not installed skip.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.deploy.learn import parallel_env

FLOCKING = Path(__file__).parents[3] / "scenarios" / "flocking.toml"
ROBOTS, STEPS = 3, 10  # of an episode


def _environment(**options: Any) -> Any:
    overrides = ("duration_s=1", f"robots.flock.count={ROBOTS}")
    return parallel_env(FLOCKING, overrides=overrides, reward="order", seed=5, **options)


def _concatenated(env: Any, base_class: str, processes: int = 1) -> Any:
    supersuit = pytest.importorskip("supersuit")
    each = supersuit.pettingzoo_env_to_vec_env_v1(env)
    return supersuit.concat_vec_envs_v1(each, 2, num_cpus=processes, base_class=base_class)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # of SuperSuit's processes
@pytest.mark.parametrize("processes", [1, 2])
def test_supersuit_copies_run_the_episodes_of_the_original(processes: int) -> None:
    env = _environment()
    copies = _concatenated(env, "gymnasium", processes)
    actions = np.sin(np.arange(2 * ROBOTS * 4, dtype=np.float32)).reshape(2, ROBOTS, 4)
    actions[1] = actions[0]
    begun, _ = env.reset()
    for rows in copies.reset()[0].reshape(2, ROBOTS, -1):
        np.testing.assert_array_equal(rows, [*begun.values()])
    for step in range(1, STEPS + 1):
        observations, rewards, _, truncated, _ = copies.step(actions.reshape(2 * ROBOTS, 4))
        expected, reward, *_ = env.step(dict(zip(env.agents, actions[0], strict=True)))
        expected = env.reset()[0] if step == STEPS else expected  # it begins the next episode by itself
        for rows in observations.reshape(2, ROBOTS, -1):
            np.testing.assert_array_equal(rows, [*expected.values()])
        np.testing.assert_array_equal(rewards.reshape(2, ROBOTS), np.float32([[*reward.values()]] * 2))
        assert np.all(truncated) == (step == STEPS)
    first, second = copies.reset(seed=1)[0].reshape(2, ROBOTS, -1)
    assert (first != second).any()
    copies.close()


def test_stable_baselines3_trains_on_robots_of_supersuit() -> None:
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    robots = _concatenated(_environment(), "stable_baselines3")
    robots.venv.reset(seed=1)
    model = stable_baselines3.PPO("MlpPolicy", robots, n_steps=16, batch_size=32, n_epochs=1, device="cpu")
    model.learn(2 * 16 * 2 * ROBOTS)  # two updates, over the ends of three episodes
    assert model.num_timesteps == 2 * 16 * 2 * ROBOTS
    assert np.isfinite(model.predict(robots.reset())[0]).all()


@pytest.mark.filterwarnings("default")  # of versions of PettingZoo, and of what PyTorch deprecates
def test_torchrl_rolls_out_several_episodes() -> None:
    envs = pytest.importorskip("torchrl.envs")
    env = _environment()
    wrapped = envs.PettingZooWrapper(env, return_state=True, group_map={"flock": env.possible_agents})
    envs.check_env_specs(wrapped)
    rollout = wrapped.rollout(25, break_when_any_done=False)
    assert rollout["next", "done"].flatten().nonzero().flatten().tolist() == [STEPS - 1, 2 * STEPS - 1]
    assert rollout["flock", "observation"].shape[:2] == (25, ROBOTS)
    assert rollout["state"].shape == (25, ROBOTS, 7)
